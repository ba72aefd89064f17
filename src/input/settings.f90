!> What the user asked for: the input file, its defaults and the overrides, as plain typed data.
!> One type per namelist group; the meaning, range and unit of every variable stand in `parameters`.
module settings
  use kinds, only: int64, real64
  use stop_rules, only: stop_settings_t
  implicit none
  private
  public :: settings_t, run_settings_t, box_settings_t, obstacle_settings_t, species_settings_t
  public :: contact_settings_t, output_settings_t

  type :: run_settings_t
    character(len=:), allocatable :: title
    integer(int64) :: seed
    character(len=:), allocatable :: dynamics         !! 'events' or 'steps'
    real(real64) :: dt                                !! [time], of 'steps'
    character(len=:), allocatable :: search           !! 'cells', 'pairs' or 'rescan'
    character(len=:), allocatable :: queue            !! 'calendar' or 'heap'
  end type run_settings_t

  type :: box_settings_t
    real(real64) :: lower(2)                          !! [length]
    real(real64) :: upper(2)                          !! [length]
    logical :: periodic(2)                            !! boundary(k) == 'periodic'
    real(real64) :: gravity(2)                        !! [length/time**2]
  end type box_settings_t

  type :: obstacle_settings_t
    character(len=:), allocatable :: name
    real(real64) :: centre(2)                         !! [length]
    real(real64) :: radius                            !! [length]
    logical :: inside                                 !! side == 'inside': disks are kept in
  end type obstacle_settings_t

  type :: species_settings_t
    character(len=:), allocatable :: name
    integer :: count
    real(real64) :: mass                              !! [mass], resolved: `relative_to` and defaults applied
    real(real64) :: radius                            !! [length], resolved from `packing_fraction` and `relative_to`
    real(real64) :: region(4)                         !! xlo, xhi, ylo, yhi [length], resolved: default the box
    character(len=:), allocatable :: placement        !! 'random', 'grid', 'lattice', 'dense', 'explicit' or 'file'
    integer :: grid(2)                                !! nx, ny; 0,0 when not given
    character(len=:), allocatable :: file             !! of placement 'file': text columns, or a run's HDF5 file
    real(real64), allocatable :: position(:, :)       !! (2,count) of 'explicit' [length]; else (2,0)
    character(len=:), allocatable :: velocities       !! 'rest', 'equal_speed', 'uniform', 'maxwell', 'explicit'
    real(real64) :: speed                             !! of 'equal_speed' and 'uniform' (half width) [length/time]
    real(real64) :: temperature                       !! kT of 'maxwell' [energy]
    real(real64), allocatable :: velocity(:, :)       !! (2,count) of 'explicit' (one pair is spread); else (2,0)
  end type species_settings_t

  type :: contact_settings_t
    real(real64), allocatable :: restitution(:, :)    !! (s,s) per pair of species, resolved
    real(real64) :: wall_restitution                  !! resolved: default as `restitution`
    logical :: smooth_walls                           !! wall_rule == 'normal'
    real(real64) :: contact_time                      !! of the TC model [time]; 0: off
  end type contact_settings_t

  !> A cadence that is not asked for is `never` (time, wall clock) or `huge` (counts).
  type :: output_settings_t
    real(real64) :: frames_every_time
    integer(int64) :: frames_every_collisions
    integer(int64) :: frames_every_events
    real(real64) :: observables_every_time
    integer(int64) :: observables_every_collisions
    integer(int64) :: observables_every_events
    logical :: single_precision                       !! precision == 'single'
    logical :: event_log
    real(real64) :: checkpoint_every                  !! [s] of wall clock
  end type output_settings_t

  type :: settings_t
    type(run_settings_t) :: run
    type(box_settings_t) :: box
    type(obstacle_settings_t), allocatable :: obstacles(:)
    type(species_settings_t), allocatable :: species(:)
    type(contact_settings_t) :: contact
    type(stop_settings_t) :: stop
    type(output_settings_t) :: output
  end type settings_t

end module settings
