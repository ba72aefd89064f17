!> Event-driven Brownian dynamics: each kick draws the velocities of all disks from the Maxwell
!> distribution. The Andersen thermostat and active disks extend this type.
module brownian
  use kinds, only: int32, int64, real64
  use box_geometry, only: box_t
  use fields, only: fields_t
  use kicks, only: change_spin, change_velocity, interrupt_disk
  use random_stream, only: kicked_disks, key_of_draws, random_stream_t
  use simulation_state, only: drive_t, simulation_t
  use variable_rows, only: choice_t
  implicit none
  private
  public :: brownian_t, choices, word

  character(len=*), parameter :: word = "brownian"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("kind", word, "Event-driven Brownian dynamics: kicks assign new velocities from the Maxwell distribution to all " &
      //"disks.")]

  type, extends(drive_t) :: brownian_t
    real(real64) :: temperature = 0.0_real64     !! kT of the Maxwell distribution [energy]
  contains
    procedure :: read => read_bath
    procedure :: check
    procedure :: kick
    procedure :: speed2
    procedure :: draw_hit
    procedure :: propel
  end type brownian_t

contains

  !> Reads the variables of Brownian dynamics.
  subroutine read_bath(self, fields)
    class(brownian_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields

    call fields%read("temperature", self%temperature)
  end subroutine read_bath

  !> Reports a temperature of 0, at which each kick would stop the disks.
  subroutine check(self, fields, box, count, radius)
    class(brownian_t), intent(in) :: self
    class(fields_t), intent(inout) :: fields
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: count(:)
    real(real64), intent(in) :: radius(:)

    if (fields%is_sound("temperature") .and. .not. self%temperature > 0) &
      call fields%complain("temperature", "0 needs kind = 'active'; allowed: a number > 0")
  end subroutine check

  !> Draws new velocities and angular velocities. In a sheared box the new velocities are relative
  !> to the velocity profile. The random numbers depend only on the seed, the id of the disk and the
  !> number of the kick. They do not depend on the order of the disks or the history of the run.
  subroutine kick(self, sim, kicked)
    class(brownian_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), allocatable, intent(out) :: kicked(:)
    type(random_stream_t) :: stream
    real(real64) :: z(2), v(2)
    integer(int64) :: key
    integer(int32) :: i, n
    logical :: is_hit

    key = key_of_draws(sim%seed, kicked_disks)
    allocate (kicked(sim%n_disks()))
    n = 0
    do i = 1, sim%n_disks()
      if (.not. (self%acts_on(sim%tag(i)%species) .and. sim%is_inside(i))) cycle
      call stream%seed_disk(key, sim%tag(i)%id, sim%n_kicks)
      call self%draw_hit(stream, is_hit)
      if (.not. is_hit) cycle
      call interrupt_disk(sim, i)
      call stream%draw_normals(z)
      v = sim%box%shear_profile(sim%disk(i)%x) + sqrt(self%temperature/sim%mass_of(i))*z
      call self%propel(sim, i, v)
      call change_velocity(sim, i, v)
      if (sim%features%rotation) then
        call stream%draw_normals(z)
        call change_spin(sim, i, sqrt(self%temperature/sim%inertia_of(i))*z(1))
      end if
      n = n + 1
      kicked(n) = i
    end do
    kicked = kicked(:n)
  end subroutine kick

  !> Mean square of the velocities set by a kick.
  pure function speed2(self, mass)
    class(brownian_t), intent(in) :: self
    real(real64), intent(in) :: mass             !! [mass]
    real(real64) :: speed2                       !! [(length/time)**2]

    speed2 = 2*self%temperature/mass
  end function speed2

  !> Decides whether a kick affects a disk. In Brownian dynamics, every kick affects all disks.
  subroutine draw_hit(self, stream, is_hit)
    class(brownian_t), intent(in) :: self
    type(random_stream_t), intent(inout) :: stream
    logical, intent(out) :: is_hit

    is_hit = .true.
  end subroutine draw_hit

  !> Adds the self-propulsion velocity of disk i, which is zero in Brownian dynamics.
  subroutine propel(self, sim, i, v)
    class(brownian_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(inout) :: v(2)          !! [length/time]
  end subroutine propel

end module brownian
