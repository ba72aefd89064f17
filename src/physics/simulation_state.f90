!> The complete state of a simulation. Checkpoints contain everything except the values given by the input and the data that
!> are marked as derived in `disks`.
module simulation_state
  use kinds, only: int32, int64, never, real64
  use box_geometry, only: box_t
  use collisions, only: contact_law_t
  use disks, only: disk_t, extra_t, series_t, species_by_id, species_t, tag_t, whole_disk_t
  use drive, only: drive_t
  use features, only: features_t
  use free_flight, only: flight, flight_velocity
  use images, only: images_t
  use tally, only: kinetic_flux, flux_changes, tally_t
  implicit none
  private
  public :: specification_t, simulation_t, system_t

  !> Factors that determine the bound for the terms of a sum: see `exact_sums: choose_unit`. The bound is the smaller of two values,
  !> which are `common` times a typical term of the heaviest disks and `rare` times a typical term of the lightest disks.
  real(real64), parameter :: common = 2.0_real64**7, rare = 2.0_real64**22
  !> Factor by which the units of the sums are multiplied in driven simulations. The work of walls and kicks may be far less than
  !> the estimate from their parameters. With the factor `finer` the units are so small that the sums resolve the work even if it is
  !> far less than the estimate.
  real(real64), parameter :: finer = 2.0_real64**(-30)

  !> The system: box, contact law, driving and features, which together determine the motion of the disks.
  type :: system_t
    type(box_t) :: box
    type(contact_law_t) :: law
    type(drive_t) :: drive
    type(features_t) :: features                  !! optional features
  end type system_t

  !> Values given by the input, which are the same in all domains of a simulation.
  type, extends(system_t) :: specification_t
    type(species_t), allocatable :: species(:)
    integer(int64) :: seed = 1                    !! seed of random numbers drawn during the run
  end type specification_t

  !> A simulation: the values given by the input, and the state that a checkpoint stores.
  type, extends(specification_t) :: simulation_t
    type(disk_t), allocatable :: disk(:)          !! (n) disks, sorted by cells; their numbers in the input are in `tag%id`
    type(tag_t), allocatable :: tag(:)            !! (n)
    real(real64), allocatable :: own_mass(:)      !! (n) individual masses, allocated if masses within a species differ [mass]
    type(extra_t), allocatable :: extra(:)        !! (n) optional data, allocated if `has_extra`
    !> (n) Series of simultaneous collisions, in the order of ids; allocated if disks can collapse.
    type(series_t), allocatable :: series(:)
    !> (n) Number of times that each disk has been recycled, in the order of ids; allocated if the driving moves disks.
    integer(int64), allocatable :: recycled(:)
    real(real64) :: now = 0.0_real64              !! present time, relative to the time origin `box%epoch` [time]
    logical :: events_done = .false.              !! whether all events up to and including the time `now` have been executed
    real(real64) :: epoch_begin = 0.0_real64      !! start of the epoch, relative to the time origin `box%epoch` [time]
    real(real64) :: epoch_end = 0.0_real64        !! end of the epoch, relative to `box%epoch`; 0 if not known yet [time]
    integer(int64) :: epoch_events = 0            !! number of events from the start of the run to the start of the epoch
    ! The components `negligible_time`, `last_advance` and `events_then` serve to detect that time no longer advances.
    real(real64) :: negligible_time = 0.0_real64  !! duration in which no disk moves noticeably; 0 if not known yet [time]
    !> Time at which the simulation last advanced by more than `negligible_time`, relative to the time origin `box%epoch` [time]
    real(real64) :: last_advance = 0.0_real64
    integer(int64) :: events_then = 0             !! number of events that had been executed at the time `last_advance`
    integer(int64) :: kicks = 0                   !! number of kicks since the start of the run
    integer(int64) :: changes = 0                 !! number of changes by the caller since the start of the run: see `changes`
    type(tally_t) :: tally                        !! counters and sums since the start of the run
    real(real64) :: start_energy = 0.0_real64     !! kinetic energy at the start of the run [energy]
    !> Kinetic energy when the velocities were last set: at the start of the run, or by a change [energy]
    real(real64) :: reference_energy = 0.0_real64
    real(real64) :: typical_speed2 = 0.0_real64   !! largest mean square speed at the start and after changes [(length/time)**2]
  contains
    procedure :: time
    procedure :: has_reached
    procedure :: n_disks
    procedure :: list_disks
    procedure :: has_extra
    procedure :: has_collapsed
    procedure :: make_room
    procedure :: fit_series
    procedure :: whole_disk
    procedure :: place_disk
    procedure :: mass_of
    procedure :: masses
    procedure :: simplify_masses
    procedure :: images => images_now
    procedure :: position
    procedure :: velocity
    procedure :: spin
    procedure :: change_angular_momentum
    procedure :: rotate_to
    procedure :: register_contact
    procedure :: record_velocity_change
    procedure :: inertia_of
    procedure :: kinetic_energy
    procedure :: is_driven
    procedure :: start_sums
    procedure :: choose_units
    procedure :: mean_square_speed
    procedure :: fastest_drive
  end type simulation_t

