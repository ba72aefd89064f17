!> The input as typed data: the file, its defaults and the overrides, with every value resolved.
!> Meaning, range and unit of each variable are in `variables`.
module settings
  use kinds, only: int64, never, real64
  use disks, only: species_t
  use drive, only: active
  use errors, only: error_t
  use input_groups, only: group_t, text_length
  use side_motion, only: piston
  use simulation_state, only: system_t
  use stop_rules, only: stop_settings_t
  use texts, only: text_t
  implicit none
  private
  public :: run_input_t, settings_t, run_settings_t, sampling_t, species_settings_t, output_settings_t, disks_in_file_t

  integer, parameter :: many_disks = 500000           !! from here on parts of the box that fit into caches pay

  type :: run_settings_t
    character(len=:), allocatable :: title
    integer(int64) :: seed
    character(len=:), allocatable :: dynamics         !! 'events' or 'steps'
    real(real64) :: dt                                !! [time], of 'steps'
    character(len=:), allocatable :: search           !! 'cells', 'pairs' or 'rescan'
    character(len=:), allocatable :: queue            !! 'calendar' or 'heap'
    integer :: threads                                !! 0: as the environment says; then those of the run
    integer :: threads_asked = 1                      !! for
  end type run_settings_t

  !> Disks as a file has them.
  type :: disks_in_file_t
    real(real64), allocatable :: table(:, :)          !! (`position_file: column_names`,n), until they are placed
    logical, allocatable :: there(:)                  !! (column_names) whether the file has these columns
    integer, allocatable :: rows(:)                   !! (n) lines of a text, or rows in the last frame of a run
    type(error_t), allocatable :: error               !! why they cannot be had
  end type disks_in_file_t

  !> A species, and how its disks start.
  type, extends(species_t) :: species_settings_t
    real(real64) :: radius = 0.0_real64               !! of each disk, or the largest in the file, or of those drawn [length]
    real(real64) :: mean_radius = 1.0_real64          !! of all that may be drawn [length]
    real(real64) :: polydispersity = 0.0_real64        !! its standard deviation over the mean; 0: all are equal
    character(len=:), allocatable :: distribution     !! 'uniform', 'gaussian', 'lognormal'
    logical :: mass_by_area = .false.                 !! of the disks of a spread; the mass is that of the mean radius
    logical :: mass_in_file = .false.                 !! the input leaves the masses to the file, which may have none
    logical :: radius_in_file = .false.               !! the input leaves the radii to the file
    logical :: spin_in_file = .false.                 !! angular velocities come with the velocities of the file
    logical :: angle_in_file = .false.                !! the file has orientations
    logical :: is_base = .false.                      !! sizes of other species are multiples of its own
    real(real64) :: region(4)                         !! xlo, xhi, ylo, yhi [length]
    character(len=:), allocatable :: placement        !! 'random', 'grid', 'lattice', 'dense', 'explicit', 'file', 'grown'
    integer :: grid(2)                                !! nx, ny; 0, 0 when not given
    character(len=:), allocatable :: file             !! of placement 'file', 'grown': text columns, or a run's HDF5 file
    logical :: scale_positions = .false.              !! from the box of that run to this one
    type(disks_in_file_t) :: in_file
    real(real64), allocatable :: position(:, :)       !! (2,count) of 'explicit' [length]; else (2,0)
    character(len=:), allocatable :: velocities       !! 'rest', 'equal_speed', 'uniform', 'maxwell', 'explicit', 'file'
    real(real64) :: speed                             !! of 'equal_speed' and 'uniform' (half width) [length/time]
    real(real64) :: temperature                       !! kT of 'maxwell' [energy]
    real(real64) :: exact_temperature = -1.0_real64   !! kT to scale velocities to; negative: none [energy]
    real(real64), allocatable :: velocity(:, :)       !! (2,count) or one pair for all, of 'explicit'; else (2,0)
    real(real64) :: angular_velocity = 0.0_real64     !! of all disks [1/time]
    real(real64) :: rotational_temperature = -1.0_real64  !! mean of I omega**2, instead; negative: not given [energy]
  end type species_settings_t

  !> Quantities by which samples are scheduled, as in the names of variables.
  character(len=19), parameter, public :: sampled_by(4) = [character(len=19) :: "time", "collisions", "events", &
    "collisions_per_disk"]

  !> Kinds of samples, as in the names of variables.
  character(len=11), parameter, public :: sampled(2) = [character(len=11) :: "frames", "observables"]

  !> When it is; an interval that is not set is `never`.
  type :: sampling_t
    real(real64) :: every(4) = never                  !! of `sampled_by`
    real(real64), allocatable :: at(:)                !! chosen times, in their order [time]
    integer :: per_decade = 0                         !! times in each power of ten; 0: none
    real(real64) :: from = never                      !! the first of them [time]
  end type sampling_t

  type :: output_settings_t
    type(sampling_t) :: sampling(2)                   !! of `sampled`
    character(len=text_length), allocatable :: frame_columns(:)  !! wanted beside the positions; not allocated: all
    logical :: single_precision                       !! precision == 'single'
    logical :: event_log
    logical :: virial_tensor                          !! of smooth disks, too
    logical :: helfand                                !! moments of momentum and heat
    real(real64) :: checkpoint_every                  !! [s] of wall clock
  end type output_settings_t

  type, extends(system_t) :: settings_t
    type(run_settings_t) :: run
    type(species_settings_t), allocatable :: species(:)
    type(stop_settings_t) :: stop
    type(output_settings_t) :: output
  contains
    procedure :: n_disks
    procedure :: n_driven
    procedure :: choose_features
    procedure :: wants_domains
  end type settings_t

  !> Input of a run in all its forms.
  type :: run_input_t
    character(len=:), allocatable :: path                !! of the input file, for messages
    character(len=:), allocatable :: text                !! the input file as it is
    type(text_t), allocatable :: overrides(:)            !! GROUP.VARIABLE=VALUE of each --set
    real(real64) :: saved_at = -1.0_real64               !! up to when a simulation in memory went; negative: none did [time]
    character(len=:), allocatable :: changes             !! made while the run was at work, a line `TIME VARIABLE=VALUE` for each
    type(group_t), allocatable :: groups(:)    !! every value as used
    type(settings_t) :: settings                         !! the same as typed data
  end type run_input_t

