!> Reading parts of an HDF5 file that others wrote: one item of a series, lists of texts.
module hdf5_items
  use, intrinsic :: iso_c_binding, only: c_loc, c_ptr
  use hdf5, only: hid_t, hsize_t, size_t, h5dopen_f, h5dread_f, h5dclose_f, h5dget_space_f, &
    h5dget_type_f, h5screate_simple_f, h5sclose_f, h5sget_simple_extent_ndims_f, &
    h5sget_simple_extent_dims_f, h5sselect_hyperslab_f, h5tcopy_f, h5tset_size_f, h5tclose_f, &
    h5tget_class_f, h5tis_variable_str_f, h5s_select_set_f, h5t_fortran_s1, h5t_native_double, h5t_string_f
  use hdf5_objects, only: hdf5_file_t
  use kinds, only: int64, real64
  implicit none
  private
  public :: fetch_item, fetch_texts

contains

  !> Reads item k of a series: all values at one index of the last dimension.
  subroutine fetch_item(file, name, k, n, values)
    type(hdf5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    integer(int64), intent(in) :: k                   !! from 1
    integer, intent(in) :: n                          !! how many values the item must have
    real(real64), intent(inout), target :: values(n)
    integer(hsize_t), allocatable :: extent(:), most(:), first(:)
    integer(hid_t) :: dataset, space, memory
    type(c_ptr) :: place
    integer :: status, closed, rank

    if (allocated(file%trouble)) return
    place = c_loc(values)
    rank = 0
    space = -1
    memory = -1
    call h5dopen_f(file%id, name, dataset, status)
    if (status >= 0) call h5dget_space_f(dataset, space, status)
    if (status >= 0) call h5sget_simple_extent_ndims_f(space, rank, status)
    allocate (extent(rank), most(rank), first(rank), source=0_hsize_t)
    if (status >= 0) call h5sget_simple_extent_dims_f(space, extent, most, status)
    if (status >= 0) then
      status = -1
      if (rank > 0) then
        first(rank) = k - 1
        if (product(extent(:rank - 1)) == n .and. k >= 1 .and. k <= extent(rank)) status = 0
        extent(rank) = 1
      end if
    end if
    if (status >= 0) call h5sselect_hyperslab_f(space, h5s_select_set_f, first, extent, status)
    if (status >= 0) call h5screate_simple_f(rank, extent, memory, status)
    if (status >= 0) call h5dread_f(dataset, h5t_native_double, place, status, memory, space)
    call file%check(status, "be read: "//name)
    call h5sclose_f(memory, closed)
    call h5sclose_f(space, closed)
    call h5dclose_f(dataset, closed)
  end subroutine fetch_item

  !> Reads a list of texts, each cut at the length of the elements.
  subroutine fetch_texts(file, name, length, texts)
    type(hdf5_file_t), intent(inout) :: file
    character(len=*), intent(in) :: name
    integer, intent(in) :: length
    character(len=length), allocatable, target, intent(out) :: texts(:)
    integer(hid_t) :: dataset, stored, string
    type(c_ptr) :: place
    logical :: variable
    integer :: status, closed, class

    allocate (texts(max(0, int(file%length(name)))))
    if (allocated(file%trouble)) return
    texts = ""
    stored = -1
    string = -1
    call h5dopen_f(file%id, name, dataset, status)
    if (status >= 0) call h5dget_type_f(dataset, stored, status)
    if (status >= 0) call h5tget_class_f(stored, class, status)
    if (status >= 0) call h5tis_variable_str_f(stored, variable, status)
    if (status >= 0) status = merge(0, -1, class == h5t_string_f .and. .not. variable)
    if (status >= 0) call h5tcopy_f(h5t_fortran_s1, string, status)
    if (status >= 0) call h5tset_size_f(string, int(length, size_t), status)
    if (status >= 0 .and. size(texts) > 0) then
      place = c_loc(texts)
      call h5dread_f(dataset, string, place, status)
    end if
    call file%check(status, "be read: "//name)
    call h5tclose_f(string, closed)
    call h5tclose_f(stored, closed)
    call h5dclose_f(dataset, closed)
  end subroutine fetch_texts

end module hdf5_items
