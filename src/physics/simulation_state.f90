!> All that a simulation is. What the input gives is not in a checkpoint; what is marked as derived in `disks` is not
!> either; all the rest is.
module simulation_state
  use kinds, only: int32, int64, real64
  use box_geometry, only: box_t
  use partners, only: n_sides
  use collisions, only: contact_law_t
  use disks, only: disk_t, species_t, tag_t
  use exact_sums, only: exact_sum_t
  use free_flight, only: flight, flight_velocity
  implicit none
  private
  public :: simulation_t

  type :: simulation_t
    ! Given by the input
    type(box_t) :: box
    type(contact_law_t) :: law
    type(species_t), allocatable :: species(:)
    real(real64), allocatable :: mass(:)          !! (n) by `tag%id`, if they are not those of the species [mass]
    logical :: own_sizes = .false.                !! masses and radii are not those of the species: checkpoints have them
    ! Stored in a checkpoint
    type(disk_t), allocatable :: disk(:)          !! (n) in the order of cells; `tag%id` is their number in the input
    type(tag_t), allocatable :: tag(:)            !! (n)
    integer(int64), allocatable :: image(:, :)    !! (2,n) periods travelled: true position = x + image*edges; (2,0) between walls
    real(real64) :: epoch = 0.0_real64            !! the moment from which `now` and the clocks count [time]
    real(real64) :: now = 0.0_real64              !! since the epoch [time]
    real(real64) :: epoch_begin = 0.0_real64      !! since the epoch [time]
    real(real64) :: epoch_end = 0.0_real64        !! when the epoch moves, since the epoch; 0: not known yet [time]
    integer(int64) :: epoch_events = 0            !! `events` at the beginning of the epoch
    ! A collapse is an endless series of events during which time does not advance.
    real(real64) :: blink = 0.0_real64            !! in which nothing moves visibly; 0: not known yet [time]
    real(real64) :: last_advance = 0.0_real64     !! when time had last advanced by more than that, since the epoch [time]
    integer(int64) :: events_then = 0             !! `events` at that time
    ! Counts and sums since the start of the run
    integer(int64) :: events = 0                  !! collisions of any kind
    integer(int64) :: collisions = 0              !! of pairs
    integer(int64) :: wall_collisions(n_sides) = 0      !! left, right, bottom, top
    integer(int64) :: obstacle_collisions = 0
    type(exact_sum_t) :: wall_impulse(n_sides)    !! of |change of normal momentum| [mass length/time]
    type(exact_sum_t) :: virial                   !! of impulse times distance over pair collisions [energy]
    type(exact_sum_t) :: dissipated               !! kinetic energy lost in collisions [energy]
    real(real64) :: start_energy = 0.0_real64     !! kinetic energy at the start
  contains
    procedure :: time
    procedure :: n_disks
    procedure :: make_room
    procedure :: mass_of
    procedure :: masses
    procedure :: take_masses
    procedure :: position
    procedure :: velocity
    procedure :: kinetic_energy
    procedure :: start_sums
    procedure :: choose_units
  end type simulation_t

contains

  !> Time since the start of the run.
  pure function time(self) result(t)
    class(simulation_t), intent(in) :: self
    real(real64) :: t

    t = self%epoch + self%now
  end function time

  !> Number of disks.
  pure function n_disks(self) result(n)
    class(simulation_t), intent(in) :: self
    integer(int32) :: n

    n = size(self%disk, kind=int32)
  end function n_disks

  !> Makes room for n disks.
  pure subroutine make_room(self, n)
    class(simulation_t), intent(inout) :: self    !! with its box
    integer(int32), intent(in) :: n

    allocate (self%disk(n), self%tag(n))
    allocate (self%image(2, merge(n, 0, any(self%box%periodic))), source=0_int64)
  end subroutine make_room

  !> Mass of disk i.
  pure function mass_of(self, i) result(mass)
    class(simulation_t), intent(in) :: self
    integer(int32), intent(in) :: i
    real(real64) :: mass                          !! [mass]

    if (allocated(self%mass)) then
      mass = self%mass(self%tag(i)%id)
    else
      mass = self%species(self%tag(i)%species)%mass
    end if
  end function mass_of

  !> Masses of all disks, in their order.
  pure function masses(self) result(mass)
    class(simulation_t), intent(in) :: self
    real(real64) :: mass(size(self%disk))         !! [mass]
    integer(int32) :: i

    mass = [(self%mass_of(i), i=1, self%n_disks())]
  end function masses

  !> Keeps masses of all disks, as few as possible.
  pure subroutine take_masses(self, mass)
    class(simulation_t), intent(inout) :: self
    real(real64), intent(in) :: mass(:)           !! (n) in the order of the input [mass]
    integer :: s, first, last

    last = 0
    do s = 1, size(self%species)
      first = last + 1
      last = last + self%species(s)%count
      if (maxval(mass(first:last)) > minval(mass(first:last))) self%mass = mass
      self%species(s)%mass = maxval(mass(first:last))
    end do
  end subroutine take_masses

  !> Where disk i is now. Its own state, at its clock, stays as it is.
  pure function position(self, i) result(x)
    class(simulation_t), intent(in) :: self
    integer(int32), intent(in) :: i
    real(real64) :: x(2)                          !! [length]

    associate (d => self%disk(i))
      x = flight(d%x, d%v, self%box%gravity, self%now - d%clock)
    end associate
  end function position

  !> Velocity of disk i now.
  pure function velocity(self, i) result(v)
    class(simulation_t), intent(in) :: self
    integer(int32), intent(in) :: i
    real(real64) :: v(2)                          !! [length/time]

    associate (d => self%disk(i))
      v = flight_velocity(d%v, self%box%gravity, self%now - d%clock)
    end associate
  end function velocity

  !> Kinetic energy of all disks now.
  pure function kinetic_energy(self) result(energy)
    class(simulation_t), intent(in) :: self
    real(real64) :: energy, v(2)
    integer(int32) :: i

    energy = 0
    do i = 1, self%n_disks()
      v = self%velocity(i)
      energy = energy + 0.5_real64*self%mass_of(i)*dot_product(v, v)
    end do
  end function kinetic_energy

  !> Notes the energy of the start and chooses how fine the sums are, unless that has been done.
  pure subroutine start_sums(self)
    class(simulation_t), intent(inout) :: self

    if (self%dissipated%per_one > 0 .or. self%n_disks() == 0) return
    self%start_energy = self%kinetic_energy()
    call self%choose_units()
  end subroutine start_sums

  !> The units of the sums, from what a collision can contribute at most given the energy of the start. Nothing is lost
  !> if it is more: disks that fall through periodic sides gain energy for ever.
  pure subroutine choose_units(self)
    class(simulation_t), intent(inout) :: self
    real(real64) :: energy, impulse, mass

    mass = sum(self%species%count*self%species%mass)
    energy = self%start_energy + mass*sum(abs(self%box%gravity)*self%box%edges())
    impulse = sqrt(8*maxval(self%species%mass))*sqrt(energy)
    call self%dissipated%choose_unit(energy)
    call self%wall_impulse%choose_unit(impulse)
    call self%virial%choose_unit(impulse*2*maxval(self%disk%radius))
  end subroutine choose_units

end module simulation_state
