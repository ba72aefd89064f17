!> Implementation of `table_file` for libricochet.so, which has no HDF5. The procedure reports that
!> tables in HDF5 files cannot be read.
submodule(table_file) table_without_hdf5
  use errors, only: exit_usage, fail
  implicit none

contains

  !> See `table_file`.
  module subroutine read_table(path, names, widths, most, table, error)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: names(:)
    integer, intent(in) :: widths(:)
    integer, intent(in) :: most
    real(real64), allocatable, intent(out) :: table(:, :)
    type(error_t), allocatable, intent(out) :: error

    allocate (table(sum(widths), 0))
    call fail(error, exit_usage, path//": cannot be read: this library was built without HDF5")
  end subroutine read_table

end submodule table_without_hdf5
