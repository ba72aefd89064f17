!> Tables of numbers in HDF5 files that others have written: each column, or some columns side by side, is a dataset at the top.
module table_file
  use kinds, only: real64
  use errors, only: error_t
  implicit none
  private
  public :: read_table

  interface
    !> Reads a table. The submodule `table_in_hdf5` does that, `table_without_hdf5` refuses: the linker gets one of them.
    module subroutine read_table(path, names, widths, most, table, error)
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: names(:)                 !! of the datasets
      integer, intent(in) :: widths(:)                         !! columns in each of them: their shape is (rows, width), or (rows)
      integer, intent(in) :: most                              !! rows
      real(real64), allocatable, intent(out) :: table(:, :)    !! (columns,rows)
      type(error_t), allocatable, intent(out) :: error
    end subroutine read_table
  end interface

end module table_file
