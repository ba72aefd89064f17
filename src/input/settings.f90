!> The settings of a run as typed data, obtained from the input file, the overrides and the
!> defaults. The module `variables` describes the meaning, range and unit of each variable.
module settings
  use kinds, only: int64, never, real64
  use box_geometry, only: box_t
  use disks, only: species_t
  use errors, only: error_t
  use input_groups, only: group_t, text_length
  use placement, only: placement_t
  use simulation_state, only: change_t, system_t
  use stop_rules, only: stop_rule_t
  use texts, only: text_t, written
  implicit none
  private
  public :: run_input_t, settings_t, run_settings_t, sampling_t, species_settings_t, output_settings_t, disks_in_file_t

  !> Minimum number of disks for which domains save time even on one core, because the data of one
  !> domain fit into the cache.
  integer, parameter :: many_disks = 500000

  type :: run_settings_t
    character(len=:), allocatable :: title
    integer(int64) :: seed
    character(len=:), allocatable :: dynamics         !! how time advances: 'events' or 'steps'
    real(real64) :: dt                                !! time step, for `dynamics` = 'steps' [time]
    !> Neighbour search: 'cells', 'pairs' or 'rescan'.
    character(len=:), allocatable :: search
    character(len=:), allocatable :: queue            !! event queue: 'calendar' or 'heap'
    !> Number of threads; 0 to read it from the environment when the threads are started.
    integer :: threads
    integer :: threads_asked = 1                      !! number of threads requested by the user
  end type run_settings_t

  !> Disks read from a file.
  type :: disks_in_file_t
    !> Data of each disk; shape (column_names, n); deallocated once the disks are placed.
    real(real64), allocatable :: table(:, :)
    logical, allocatable :: there(:)                  !! whether the file contains each of the `column_names`
    !> Line number of each disk in a text file, or its row in the last frame of a run.
    integer, allocatable :: rows(:)
    !> Reason why the file cannot be used; otherwise not allocated.
    type(error_t), allocatable :: error
  end type disks_in_file_t

  !> A species and its initial state.
  type, extends(species_t) :: species_settings_t
    !> Radius of each disk; the maximum if radii are drawn or read from a file [length].
    real(real64) :: radius = 0.0_real64
    real(real64) :: mean_radius = 1.0_real64          !! mean of the radius distribution [length]
    !> Standard deviation of the radii divided by their mean; 0 for equal radii.
    real(real64) :: polydispersity = 0.0_real64
    !> Distribution of the radii: 'uniform', 'gaussian' or 'lognormal'.
    character(len=:), allocatable :: distribution
    !> Whether the masses are proportional to the areas of the disks; `mass` is then the mass of a
    !> disk with the mean radius.
    logical :: mass_by_area = .false.
    logical :: mass_in_file = .false.      !! .true. to read masses from the file if it contains them
    logical :: radius_in_file = .false.               !! .true. if radii are read from the file
    logical :: spin_in_file = .false.                 !! .true. if angular velocities are read from the file
    logical :: angle_in_file = .false.                !! .true. if the file contains orientations
    integer :: waiting = 0                            !! number of disks outside the box at the start
    !> .true. if masses and radii of other species are relative to this species.
    logical :: is_base = .false.
    real(real64) :: region(4)                         !! xlo, xhi, ylo, yhi [length]
    class(placement_t), allocatable :: placement      !! method of generating the initial positions
    character(len=:), allocatable :: file      !! text file, or HDF5 file of a run; empty without a file
    !> .true. to scale the positions in another run's output to the box of this run.
    logical :: scale_positions = .false.
    type(disks_in_file_t) :: in_file
    !> How the initial velocities are generated: 'rest', 'equal_speed', 'uniform', 'maxwell',
    !> 'explicit' or 'file'.
    character(len=:), allocatable :: velocities
    !> Speed for 'equal_speed'; maximum of each velocity component for 'uniform' [length/time].
    real(real64) :: speed
    real(real64) :: temperature                       !! kT for 'maxwell' [energy]
    !> kT to which the velocities are scaled; negative if it is not set [energy].
    real(real64) :: exact_temperature = -1.0_real64
    !> Velocities for 'explicit': shape (2,count), or (2,1) if all disks have the same velocity. For
    !> other methods the shape is (2,0).
    real(real64), allocatable :: velocity(:, :)
    real(real64) :: angular_velocity = 0.0_real64     !! common to all disks [1/time]
    !> Rotational kT, the mean of I omega**2; negative if it is not set [energy].
    real(real64) :: rotational_temperature = -1.0_real64
  contains
    procedure :: count_text
  end type species_settings_t

  !> Quantities that define sampling intervals, as in the names of variables such as
  !> output.frames_every_time.
  character(len=19), parameter, public :: sampled_by(4) = [character(len=19) :: "time", "collisions", "events", &
    "collisions_per_disk"]

  !> Kinds of samples, as in the names of variables such as output.frames_every_time.
  character(len=11), parameter, public :: sampled(2) = [character(len=11) :: "frames", "observables"]

  !> A sampling schedule. Intervals not set in the input have the value `never`.
  type :: sampling_t
    real(real64) :: every(4) = never                  !! interval in each quantity of `sampled_by`
    real(real64), allocatable :: at(:)      !! sampling times in the input, in ascending order [time]
    !> Number of logarithmic sampling times per decade; 0 without such times.
    integer :: per_decade = 0
    real(real64) :: from = never                      !! first logarithmic sampling time [time]
  end type sampling_t

  type :: output_settings_t
    type(sampling_t) :: sampling(2)                   !! schedule of each kind of samples in `sampled`
    !> Columns of a frame in addition to the positions; not allocated if frames contain all columns.
    character(len=text_length), allocatable :: frame_columns(:)
    logical :: single_precision                       !! .true. to store frames in single precision
    logical :: event_log
    !> .true. to accumulate the virial tensor even if no other setting requires it.
    logical :: virial_tensor
    logical :: helfand                                !! .true. to accumulate the Helfand moments
    real(real64) :: checkpoint_every                  !! wall time between checkpoints [s]
  end type output_settings_t

  type, extends(system_t) :: settings_t
    type(box_t) :: box
    type(run_settings_t) :: run
    type(species_settings_t), allocatable :: species(:)
    type(stop_rule_t) :: stop
    type(output_settings_t) :: output
    !> Whether the variable `open` of any side is set, so that this side can be opened or closed.
    logical :: has_lids = .false.
    type(change_t), allocatable :: schedule(:)        !! changes during the run, in chronological order
  contains
    procedure :: n_disks
    procedure :: choose_features
    procedure :: is_open
    procedure :: wants_domains
  end type settings_t

  !> The input of a run in several forms: text, groups and settings.
  type :: run_input_t
    character(len=:), allocatable :: path                !! path of the input file, for messages
    character(len=:), allocatable :: text                !! contents of the input file
    type(text_t), allocatable :: overrides(:)            !! GROUP.VARIABLE=VALUE for each --set
    !> Simulation time at which a simulation in memory was saved; negative if it was not saved
    !> [time].
    real(real64) :: saved_at = -1.0_real64
    !> Changes during the run: one line `TIME VARIABLE=VALUE` for each.
    character(len=:), allocatable :: changes
    !> Groups with the values set by the user and the defaults. Changes replace values in a copy.
    type(group_t), allocatable :: given_groups(:)
    type(group_t), allocatable :: groups(:)    !! groups with all values used in the run
    type(settings_t) :: settings                         !! the values in `groups` as typed data
  end type run_input_t