contains

  !> Time since the start of the run.
  pure function time(self) result(t)
    class(simulation_t), intent(in) :: self
    real(real64) :: t

    t = self%box%epoch + self%now
  end function time

  !> Whether a time has been reached and all events at this time have been executed. A run can stop at a time before all
  !> simultaneous events have been executed.
  pure function has_reached(self, t) result(yes)
    class(simulation_t), intent(in) :: self
    real(real64), intent(in) :: t                 !! time since the start of the run [time]
    logical :: yes

    yes = self%events_done .and. self%time() >= t
  end function has_reached

  !> Number of disks.
  pure function n_disks(self) result(n)
    class(simulation_t), intent(in) :: self
    integer(int32) :: n

    n = size(self%disk, kind=int32)
  end function n_disks

  !> Allocates the disks of all species in the order of the input. The caller later sets masses that differ within a species.
  pure subroutine list_disks(self)
    class(simulation_t), intent(inout) :: self    !! in: simulation with all values given by the input
    integer(int32) :: i

    call self%make_room(sum(self%species%count))
    self%tag%id = [(i, i=1, self%n_disks())]
    self%tag%species = species_by_id(self%species)
    if (.not. allocated(self%own_mass)) return
    do i = 1, self%n_disks()
      self%own_mass(i) = self%species(self%tag(i)%species)%mass
    end do
  end subroutine list_disks

  !> Whether the disks have the optional data of `extra_t`.
  pure function has_extra(self) result(yes)
    class(simulation_t), intent(in) :: self
    logical :: yes

    yes = any(self%box%periodic) .or. self%law%contact_time > 0 .or. self%features%rotation .or. self%features%orientation
  end function has_extra

  !> Whether an inelastic collapse has occurred.
  pure function has_collapsed(self) result(yes)
    class(simulation_t), intent(in) :: self
    logical :: yes

    yes = self%tally%collapse < never
    if (yes) yes = self%tally%collapse <= self%time()
  end function has_collapsed

  !> Allocates the series of simultaneous collisions if disks can collapse, and deallocates them otherwise.
  pure subroutine fit_series(self)
    class(simulation_t), intent(inout) :: self

    if (self%law%can_collapse() .eqv. allocated(self%series)) return
    if (allocated(self%series)) then
      deallocate (self%series)
    else
      allocate (self%series(self%n_disks()))
    end if
  end subroutine fit_series

  !> Allocates the arrays for n disks.
  pure subroutine make_room(self, n, like)
    class(simulation_t), intent(inout) :: self    !! in: simulation with all values given by the input
    integer(int32), intent(in) :: n
    class(simulation_t), intent(in), optional :: like   !! the whole simulation, if `self` is a domain
    logical :: own_masses

    own_masses = self%features%own_sizes
    if (present(like)) own_masses = allocated(like%own_mass)
    allocate (self%disk(n), self%tag(n))
    if (self%has_extra()) allocate (self%extra(n))
    if (own_masses) allocate (self%own_mass(n), source=0.0_real64)
    if (self%drive%moves_disks() .and. .not. present(like)) allocate (self%recycled(n), source=0_int64)
    if (.not. present(like)) call self%fit_series()
  end subroutine make_room

  !> All data of disk i.
  pure function whole_disk(self, i) result(whole)
    class(simulation_t), intent(in) :: self
    integer(int32), intent(in) :: i
    type(whole_disk_t) :: whole

    whole%disk = self%disk(i)
    whole%tag = self%tag(i)
    if (allocated(self%own_mass)) whole%own_mass = self%own_mass(i)
    if (allocated(self%extra)) whole%extra = self%extra(i)
  end function whole_disk

  !> Sets all data of disk i to the given data, which are from this simulation or from another domain.
  pure subroutine place_disk(self, i, whole)
    class(simulation_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    type(whole_disk_t), intent(in) :: whole

    self%disk(i) = whole%disk
    self%tag(i) = whole%tag
    if (allocated(self%own_mass)) self%own_mass(i) = whole%own_mass
    if (allocated(self%extra)) self%extra(i) = whole%extra
  end subroutine place_disk

  !> Mass of disk i.
  pure function mass_of(self, i) result(mass)
    class(simulation_t), intent(in) :: self
    integer(int32), intent(in) :: i
    real(real64) :: mass                          !! [mass]

    if (allocated(self%own_mass)) then
      mass = self%own_mass(i)
    else
      mass = self%species(self%tag(i)%species)%mass
    end if
  end function mass_of

  !> Masses of all disks, in the order of the arrays.
  pure function masses(self) result(mass)
    class(simulation_t), intent(in) :: self
    real(real64) :: mass(size(self%disk))         !! [mass]
    integer(int32) :: i

    mass = [(self%mass_of(i), i=1, self%n_disks())]
  end function masses

  !> Sets the mass of each species to the largest mass of its disks. The array of individual masses is deallocated if the masses
  !> are equal within each species.
  pure subroutine simplify_masses(self)
    class(simulation_t), intent(inout) :: self
    logical :: equal
    integer :: s

    if (.not. allocated(self%own_mass)) return
    equal = .true.
    do s = 1, size(self%species)
      associate (own => self%tag%species == s)
        self%species(s)%mass = maxval(self%own_mass, mask=own)
        equal = equal .and. .not. minval(self%own_mass, mask=own) < self%species(s)%mass
      end associate
    end do
    if (equal) deallocate (self%own_mass)
  end subroutine simplify_masses

  !> Returns the periodic images of the box. Their times are relative to the time origin `box%epoch`.
  pure function images_now(self) result(images)
    class(simulation_t), intent(in) :: self
    type(images_t) :: images

    images = self%box%images(self%box%epoch)
  end function images_now

  !> Position of disk i at the present time. The stored state of the disk is not changed.
  pure function position(self, i) result(x)
    class(simulation_t), intent(in) :: self
    integer(int32), intent(in) :: i
    real(real64) :: x(2)                          !! [length]

    associate (d => self%disk(i))
      x = flight(d%x, d%v, self%box%gravity, self%now - d%clock)
    end associate
  end function position

  !> Velocity of disk i at the present time.
  pure function velocity(self, i) result(v)
    class(simulation_t), intent(in) :: self
    integer(int32), intent(in) :: i
    real(real64) :: v(2)                          !! [length/time]

    associate (d => self%disk(i))
      v = flight_velocity(d%v, self%box%gravity, self%now - d%clock)
    end associate
  end function velocity

  !> Angular velocity of disk i.
  pure function spin(self, i) result(omega)
    class(simulation_t), intent(in) :: self
    integer(int32), intent(in) :: i
    real(real64) :: omega                         !! [1/time]

    omega = 0
    if (self%features%rotation) omega = self%extra(i)%spin
  end function spin

  !> Changes the angular momentum of disk i.
  pure subroutine change_angular_momentum(self, i, change)
    class(simulation_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: change            !! [mass length**2/time]

    self%extra(i)%spin = self%extra(i)%spin + change/self%inertia_of(i)
  end subroutine change_angular_momentum

  !> Advances the orientation of disk i to the time t. `rotate_to` has to be called before `disks: advance_disk`, which changes the
  !> clock of the disk.
  pure subroutine rotate_to(self, i, t)
    class(simulation_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: t

    if (self%features%rotation) self%extra(i)%angle = self%extra(i)%angle + self%extra(i)%spin*(t - self%disk(i)%clock)
  end subroutine rotate_to

  !> Registers a contact of disk i at the time t. `elastic` becomes .true. if the previous contact of the disk has not ended yet (TC
  !> model).
  pure subroutine register_contact(self, i, t, elastic)
    class(simulation_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: t
    logical, intent(inout) :: elastic             !! in: whether the collision is already known to be elastic

    associate (last => self%extra(i)%last_contact)
      elastic = elastic .or. (self%tag(i)%collisions > 0 .and. t - last < self%law%contact_time)
      last = t
    end associate
  end subroutine register_contact

  !> Updates the sums of the flux changes after the velocity of disk i has changed at the time t. The time integral of a flux is the
  !> present flux times the present time, minus the sum over all changes of the flux, each multiplied by the time of the change. The
  !> expression for the time integral is exact at any time.
  pure subroutine record_velocity_change(self, i, before, t)
    class(simulation_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: before(2)         !! velocity of disk i before the change [length/time]
    real(real64), intent(in) :: t                 !! time relative to the time origin `box%epoch` [time]

    if (.not. self%features%helfand) return
    associate (mass => self%mass_of(i), sums => self%tally%sum(flux_changes:flux_changes + 4))
      call sums%add((kinetic_flux(mass, self%disk(i)%v) - kinetic_flux(mass, before))*(self%box%epoch + t))
    end associate
  end subroutine record_velocity_change

  !> Moment of inertia of disk i.
  pure function inertia_of(self, i) result(inertia)
    class(simulation_t), intent(in) :: self
    integer(int32), intent(in) :: i
    real(real64) :: inertia                       !! [mass length**2]

    inertia = self%law%inertia*self%mass_of(i)*self%disk(i)%radius**2
  end function inertia_of

  !> Kinetic energy of all disks at the present time, including rotation.
  pure function kinetic_energy(self) result(energy)
    class(simulation_t), intent(in) :: self
    real(real64) :: energy, v(2)
    integer(int32) :: i

    energy = 0
    do i = 1, self%n_disks()
      v = self%velocity(i)
      energy = energy + 0.5_real64*self%mass_of(i)*dot_product(v, v)
    end do
    if (.not. self%features%rotation) return
    do i = 1, self%n_disks()
      energy = energy + 0.5_real64*self%inertia_of(i)*self%spin(i)**2
    end do
  end function kinetic_energy

  !> Whether disks can gain energy from walls or driving, so that their speeds are not bounded.
  pure function is_driven(self) result(yes)
    class(simulation_t), intent(in) :: self
    logical :: yes

    yes = self%box%gives_energy() .or. self%drive%is_on()
  end function is_driven

  !> Records the initial energy and chooses the units of the sums, unless an earlier call has already done so.
  pure subroutine start_sums(self)
    class(simulation_t), intent(inout) :: self

    if (self%tally%sum(1)%per_one > 0 .or. self%n_disks() == 0) return
    self%start_energy = self%kinetic_energy()
    self%reference_energy = self%start_energy
    self%typical_speed2 = self%mean_square_speed()
    call self%choose_units()
  end subroutine start_sums

  !> Root mean square speed that kicks produce in the fastest species; 0 if the disks are not driven by kicks.
  pure function fastest_drive(self) result(speed)
    class(simulation_t), intent(in) :: self
    real(real64) :: speed                         !! [length/time]
    integer :: s

    speed = sqrt(maxval([0.0_real64, self%drive%speed2([(s, s=1, size(self%species))], self%species%mass)]))
  end function fastest_drive

  !> Mean square speed at the present time, including the surface speed of rotating disks.
  pure function mean_square_speed(self) result(speed2)
    class(simulation_t), intent(in) :: self
    real(real64) :: speed2                        !! [(length/time)**2]
    integer(int32) :: i

    speed2 = 0
    do i = 1, self%n_disks()
      speed2 = speed2 + (sum(self%velocity(i)**2) + (self%spin(i)*self%disk(i)%radius)**2)/self%n_disks()
    end do
  end function mean_square_speed

  !> Chooses the units of the sums according to the sizes of typical terms. The size of a typical term is estimated from the mean
  !> square speed of the disks and from the effects of gravity, walls and kicks. If masses differ widely, each term of the lightest
  !> disks still has 40 binary digits. Terms of the heaviest disks may exceed the bound of `exact_sum_t`; the addition of such rare
  !> terms takes slightly longer.
  pure subroutine choose_units(self)
    class(simulation_t), intent(inout) :: self
    real(real64) :: mass(size(self%disk)), kicked(size(self%species))    ! [mass, (length/time)**2]
    real(real64) :: speed2, light, heavy, small, large, length
    integer :: s

    mass = self%masses()
    light = minval(mass)
    heavy = maxval(mass)
    small = 2*minval(self%disk%radius)
    large = 2*maxval(self%disk%radius)
    length = maxval(self%box%edges())
    kicked = self%drive%speed2([(s, s=1, size(kicked))], self%species%mass)
    speed2 = self%typical_speed2 + sum(abs(self%box%gravity)*self%box%edges()) + self%box%highest_temperature()/light &
      + self%box%highest_speed()**2 + maxval(kicked)
    call self%tally%make_room(size(self%box%surface))
    call self%tally%choose_units(merge(finer, 1.0_real64, self%is_driven())*[ &
      min(common*heavy, rare*light)*speed2, &
      min(common*heavy, rare*light)*sqrt(speed2), &
      min(common*heavy*large, rare*light*small)*sqrt(speed2), &
      min(common*heavy*length, rare*light*small)*speed2, &
      min(common*heavy*length, rare*light*small)*sqrt(speed2)])
  end subroutine choose_units

end module simulation_state
