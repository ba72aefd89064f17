!> White-noise driving: each kick adds a Gaussian random number to each velocity component of the
!> driven disks.
module noise
  use kinds, only: int32, int64, real64
  use box_geometry, only: box_t
  use exact_sums, only: exact_sum_t
  use fields, only: fields_t
  use kicks, only: change_velocity, interrupt_disk
  use random_stream, only: kicked_disks, key_of_draws, random_stream_t
  use simulation_state, only: drive_t, simulation_t
  use variable_rows, only: choice_t, in_motion, positive, variable_t
  implicit none
  private
  public :: noise_t, choices, rows, word

  character(len=*), parameter :: word = "noise"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("kind", word, "White-noise driving: kicks add a Gaussian random number to each velocity component, which heats " &
      //"the disks.")]
  type(variable_t), parameter :: rows(*) = [ &
    variable_t("drive", "strength", "real", 1, "required", "0.1", &
      "Strength of the noise: rate at which kicks increase the variance of each velocity component, equal for disks of all " &
      //"masses.", &
      positive, "velocity**2/time", goes_with="kind "//word, may_change=in_motion), &
    variable_t("drive", "keep_momentum", "logical", 1, "fallback", ".true.", &
      "Conservation of the total momentum of the driven disks: the mean velocity added by the noise is subtracted in each " &
      //"kick.", goes_with="kind "//word, may_change=in_motion)]

  type, extends(drive_t) :: noise_t
    !> Noise strength: growth rate of the variance of each velocity component [velocity**2/time].
    real(real64) :: strength = 0.0_real64
    logical :: keep_momentum = .true.            !! whether the noise conserves the total momentum
  contains
    procedure :: read => read_noise
    procedure :: check
    procedure :: kick
    procedure :: speed2
  end type noise_t

contains

  !> Reads the variables of white-noise driving.
  subroutine read_noise(self, fields)
    class(noise_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields

    call fields%read("strength", self%strength)
    call fields%read("keep_momentum", self%keep_momentum)
  end subroutine read_noise

  !> Reports noise that conserves momentum if only one disk is driven. The velocity of this disk
  !> would never change.
  subroutine check(self, fields, box, count, radius)
    class(noise_t), intent(in) :: self
    class(fields_t), intent(inout) :: fields
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: count(:)
    real(real64), intent(in) :: radius(:)
    integer :: s

    if (self%keep_momentum .and. sum(int(count, int64), mask=self%acts_on([(s, s=1, size(count))])) == 1) call fields%complain( &
      "keep_momentum", "cannot be combined with a single driven disk, whose velocity would never change; set it to .false.")
  end subroutine check

  !> Adds the noise to the velocities of all driven disks.
  subroutine kick(self, sim, kicked)
    class(noise_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), allocatable, intent(out) :: kicked(:)
    ! shape (2, n): random numbers of the driven disks, needed for restoring the momentum
    real(real64), allocatable :: draws(:, :)
    type(random_stream_t) :: stream
    real(real64) :: z(2), scale
    integer(int64) :: key
    integer(int32) :: i, n

    scale = sqrt(self%strength*self%interval)
    key = key_of_draws(sim%seed, kicked_disks)
    n = sim%n_disks()
    allocate (kicked(n), draws(2, merge(n, 0_int32, self%keep_momentum)))
    n = 0
    do i = 1, sim%n_disks()
      if (.not. (self%acts_on(sim%tag(i)%species) .and. sim%is_inside(i))) cycle
      call stream%seed_disk(key, sim%tag(i)%id, sim%n_kicks)
      call interrupt_disk(sim, i)
      call stream%draw_normals(z)
      call change_velocity(sim, i, sim%disk(i)%v + scale*z)
      n = n + 1
      kicked(n) = i
      if (self%keep_momentum) draws(:, n) = z
    end do
    kicked = kicked(:n)
    if (self%keep_momentum) call restore_momentum(sim, kicked, scale, draws)
  end subroutine kick

  !> Subtracts the mean of the velocities added by the noise. Sums over the disks are exact and
  !> therefore independent of the order of the disks.
  subroutine restore_momentum(sim, kicked, scale, draws)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: kicked(:)      !! indices of the n driven disks
    real(real64), intent(in) :: scale            !! standard deviation of the noise [length/time]
    real(real64), intent(in) :: draws(:, :)      !! Gaussian random numbers of unit variance; shape (2, n)
    type(exact_sum_t) :: momentum(2), mass
    real(real64) :: heaviest
    integer(int32) :: k

    heaviest = maxval(sim%species%mass)
    call momentum%choose_unit(16*heaviest*scale)
    call mass%choose_unit(heaviest)
    do k = 1, size(kicked, kind=int32)
      associate (i => kicked(k))
        call momentum%add(sim%mass_of(i)*scale*draws(:, k))
        call mass%add(sim%mass_of(i))
      end associate
    end do
    do k = 1, size(kicked, kind=int32)
      call change_velocity(sim, kicked(k), sim%disk(kicked(k))%v - momentum%value()/mass%value())
    end do
  end subroutine restore_momentum

  !> Mean square of the velocity added by a kick.
  pure function speed2(self, mass)
    class(noise_t), intent(in) :: self
    real(real64), intent(in) :: mass             !! [mass]
    real(real64) :: speed2                       !! [(length/time)**2]

    speed2 = 2*self%strength*self%interval
  end function speed2

end module noise
