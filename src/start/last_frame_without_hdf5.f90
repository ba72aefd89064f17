!> Reports that output files of runs cannot be read. This submodule is part of libricochet.so, the
!> library without HDF5.
submodule(starting_disks) last_frame_without_hdf5
  implicit none

contains

  !> See `starting_disks`.
  module subroutine read_last_frame(path, name, disks, box)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: name
    type(disks_in_file_t), intent(inout) :: disks
    type(box_t), intent(in), optional :: box

    call fail(disks%error, exit_usage, path//": cannot be read: this library was built without HDF5")
  end subroutine read_last_frame

end submodule last_frame_without_hdf5
