!> Implementation of `table_file` with HDF5.
submodule(table_file) table_in_hdf5
  use kinds, only: int64
  use errors, only: exit_usage, fail
  use hdf5_objects, only: hdf5_file_t
  use texts, only: written
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
    type(hdf5_file_t) :: file
    real(real64), allocatable :: values(:)                     ! values of a dataset, row by row
    integer(int64) :: length
    integer :: k, n, first

    n = 0
    call file%open(path, .false.)
    do k = 1, size(names)
      length = file%length(trim(names(k)))
      if (allocated(file%failure) .or. allocated(error)) exit
      if (length < 0) then
        call fail(error, exit_usage, path//": has no dataset "//trim(names(k)))
      else if (modulo(length, int(widths(k), int64)) > 0 .or. length/widths(k) > most) then
        call fail(error, exit_usage, path//": "//trim(names(k))//" has "//written(length)//" values; allowed: "// &
          trim(merge("(rows, 2)", "(rows)   ", widths(k) == 2))//", up to "//written(most)//" rows")
      else if (k > 1 .and. length /= int(n, int64)*widths(k)) then
        call fail(error, exit_usage, path//": "//trim(names(1))//" has "//written(n)//" rows, and "//trim(names(k))//" "// &
          written(length/widths(k)))
      end if
      if (allocated(error)) exit
      n = int(length/widths(k))
      if (.not. allocated(table)) allocate (table(sum(widths), n), source=0.0_real64)
      allocate (values(widths(k)*n), source=0.0_real64)
      call file%fetch(trim(names(k)), size(values), values)
      first = sum(widths(:k - 1))
      table(first + 1:first + widths(k), :) = reshape(values, [widths(k), n])
      deallocate (values)
    end do
    call file%close()
    if (.not. allocated(error)) call file%report(error)
    if (.not. allocated(table)) allocate (table(sum(widths), 0))
  end subroutine read_table

end submodule table_in_hdf5
