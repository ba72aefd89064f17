!> Reads tables of numbers from HDF5 files that other programs have written. Each column of a table, or each set of adjacent
!> columns, is stored as a dataset at the top level of the file.
module table_file
  use kinds, only: real64
  use errors, only: error_t
  implicit none
  private
  public :: read_table

  interface
    !> Reads a table. The submodule `table_in_hdf5` reads the table from the file; the submodule `table_without_hdf5` only reports
    !> that HDF5 files cannot be read. The linker selects either `table_in_hdf5` or `table_without_hdf5`.
    module subroutine read_table(path, names, widths, most, table, error)
      character(len=*), intent(in) :: path
      character(len=*), intent(in) :: names(:)                 !! names of the datasets
      !> Number of columns in each dataset; the shape of a dataset is (rows, width), or (rows) for a single column
      integer, intent(in) :: widths(:)
      integer, intent(in) :: most                              !! largest number of rows
      real(real64), allocatable, intent(out) :: table(:, :)    !! (columns,rows)
      type(error_t), allocatable, intent(out) :: error
    end subroutine read_table
  end interface

end module table_file
