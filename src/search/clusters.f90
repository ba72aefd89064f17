!> Decides whether the collisions of a few disks that almost touch each other end, or whether their
!> number is unbounded (inelastic collapse).
!>
!> The disks of such a cluster move so little that the normals of their contacts hardly change. The
!> state of the cluster is therefore not described by positions and velocities. It is described by
!> the gap of each contact and the velocity at which the gap closes. In a collapse these numbers
!> decrease by hundreds of powers of ten. The gaps and velocities remain exact to rounding.
!> Differences of positions would soon be smaller than the rounding errors of the positions.
!>
!> Motion along the surfaces is included to first order. Two disks at a distance r that slip past
!> each other with velocity w separate with the acceleration w**2/r (Zhou and Kadanoff, Physical
!> Review E 54, 623 (1996)). The normal of their contact turns with the angular velocity w/r, which
!> matters only for the tangential impulses of rough disks.
module clusters
  use kinds, only: int32, real64
  use restitution_law, only: normal_law_t
  use tangential_law, only: tangential_impulse, tangential_law_t
  implicit none
  private
  public :: cluster_t, contact_t, most_disks

  integer(int32), parameter :: most_disks = 40       !! maximum number of disks in a cluster
  !> A series of collisions is considered unbounded in two cases. Either the number of collisions,
  !> divided by the square of the number of colliding disks, exceeds `longest` (`longest_rough` for
  !> rough disks), or the closing velocities have decreased by the factor `negligible_ratio`. Finite
  !> series are shorter and slow down less, except within about 1 % of a limit of collapse.
  integer, parameter :: longest = 24, longest_rough = 240
  real(real64), parameter :: negligible_ratio = 1.0e-200_real64
  !> Maximum angle between the contact normals of a row of disks that is straight except for
  !> rounding errors. The rounding errors must not end the collapse of the row.
  real(real64), parameter :: straight = 2.0_real64**(-33)

  !> A contact of two disks, or of a disk with a side or an obstacle. The tangent of a contact is
  !> its normal turned by -90 degrees.
  type :: contact_t
    integer(int32) :: first = 0                      !! index of a disk in the cluster
    integer(int32) :: second = 0      !! index of the other disk in the cluster; 0 for a side or an obstacle
    real(real64) :: normal(2) = 0.0_real64           !! unit vector from the first disk to its partner
    real(real64) :: distance = huge(1.0_real64)      !! distance between the centres of two disks [length]
    real(real64) :: gap = 0.0_real64                 !! distance between the surfaces [length]
    real(real64) :: closing = 0.0_real64             !! velocity at which the gap closes [length/time]
    !> Tangential velocity of the partner relative to the first disk [length/time].
    real(real64) :: sliding = 0.0_real64
    !> Tangential velocity of the first surface relative to the other [length/time].
    real(real64) :: slip = 0.0_real64
    real(real64) :: turn = 0.0_real64      !! angle by which the normal has turned towards the tangent
    type(normal_law_t) :: law = normal_law_t()
    type(tangential_law_t) :: tangential = tangential_law_t()
  end type contact_t

  !> Velocity changes at each contact (first index) per unit impulse at another contact (second
  !> index) [1/mass].
  type :: couplings_t
    !> Normal velocity change by a normal impulse; equal to the tangential velocity change by a
    !> tangential impulse.
    real(real64), allocatable :: along(:, :)
    real(real64), allocatable :: across(:, :)        !! tangential velocity change by a normal impulse
    !> Tangential velocity change of rotating surfaces by a tangential impulse.
    real(real64), allocatable :: rims(:, :)
  end type couplings_t

  type :: cluster_t
    integer(int32) :: n = 0                          !! number of disks
    real(real64) :: mass(most_disks) = 1.0_real64    !! [mass]
    real(real64) :: inertia = 0.5_real64             !! moment of inertia divided by mass times radius squared
    type(contact_t), allocatable :: contact(:)
  contains
    procedure :: follow
    procedure, private :: couplings
    procedure, private :: advance
    procedure, private :: collide
  end type cluster_t

