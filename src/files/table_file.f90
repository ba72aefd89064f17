!> Reads tables of numbers from HDF5 files of other programs. A table consists of datasets at the
!> top level of the file, each of which contains one column or several adjacent columns.
module table_file
  use kinds, only: real64
  use errors, only: error_t
  implicit none
  private
  public :: read_table

  interface
    !> Reads a table. There are two implementations, and the linker selects one of them. The
    !> submodule `table_in_hdf5` reads the file; the submodule `table_without_hdf5` reports that
    !> HDF5 files cannot be read.
    module subroutine read_table(path, names, widths, most, table, error)
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: names(:)                 !! names of the datasets
      !> Number of columns in each dataset. A dataset has the shape (rows, width), or (rows) if it
      !> is a single column.
      integer, intent(in) :: widths(:)
      integer, intent(in) :: most                              !! maximum number of rows
      real(real64), allocatable, intent(out) :: table(:, :)    !! shape (columns, rows)
      type(error_t), allocatable, intent(out) :: error
    end subroutine read_table
  end interface

end module table_file