contains

  !> The number of all disks.
  pure function n_disks(self) result(n)
    class(settings_t), intent(in) :: self
    integer(int64) :: n

    n = sum(int(self%species%count, int64))
  end function n_disks

  !> The number of disks that are driven.
  pure function n_driven(self) result(n)
    class(settings_t), intent(in) :: self
    integer(int64) :: n
    integer :: k

    n = sum(int(self%species%count, int64), mask=self%drive%acts_on([(k, k=1, size(self%species))]))
  end function n_driven

  !> Decides what the disks have and what is summed, when starting files have been looked at.
  pure subroutine choose_features(self)
    class(settings_t), intent(inout) :: self

    associate (with => self%with, species => self%species)
      with%own_sizes = any(species%mass_in_file .or. species%radius_in_file .or. species%polydispersity > 0)
      with%rotation = self%law%tangential%is_rough() .or. self%box%has_rough_walls() .or. any(abs(species%angular_velocity) > 0 &
        .or. species%rotational_temperature >= 0 .or. species%spin_in_file)
      with%orientation = with%rotation .or. self%drive%kind == active .or. any(species%angle_in_file)
      with%helfand = self%output%helfand
      with%stress = with%rotation .or. self%box%gives_energy() .or. self%drive%is_on() .or. self%output%virial_tensor &
        .or. with%helfand
    end associate
  end subroutine choose_features

  !> Whether the box is to be cut into domains: for several threads, or one after the other.
  pure function wants_domains(self) result(yes)
    class(settings_t), intent(in) :: self
    logical :: yes

    yes = self%run%dynamics == "events" .and. self%run%search == "cells" &
      .and. .not. (self%box%is_sheared() .or. any(self%box%surface%motion%kind == piston)) &
      .and. (self%run%threads > 1 .or. self%n_disks() >= many_disks)
  end function wants_domains

end module settings