contains

  !> Follows the collisions of a cluster. Ends when no more collisions occur, the time limit is
  !> reached, or the number of collisions is known to be unbounded.
  pure subroutine follow(self, limit, endless, duration, events)
    class(cluster_t), intent(inout) :: self
    real(real64), intent(in) :: limit                !! [time]
    logical, intent(out) :: endless                  !! whether the number of collisions is unbounded
    real(real64), intent(out) :: duration   !! time of the last collision, or limit point of a collapse [time]
    integer, intent(out) :: events(most_disks)       !! number of collisions of each disk
    type(couplings_t) :: coupling
    real(real64) :: slow, s, earliest                ! [length/time], [time], [time]
    integer :: step, k, next, last, most

    coupling = self%couplings()
    endless = .false.
    duration = 0
    events = 0
    last = 0
    slow = negligible_ratio*maxval(abs(self%contact%closing))
    most = merge(longest_rough, longest, any(self%contact%tangential%is_rough()))
    step = 0
    do while (step < most*max(count(events > 0), 2)**2)
      step = step + 1
      next = 0
      earliest = limit - duration
      do k = 1, size(self%contact)
        if (k == last .or. .not. self%contact(k)%closing > 0) cycle
        s = time_to_close(self%contact(k))
        if (s < earliest) then
          earliest = s
          next = k
        end if
      end do
      if (next == 0) return
      duration = duration + earliest
      call self%advance(earliest)
      if (self%contact(next)%closing < slow) exit
      call self%collide(coupling, next)
      last = next
      do k = 1, self%n
        if (any([self%contact(next)%first, self%contact(next)%second] == k)) events(k) = events(k) + 1
      end do
    end do
    endless = .true.
  end subroutine follow

  !> Advances the disks by the time s.
  pure subroutine advance(self, s)
    class(cluster_t), intent(inout) :: self
    real(real64), intent(in) :: s                    !! [time]
    integer :: k

    do k = 1, size(self%contact)
      associate (contact => self%contact(k))
        contact%gap = max(contact%gap - (contact%closing - 0.5_real64*opening(contact)*s)*s, 0.0_real64)
        contact%closing = contact%closing - opening(contact)*s
        contact%turn = contact%turn + contact%sliding/contact%distance*s
      end associate
    end do
  end subroutine advance

  !> Executes the collision of a contact.
  pure subroutine collide(self, coupling, next)
    class(cluster_t), intent(inout) :: self
    type(couplings_t), intent(in) :: coupling
    integer, intent(in) :: next
    real(real64) :: across(size(self%contact))       ! [1/mass]
    ! reduced mass [mass], [length/time], impulses [mass length/time]
    real(real64) :: mass, velocity, normal, tangential

    associate (contact => self%contact, along => coupling%along(:, next))
      mass = 1/coupling%along(next, next)
      velocity = -contact(next)%law%coefficient_at(contact(next)%closing)*contact(next)%closing
      normal = mass*(contact(next)%closing - velocity)
      tangential = tangential_impulse(contact(next)%tangential, self%inertia, mass, contact(next)%slip, normal)
      across = coupling%across(:, next) + (contact(next)%turn - contact%turn)*along
      contact%closing = contact%closing - along*normal - across*tangential
      contact%sliding = contact%sliding + across*normal - along*tangential
      contact%slip = contact%slip - across*normal + (along + coupling%rims(:, next))*tangential
      contact(next)%closing = velocity
      contact(next)%gap = 0
    end associate
  end subroutine collide

  !> Couplings between all contacts.
  pure function couplings(self) result(coupling)
    class(cluster_t), intent(in) :: self
    type(couplings_t) :: coupling
    real(real64) :: shared(2), sine                  ! 1/mass [1/mass]; sine of the angle between the normals
    integer :: e, f

    associate (n => size(self%contact))
      allocate (coupling%along(n, n), coupling%across(n, n), coupling%rims(n, n))
      do f = 1, n
        do e = 1, n
          associate (a => self%contact(e), b => self%contact(f))
            shared = term(a%first, b%first, 1) + term(a%first, b%second, -1) + term(a%second, b%first, -1) &
              + term(a%second, b%second, 1)
            coupling%along(e, f) = shared(1)*dot_product(a%normal, b%normal)
            sine = a%normal(2)*b%normal(1) - a%normal(1)*b%normal(2)
            coupling%across(e, f) = merge(shared(1)*sine, 0.0_real64, abs(sine) > straight)
            coupling%rims(e, f) = shared(2)/self%inertia
          end associate
        end do
      end do
    end associate
  contains

    !> Inverse mass of the disk shared by two contacts, first with the given sign and then without
    !> it; 0 if the contacts share no disk.
    pure function term(i, j, sign)
      integer(int32), intent(in) :: i, j             !! numbers of the disks
      integer, intent(in) :: sign
      real(real64) :: term(2)                        !! [1/mass]

      term = 0
      if (i == j .and. i > 0) term = [sign, 1]/self%mass(i)
    end function term
  end function couplings

  pure function time_to_close(contact) result(s)
    type(contact_t), intent(in) :: contact
    real(real64) :: s, disc                          ! [time], [(length/time)**2]

    s = huge(s)
    disc = contact%closing**2 - 2*opening(contact)*contact%gap
    if (disc >= 0) s = 2*contact%gap/(contact%closing + sqrt(disc))
  end function time_to_close

  !> Acceleration at which the gap opens, because the disks slip past each other.
  pure function opening(contact)
    type(contact_t), intent(in) :: contact
    real(real64) :: opening                          !! [length/time**2]

    opening = contact%sliding**2/contact%distance
  end function opening

end module clusters
