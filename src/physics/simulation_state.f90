!> The complete state of a simulation. Checkpoints store all of it, except values given by the input
!> and data marked as derived in `disks`.
module simulation_state
  use kinds, only: int32, int64, never, real64
  use box_geometry, only: box_t
  use box_state, only: box_state_t
  use contact_law, only: contact_law_t
  use disks, only: disk_t, extra_t, series_t, source_t, species_by_id, species_t, tag_t, whole_disk_t
  use features, only: features_t
  use fields, only: fields_t
  use free_flight, only: flight, flight_velocity
  use images, only: images_t
  use tally, only: kinetic_flux, flux_changes, tally_t
  use texts, only: text_t
  implicit none
  private
  public :: change_t, drive_t, specification_t, simulation_t, system_t

  !> Driving: kicks at multiples of a time interval, which change velocities or positions of disks.
  !> Each kind of driving extends this type in a file of the folder `drives`. The abstract type is
  !> defined here, because a kick changes a simulation and a simulation contains its driving.
  !> Neither can be defined before the other.
  type, abstract :: drive_t
    real(real64) :: interval = never              !! time between kicks [time]
    integer :: species = 0                        !! index of the only driven species; 0 for all species
  contains
    procedure(read_drive), deferred :: read
    procedure(kick), deferred :: kick
    procedure(mean_square), deferred :: speed2
    procedure, non_overridable :: acts_on
    procedure :: acts_on_all
    procedure :: check
    procedure :: conflict
    procedure :: prepare
    procedure :: orients_disks
    procedure :: moves_disks
    procedure :: can_act
    procedure :: counter
  end type drive_t

  !> The system: contact law, driving, sources and features, which together with the box determine
  !> the motion of the disks.
  type :: system_t
    type(contact_law_t) :: law
    class(drive_t), allocatable :: drive          !! not allocated without driving
    type(source_t), allocatable :: source(:)      !! in the order of the file; not allocated without sources
    type(features_t) :: features                  !! optional features
  contains
    procedure :: kick_time
    procedure :: kick_counter
    procedure :: has_extra
  end type system_t

  !> A change of the system at a time known in advance.
  type :: change_t
    real(real64) :: time = never                  !! [time]
    type(box_t) :: box            !! box after the change, without the obstacles, which stay the same
    type(system_t) :: system      !! system after the change
    logical :: is_empty = .false.                 !! whether no value changes, so that nothing happens
    character(len=:), allocatable :: name
    character(len=:), allocatable :: origin       !! file, line and name of the change, for messages
    type(text_t), allocatable :: lines(:)         !! GROUP.VARIABLE=VALUE for each changed variable
  end type change_t

  !> Values given by the input, identical in all domains of a simulation.
  type, extends(system_t) :: specification_t
    type(species_t), allocatable :: species(:)
    integer(int64) :: seed = 1                    !! seed of the random numbers during the run
  end type specification_t

  !> A simulation: values given by the input, and the state stored in a checkpoint.
  type, extends(specification_t) :: simulation_t
    type(box_state_t) :: box
    type(disk_t), allocatable :: disk(:)         !! disks, sorted by cells
    type(tag_t), allocatable :: tag(:)           !! tags of the disks; `id` is the number in the input
    real(real64), allocatable :: own_mass(:)     !! allocated if masses within a species differ [mass]
    type(extra_t), allocatable :: extra(:)        !! optional data, allocated if `has_extra`
    !> Series of simultaneous collisions, in the order of ids; allocated if a collapse is possible.
    type(series_t), allocatable :: series(:)
    !> Number of actions of the driving on each disk, in the order of ids; allocated if the driving
    !> has a `counter`.
    integer(int64), allocatable :: drive_count(:)
    real(real64) :: now = 0.0_real64      !! present time, relative to the time origin `box%epoch` [time]
    logical :: events_done = .false.      !! whether all events up to and including `now` have been executed
    real(real64) :: epoch_begin = 0.0_real64     !! start of the epoch, relative to `box%epoch` [time]
    real(real64) :: epoch_end = 0.0_real64       !! end of the epoch; 0 if not known yet [time]
    integer(int64) :: epoch_events = 0            !! number of events before the start of the epoch
    ! The next three components are used to detect that time no longer advances.
    !> Duration in which no disk moves noticeably; 0 if not known yet [time].
    real(real64) :: negligible_time = 0.0_real64
    !> Time of the last advance by more than `negligible_time`, relative to `box%epoch` [time].
    real(real64) :: last_advance = 0.0_real64
    integer(int64) :: events_then = 0             !! number of events before the time `last_advance`
    !> Whether each disk waits outside the box, in the order of ids; allocated in open systems.
    !> Waiting disks have no events and zero velocity.
    logical, allocatable :: waits(:)
    !> Time up to which each source has let disks enter, since the start of the run; allocated
    !> together with `waits` [time].
    real(real64), allocatable :: source_time(:)
    integer(int64) :: n_kicks = 0                 !! number of kicks since the start of the run
    integer(int64) :: changes = 0      !! number of changes since the start of the run; see `changes`
    type(change_t), allocatable :: schedule(:)   !! scheduled changes, including those made
    integer(int64) :: changes_made = 0            !! number of scheduled changes made
    type(tally_t) :: tally                        !! counters and sums since the start of the run
    real(real64) :: start_energy = 0.0_real64     !! kinetic energy at the start of the run [energy]
    !> Kinetic energy when the velocities were last set, at the start of the run or by a change
    !> [energy].
    real(real64) :: reference_energy = 0.0_real64
    !> Maximum mean square speed at the start and after changes [(length/time)**2].
    real(real64) :: typical_speed2 = 0.0_real64
  contains
    procedure :: time
    procedure :: has_reached
    procedure :: n_disks
    procedure :: list_disks
    procedure :: has_collapsed
    procedure :: make_room
    procedure :: fit_series
    procedure :: open_up
    procedure :: is_inside
    procedure :: n_inside
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

  abstract interface

    !> Reads the variables of the driving from the group `&drive`.
    subroutine read_drive(self, fields)
      import :: drive_t, fields_t
      class(drive_t), intent(inout) :: self
      class(fields_t), intent(inout) :: fields
    end subroutine read_drive

    !> Applies kick number `sim%n_kicks` at the present time, and lists the affected disks.
    subroutine kick(self, sim, kicked)
      import :: drive_t, int32, simulation_t
      class(drive_t), intent(in) :: self
      type(simulation_t), intent(inout) :: sim
      integer(int32), allocatable, intent(out) :: kicked(:)
    end subroutine kick

    !> Mean square of the velocities set or added by a kick, for driven disks of a given mass.
    pure function mean_square(self, mass) result(speed2)
      import :: drive_t, real64
      class(drive_t), intent(in) :: self
      real(real64), intent(in) :: mass            !! [mass]
      real(real64) :: speed2                      !! [(length/time)**2]
    end function mean_square
  end interface

  interface
    ! The following procedures are in the submodule `typical_speeds`.
    pure module subroutine start_sums(self)
      class(simulation_t), intent(inout) :: self
    end subroutine start_sums

    pure module subroutine choose_units(self)
      class(simulation_t), intent(inout) :: self
    end subroutine choose_units

    pure module function fastest_drive(self) result(speed)
      class(simulation_t), intent(in) :: self
      real(real64) :: speed
    end function fastest_drive

    pure module function mean_square_speed(self) result(speed2)
      class(simulation_t), intent(in) :: self
      real(real64) :: speed2
    end function mean_square_speed
  end interface

