!> Layout of an output file, which follows H5MD 1.1 (https://www.nongnu.org/h5md/h5md.html): the
!> names of groups and the fixed paths of datasets. The names of observables are defined in
!> `observables`, those in the event log in `samples`.
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
    checkpoint_group = "checkpoint/", &           !! group of the data from which a run can be resumed
    box_group = disks_group//"box", &
    all_disks = "all"                             !! group for averages over all disks, in `observables_group`

  ! Datasets
  character(len=*), parameter, public :: &
    disk_id = disks_group//"id", &
    disk_species = disks_group//"species", &
    disk_mass = disks_group//"mass", &
    disk_radius = disks_group//"radius", &
    changes_at_work = parameters_group//"changes", &     !! all changes, including those of the schedule
    earlier_changes = checkpoint_group//"changes", &      !! changes that the input in the file already contains
    species_names = parameters_group//"species/names", &
    species_counts = parameters_group//"species/counts"

  ! Attributes
  character(len=*), parameter, public :: &
    wall_time = provenance//"@wall_time", &
    saved_at = provenance//"/saved_at", &
    replaced_file = provenance//"@replaced"       !! identity of the existing file that the finished output may replace

  ! H5MD elements; each element is a group with the datasets step, time and value
  character(len=*), parameter, public :: &
    position = disks_group//"position", &
    velocity = disks_group//"velocity", &
    angular_velocity = disks_group//"angular_velocity", &
    orientation = disks_group//"orientation", &
    disk_event_count = disks_group//"event_count", &
    image = disks_group//"image", &
    presence = disks_group//"present", &
    step_of = "/step", time_of = "/time", value_of = "/value"

  ! Paths of the datasets that contain the numbers of complete samples
  character(len=*), parameter, public :: &
    frame_counter = disks_group//"committed", &
    sample_counter = observables_group//"committed", &
    event_counter = events_group//"committed"

  !> Names that a species must not have, because the HDF5 groups named after species also contain
  !> objects with these names. The names of observables are forbidden, too.
  character(len=*), parameter, public :: beside_species(3) = [character(len=9) :: "committed", "names", "counts"]

end module h5md_layout
