!> Layout of the output file, which follows H5MD 1.1 (https://www.nongnu.org/h5md/h5md.html): names
!> of groups and fixed paths of datasets. The module `observables` defines the names of observables;
!> the module `samples` defines the names in the event log.
module h5md_layout
  implicit none
  private

  ! Groups
  character(len=*), parameter, public :: &
    disks_group = "particles/disks/", &
    observables_group = "observables/", &
    events_group = "events/", &
    parameters_group = "parameters/", &
    provenance = "provenance", &
    checkpoint_group = "checkpoint/", &           !! group of the checkpoint data
    box_group = disks_group//"box", &
    !> Group of averages over all disks, within `observables_group`.
    all_disks = "all"

  ! Datasets
  character(len=*), parameter, public :: &
    disk_id = disks_group//"id", &
    disk_species = disks_group//"species", &
    disk_mass = disks_group//"mass", &
    disk_radius = disks_group//"radius", &
    !> All changes of the system, including the scheduled ones.
    changes_at_work = parameters_group//"changes", &
    !> Changes that the stored input already includes.
    earlier_changes = checkpoint_group//"changes", &
    species_names = parameters_group//"species/names", &
    species_counts = parameters_group//"species/counts"

  ! Attributes
  character(len=*), parameter, public :: &
    wall_time = provenance//"@wall_time", &
    saved_at = provenance//"/saved_at", &
    !> Identity of the existing file that the finished output may replace.
    replaced_file = provenance//"@replaced"

  ! H5MD elements: groups with the datasets step, time and value
  character(len=*), parameter, public :: &
    position = disks_group//"position", &
    velocity = disks_group//"velocity", &
    angular_velocity = disks_group//"angular_velocity", &
    orientation = disks_group//"orientation", &
    disk_event_count = disks_group//"event_count", &
    image = disks_group//"image", &
    presence = disks_group//"present", &
    step_of = "/step", time_of = "/time", value_of = "/value"

  ! Paths of the counters of complete samples
  character(len=*), parameter, public :: &
    frame_counter = disks_group//"committed", &
    sample_counter = observables_group//"committed", &
    event_counter = events_group//"committed"

  !> Names that are forbidden for species, because the HDF5 groups named after species also contain
  !> objects with these names. Names of observables are forbidden as well.
  character(len=*), parameter, public :: beside_species(3) = [character(len=9) :: "committed", "names", "counts"]

end module h5md_layout