contains

  !> True if the driving acts on a species.
  elemental function acts_on(self, species) result(yes)
    class(drive_t), intent(in) :: self
    integer, intent(in) :: species                !! index of the species
    logical :: yes

    yes = self%species == 0 .or. self%species == species
  end function acts_on

  !> True if each kick changes the velocities of all disks and moves no disk.
  pure function acts_on_all(self) result(yes)
    class(drive_t), intent(in) :: self
    logical :: yes

    yes = self%species == 0
  end function acts_on_all

  !> Checks that the driving is compatible with the box and the disks. Problems are reported for
  !> variables of `&drive`.
  subroutine check(self, fields, box, count, radius)
    class(drive_t), intent(in) :: self
    class(fields_t), intent(inout) :: fields
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: count(:)        !! number of disks of each species
    real(real64), intent(in) :: radius(:)         !! largest radius of each species [length]
  end subroutine check

  !> Reason why the driving cannot be combined with another setting; empty if it can.
  pure function conflict(self, setting) result(reason)
    class(drive_t), intent(in) :: self
    character(len=*), intent(in) :: setting       !! name of the other variable
    character(len=:), allocatable :: reason

    reason = ""
  end function conflict

  !> Completes the initial state of the disks.
  subroutine prepare(self, sim)
    class(drive_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
  end subroutine prepare

  !> True if driven disks have an orientation even if they do not rotate.
  pure function orients_disks(self) result(yes)
    class(drive_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function orients_disks

  !> True if kicks also move disks to other positions.
  pure function moves_disks(self) result(yes)
    class(drive_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function moves_disks

  !> True if a kick can change the state even when no further event can occur.
  pure function can_act(self, sim) result(yes)
    class(drive_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes

    yes = .true.
  end function can_act

  !> Name of the number `drive_count` of each disk in frames and observables; empty for driving
  !> without a counter.
  pure function counter(self) result(name)
    class(drive_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = ""
  end function counter

  !> Time of kick k; `never` without driving. The time is calculated as k times the interval,
  !> because repeated addition would accumulate rounding errors.
  pure function kick_time(self, k) result(t)
    class(system_t), intent(in) :: self
    integer(int64), intent(in) :: k
    real(real64) :: t                             !! since the start of the run [time]

    t = never
    if (allocated(self%drive)) t = k*self%drive%interval
  end function kick_time

  !> The `counter` of the driving; empty without driving.
  pure function kick_counter(self) result(name)
    class(system_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = ""
    if (allocated(self%drive)) name = self%drive%counter()
  end function kick_counter

  !> Time since the start of the run.
  pure function time(self) result(t)
    class(simulation_t), intent(in) :: self
    real(real64) :: t

    t = self%box%epoch + self%now
  end function time

  !> True if a time was reached and all events at this time have been executed. A run can stop
  !> between simultaneous events.
  pure function has_reached(self, t) result(yes)
    class(simulation_t), intent(in) :: self
    real(real64), intent(in) :: t                 !! since the start of the run [time]
    logical :: yes

    yes = self%events_done .and. self%time() >= t
  end function has_reached

  !> Number of disks.
  pure function n_disks(self) result(n)
    class(simulation_t), intent(in) :: self
    integer(int32) :: n

    n = size(self%disk, kind=int32)
  end function n_disks

  !> Allocates the disks of all species in the order of the input. The caller sets individual masses
  !> later.
  pure subroutine list_disks(self)
    class(simulation_t), intent(inout) :: self    !! on entry, a simulation with all values given by the input
    integer(int32) :: i

    call self%make_room(sum(self%species%count))
    self%tag%id = [(i, i=1, self%n_disks())]
    self%tag%species = species_by_id(self%species)
    if (.not. allocated(self%own_mass)) return
    do i = 1, self%n_disks()
      self%own_mass(i) = self%species(self%tag(i)%species)%mass
    end do
  end subroutine list_disks

  !> True if the disks have the optional data of `extra_t`.
  pure function has_extra(self, periodic) result(yes)
    class(system_t), intent(in) :: self
    logical, intent(in) :: periodic(2)            !! whether the box is periodic along each axis
    logical :: yes

    yes = any(periodic) .or. self%law%contact_time > 0 .or. self%features%rotation .or. self%features%orientation
  end function has_extra

  !> True if an inelastic collapse has occurred.
  pure function has_collapsed(self) result(yes)
    class(simulation_t), intent(in) :: self
    logical :: yes

    yes = self%tally%collapse < never
    if (yes) yes = self%tally%collapse <= self%time()
  end function has_collapsed

  !> Allocates the series of simultaneous collisions if a collapse is possible, and deallocates them
  !> otherwise.
  pure subroutine fit_series(self)
    class(simulation_t), intent(inout) :: self

    if ((self%law%can_collapse() .or. self%features%collapses) .eqv. allocated(self%series)) return
    if (allocated(self%series)) then
      deallocate (self%series)
    else
      allocate (self%series(self%n_disks()))
    end if
  end subroutine fit_series

  !> Allocates the data of an open system, with all disks in the box, unless the data exist already.
  pure subroutine open_up(self)
    class(simulation_t), intent(inout) :: self
    integer :: n_sources

    if (.not. self%features%open .or. allocated(self%waits)) return
    n_sources = 0
    if (allocated(self%source)) n_sources = size(self%source)
    allocate (self%waits(self%n_disks()), source=.false.)
    allocate (self%source_time(n_sources), source=0.0_real64)
    self%tally%inside = self%species%count
    allocate (self%tally%entered(n_sources), source=0_int64)
  end subroutine open_up

  !> True if disk i is in the box.
  pure function is_inside(self, i) result(yes)
    class(simulation_t), intent(in) :: self
    integer(int32), intent(in) :: i
    logical :: yes

    yes = .true.
    if (allocated(self%waits)) yes = .not. self%waits(self%tag(i)%id)
  end function is_inside

  !> Number of disks in the box.
  pure function n_inside(self) result(n)
    class(simulation_t), intent(in) :: self
    integer(int32) :: n

    n = self%n_disks()
    if (allocated(self%waits)) n = int(sum(self%tally%inside), int32)
  end function n_inside

  !> Allocates the arrays for n disks.
  pure subroutine make_room(self, n, like)
    class(simulation_t), intent(inout) :: self    !! on entry, a simulation with all values given by the input
    integer(int32), intent(in) :: n
    class(simulation_t), intent(in), optional :: like   !! the whole simulation, if `self` is a domain
    logical :: own_masses

    own_masses = self%features%own_sizes
    if (present(like)) own_masses = allocated(like%own_mass)
    allocate (self%disk(n), self%tag(n))
    if (self%has_extra(self%box%periodic)) allocate (self%extra(n))
    if (own_masses) allocate (self%own_mass(n), source=0.0_real64)
    if (self%kick_counter() /= "" .and. .not. present(like)) allocate (self%drive_count(n), source=0_int64)
    if (present(like)) return
    call self%fit_series()
    call self%open_up()
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

  !> Sets all data of disk i, which may come from another domain.
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

  !> Sets the mass of each species to the mass of its heaviest disk, and deallocates the individual
  !> masses if they are equal within each species.
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

  !> Periodic images of the box, for times relative to the time origin `box%epoch`.
  pure function images_now(self) result(images)
    class(simulation_t), intent(in) :: self
    type(images_t) :: images

    images = self%box%images(self%box%epoch)
  end function images_now

  !> Position of disk i at the present time. The stored state does not change.
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

  !> Advances the orientation of disk i to the time t. Must be called before `disks: advance_disk`,
  !> which changes the clock.
  pure subroutine rotate_to(self, i, t)
    class(simulation_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: t

    if (self%features%rotation) self%extra(i)%angle = self%extra(i)%angle + self%extra(i)%spin*(t - self%disk(i)%clock)
  end subroutine rotate_to

  !> Registers a contact of disk i at the time t. `elastic` is set to .true. if the previous contact
  !> has not ended yet (TC model).
  pure subroutine register_contact(self, i, t, elastic)
    class(simulation_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: t
    logical, intent(inout) :: elastic      !! on entry, whether the collision is elastic for another reason

    associate (last => self%extra(i)%last_contact)
      elastic = elastic .or. (self%tag(i)%collisions > 0 .and. t - last < self%law%contact_time)
      last = t
    end associate
  end subroutine register_contact

  !> Updates the sums of flux changes after a change of the velocity of disk i at the time t. The
  !> time integral of a flux is the present flux times the present time, minus the sum over all
  !> changes of the flux, each multiplied by the time of the change. This expression is exact at any
  !> time.
  pure subroutine record_velocity_change(self, i, before, t)
    class(simulation_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: before(2)         !! velocity of disk i before the change [length/time]
    real(real64), intent(in) :: t                 !! relative to the time origin `box%epoch` [time]

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
      if (.not. self%is_inside(i)) cycle
      v = self%velocity(i)
      energy = energy + 0.5_real64*self%mass_of(i)*dot_product(v, v)
    end do
    if (.not. self%features%rotation) return
    do i = 1, self%n_disks()
      energy = energy + 0.5_real64*self%inertia_of(i)*self%spin(i)**2
    end do
  end function kinetic_energy

  !> True if disks can gain unlimited energy, and therefore unlimited speed, from walls or driving.
  pure function is_driven(self) result(yes)
    class(simulation_t), intent(in) :: self
    logical :: yes

    yes = self%box%gives_energy() .or. allocated(self%drive)
  end function is_driven

end module simulation_state
