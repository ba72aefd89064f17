!> The collisions of a few disks that almost touch each other: do these collisions end, or is their number unbounded (inelastic
!> collapse)?
!>
!> The disks of a cluster move so little that the normals of their contacts do not change. The state of a cluster is therefore the
!> gap of each contact and the velocity at which this gap closes, and not the positions and velocities of the disks. Gaps and
!> closing velocities have no common part that limits their precision: they can decrease by hundreds of powers of ten, as in a
!> collapse, without becoming dominated by rounding errors. The motion of the disks along their surfaces is included to first order:
!> two disks that slip past each other at the velocity w separate with the acceleration w**2/r, where r is their distance (Zhou and
!> Kadanoff, Physical Review E 54, 623 (1996)).
module clusters
  use kinds, only: int32, real64
  use collisions, only: speed_law_t
  implicit none
  private
  public :: cluster_t, contact_t, most_disks

  integer(int32), parameter :: most_disks = 40       !! largest number of disks in a cluster
  !> A series is unbounded if it has more than `longest` collisions per square of the number of disks that collide, or if closing
  !> velocities have decreased by the factor `slowest`. Finite series are shorter and less slow, except within about 1 % of a limit
  !> of collapse.
  integer, parameter :: longest = 24
  real(real64), parameter :: slowest = 1.0e-200_real64

  !> A contact of two disks, or of a disk with a side or an obstacle.
  type :: contact_t
    integer(int32) :: first = 0                      !! number of a disk in the cluster
    integer(int32) :: second = 0                     !! number of the other disk; 0 for a side or an obstacle
    real(real64) :: normal(2) = 0.0_real64           !! unit vector from the first disk to its partner
    real(real64) :: gap = 0.0_real64                 !! distance of the surfaces [length]
    real(real64) :: closing = 0.0_real64             !! velocity at which the gap closes [length/time]
    real(real64) :: opening = 0.0_real64             !! acceleration at which the gap opens [length/time**2]
    real(real64) :: restitution = 1.0_real64
    type(speed_law_t) :: by_speed = speed_law_t()
  end type contact_t

  type :: cluster_t
    integer(int32) :: n = 0                          !! number of disks
    real(real64) :: mass(most_disks) = 1.0_real64    !! [mass]
    type(contact_t), allocatable :: contact(:)
  contains
    procedure :: follow
  end type cluster_t

contains

  !> Follows the collisions until they end, until the time limit, or until their number is known to be unbounded.
  pure subroutine follow(self, limit, endless, duration, events)
    class(cluster_t), intent(inout) :: self
    real(real64), intent(in) :: limit                !! [time]
    logical, intent(out) :: endless                  !! whether the number of collisions is unbounded
    real(real64), intent(out) :: duration            !! time of the last collision, or of the limit point of a collapse [time]
    integer, intent(out) :: events(most_disks)            !! number of collisions of each disk
    real(real64) :: coupling(size(self%contact), size(self%contact)), slow, impulse, s, earliest
    integer :: step, k, next, last

    coupling = couplings(self)
    endless = .false.
    duration = 0
    events = 0
    last = 0
    slow = slowest*maxval(abs(self%contact%closing))
    associate (contact => self%contact)
      step = 0
      do while (step < longest*max(count(events > 0), 2)**2)
        step = step + 1
        next = 0
        earliest = limit - duration
        do k = 1, size(contact)
          if (k == last .or. .not. contact(k)%closing > 0) cycle
          s = time_to_close(contact(k))
          if (s < earliest) then
            earliest = s
            next = k
          end if
        end do
        if (next == 0) return
        duration = duration + earliest
        contact%gap = max(contact%gap - (contact%closing - 0.5_real64*contact%opening*earliest)*earliest, 0.0_real64)
        contact%closing = contact%closing - contact%opening*earliest
        contact(next)%gap = 0
        associate (velocity => contact(next)%closing)
          if (velocity < slow) exit
          impulse = (1 + restitution_of(contact(next)))*velocity/coupling(next, next)
          s = -restitution_of(contact(next))*velocity
        end associate
        contact%closing = contact%closing - coupling(:, next)*impulse
        contact(next)%closing = s
        last = next
        do k = 1, self%n
          if (any([contact(next)%first, contact(next)%second] == k)) events(k) = events(k) + 1
        end do
      end do
    end associate
    endless = .true.
  end subroutine follow

  !> Decrease of the closing velocity of each contact (first index) per impulse of another contact (second index).
  pure function couplings(self) result(coupling)
    class(cluster_t), intent(in) :: self
    real(real64) :: coupling(size(self%contact), size(self%contact))      !! [1/mass]
    integer :: e, f

    do f = 1, size(self%contact)
      do e = 1, size(self%contact)
        associate (a => self%contact(e), b => self%contact(f))
          coupling(e, f) = 0
          if (a%first == b%first) coupling(e, f) = coupling(e, f) + 1/self%mass(a%first)
          if (a%first == b%second) coupling(e, f) = coupling(e, f) - 1/self%mass(a%first)
          if (a%second > 0 .and. a%second == b%first) coupling(e, f) = coupling(e, f) - 1/self%mass(a%second)
          if (a%second > 0 .and. a%second == b%second) coupling(e, f) = coupling(e, f) + 1/self%mass(a%second)
          coupling(e, f) = coupling(e, f)*dot_product(a%normal, b%normal)
        end associate
      end do
    end do
  end function couplings

  !> Time until a closing gap is closed.
  pure function time_to_close(contact) result(s)
    type(contact_t), intent(in) :: contact
    real(real64) :: s, disc                          ! [time], [(length/time)**2]

    s = huge(s)
    disc = contact%closing**2 - 2*contact%opening*contact%gap
    if (disc >= 0) s = 2*contact%gap/(contact%closing + sqrt(disc))
  end function time_to_close

  !> Coefficient of restitution at the present closing velocity.
  pure function restitution_of(contact) result(xi)
    type(contact_t), intent(in) :: contact
    real(real64) :: xi

    xi = contact%by_speed%restitution_at(contact%restitution, contact%closing)
  end function restitution_of

end module clusters