contains

  !> Text for messages: the number of disks of the species, and whether some of them wait outside
  !> the box.
  pure function count_text(self) result(text)
    class(species_settings_t), intent(in) :: self
    character(len=:), allocatable :: text

    text = written(self%count)
    if (self%waiting > 0) text = text//", of which some wait"
  end function count_text

  !> Total number of disks.
  pure function n_disks(self) result(n)
    class(settings_t), intent(in) :: self
    integer(int64) :: n

    n = sum(int(self%species%count, int64))
  end function n_disks

  !> Determines which features the run needs, such as rotation. Initial-configuration files must
  !> have been read before.
  pure subroutine choose_features(self)
    class(settings_t), intent(inout) :: self

    associate (features => self%features, species => self%species)
      features%own_sizes = any(species%mass_in_file .or. species%radius_in_file .or. species%polydispersity > 0)
      features%rotation = self%law%tangential%is_rough() .or. self%box%has_rough_walls() &
        .or. any(abs(species%angular_velocity) > 0 .or. species%rotational_temperature >= 0 .or. species%spin_in_file)
      features%orientation = features%rotation .or. any(species%angle_in_file)
      if (allocated(self%drive)) features%orientation = features%orientation .or. self%drive%orients_disks()
      features%helfand = self%output%helfand
      features%collapses = self%law%can_collapse()
      features%moving = self%box%side%moves()
      features%open = self%is_open()
      features%stress = features%rotation .or. self%box%gives_energy() .or. allocated(self%drive) .or. self%output%virial_tensor &
        .or. features%helfand
    end associate
  end subroutine choose_features

  !> True if disks can leave or enter the box.
  pure function is_open(self) result(yes)
    class(settings_t), intent(in) :: self
    logical :: yes

    yes = self%has_lids .or. allocated(self%source) .or. any(self%species%waiting > 0)
  end function is_open

  !> True if the box should be divided into domains: with several threads, or with many disks on one
  !> core.
  pure function wants_domains(self) result(yes)
    class(settings_t), intent(in) :: self
    logical :: yes
    integer :: k

    yes = self%run%dynamics == "events" .and. self%run%search == "cells" &
      .and. .not. (self%box%is_sheared() .or. self%features%open .or. any(self%box%side%is_piston())) &
      .and. (self%run%threads > 1 .or. self%n_disks() >= many_disks)
    if (.not. (yes .and. allocated(self%schedule))) return
    yes = .not. any([(self%schedule(k)%box%side%is_piston(), k=1, size(self%schedule))])
  end function wants_domains

end module settings
