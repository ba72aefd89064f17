!> Active Brownian disks: Brownian dynamics with an additional self-propulsion velocity along the
!> orientation of each disk. The orientation diffuses. The orientation of chiral disks also turns at
!> a constant rate.
module active
  use kinds, only: int32, pi, real64
  use box_geometry, only: box_t
  use brownian, only: brownian_t
  use fields, only: fields_t
  use random_stream, only: orientations, random_stream_t
  use simulation_state, only: simulation_t
  use variable_rows, only: choice_t, in_motion, not_negative, variable_t
  implicit none
  private
  public :: active_t, choices, rows, word

  character(len=*), parameter :: word = "active"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("kind", word, "Active Brownian disks: kicks assign new velocities as with 'brownian', and also add a velocity " &
      //"(self_propulsion_speed) along the orientation of the disk. The orientation diffuses.")]
  type(variable_t), parameter :: rows(*) = [ &
    variable_t("drive", "self_propulsion_speed", "real", 1, "required", "1", &
      "Self-propulsion speed of active disks: each kick adds a velocity of this magnitude along the orientation of the disk.", &
      not_negative, "length/time", &
      goes_with="kind "//word, may_change=in_motion), &
    variable_t("drive", "rotational_diffusion", "real", 1, "fallback", "0", &
      "Rotational diffusion coefficient D_r of active disks: the variance of the orientation angle grows at the rate 2 D_r.", &
      not_negative, "1/time", goes_with="kind "//word, may_change=in_motion), &
    variable_t("drive", "turning_rate", "real", 1, "fallback", "0", &
      "Constant rate at which the orientation of active disks turns, in addition to its diffusion; positive counter-clockwise. " &
      //"Free disks whose orientation turns at this rate move on circles of radius self_propulsion_speed/turning_rate. Choose an " &
      //"interval well below 1/turning_rate.", unit="1/time", goes_with="kind "//word, may_change=in_motion)]

  type, extends(brownian_t) :: active_t
    real(real64) :: speed = 0.0_real64           !! self-propulsion speed [length/time]
    real(real64) :: rotational_diffusion = 0.0_real64   !! rotational diffusion coefficient [1/time]
    real(real64) :: turning_rate = 0.0_real64    !! constant angular velocity of the orientation [1/time]
  contains
    procedure :: read => read_propulsion
    procedure :: check
    procedure :: speed2
    procedure :: orients_disks
    procedure :: prepare
    procedure :: propel
  end type active_t

contains

  !> Reads the variables of active disks.
  subroutine read_propulsion(self, fields)
    class(active_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields

    call self%brownian_t%read(fields)
    call fields%read("self_propulsion_speed", self%speed)
    call fields%read("rotational_diffusion", self%rotational_diffusion)
    call fields%read("turning_rate", self%turning_rate)
  end subroutine read_propulsion

  !> Mean square of the velocities set by a kick.
  pure function speed2(self, mass)
    class(active_t), intent(in) :: self
    real(real64), intent(in) :: mass             !! [mass]
    real(real64) :: speed2                       !! [(length/time)**2]

    speed2 = self%brownian_t%speed2(mass) + self%speed**2
  end function speed2

  !> Accepts any temperature, because active disks move even at temperature 0.
  subroutine check(self, fields, box, count, radius)
    class(active_t), intent(in) :: self
    class(fields_t), intent(inout) :: fields
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: count(:)
    real(real64), intent(in) :: radius(:)
  end subroutine check

  !> Active disks have an orientation.
  pure function orients_disks(self) result(yes)
    class(active_t), intent(in) :: self
    logical :: yes

    yes = .true.
  end function orients_disks

  !> Draws the initial orientations from a uniform distribution.
  subroutine prepare(self, sim)
    class(active_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
    type(random_stream_t) :: stream
    real(real64) :: u
    integer(int32) :: i

    do i = 1, sim%n_disks()
      if (.not. self%acts_on(sim%tag(i)%species)) cycle
      call stream%seed_draw(sim%seed, orientations, sim%tag(i)%id, sim%n_kicks)
      call stream%draw_uniform(u)
      sim%extra(i)%angle = 2*pi*u
    end do
  end subroutine prepare

  !> Changes the orientation of disk i by the constant turning rate and by rotational diffusion, and
  !> adds the self-propulsion velocity.
  subroutine propel(self, sim, i, v)
    class(active_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(inout) :: v(2)          !! [length/time]
    type(random_stream_t) :: stream
    real(real64) :: z(2)

    associate (angle => sim%extra(i)%angle)
      call stream%seed_draw(sim%seed, orientations, sim%tag(i)%id, sim%n_kicks)
      call stream%draw_normals(z)
      angle = angle + self%turning_rate*self%interval + sqrt(2*self%rotational_diffusion*self%interval)*z(1)
      v = v + self%speed*[cos(angle), sin(angle)]
    end associate
  end subroutine propel

end module active
