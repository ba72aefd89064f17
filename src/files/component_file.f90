!> Files whose components are either written or read, each in one line for both. A component that is read must lie in
!> the range that the line gives; the first that does not is remembered.
module component_file
  use, intrinsic :: iso_fortran_env, only: int8
  use bounds, only: first_outside
  use hdf5_objects, only: hdf5_file_t
  use kinds, only: int32, int64, real64
  use sealed_file, only: crc_of
  use texts, only: written
  implicit none
  private
  public :: component_file_t

  type :: component_file_t
    type(hdf5_file_t) :: hdf5
    logical :: writing = .false.
    character(len=:), allocatable :: group        !! before all names
    integer(int64) :: crc = 0                     !! of all values so far
    character(len=:), allocatable :: flaw         !! the first value that cannot be right
  contains
    generic :: exchange => exchange_real, exchange_reals, exchange_long, exchange_longs, exchange_integers
    procedure :: name_of
    procedure, private :: exchange_real, exchange_reals, exchange_long, exchange_longs, exchange_integers, object
  end type component_file_t

contains

  !> The path of a component in the file.
  pure function name_of(self, name) result(path)
    class(component_file_t), intent(in) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: path

    path = name
    if (allocated(self%group)) path = self%group//name
  end function name_of

  !> Writes or reads a real.
  subroutine exchange_real(self, name, value, range)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(inout) :: value
    real(real64), intent(in) :: range(2)          !! lowest and highest value
    real(real64) :: buffer(1)

    buffer = value
    call self%exchange(name, buffer, range)
    value = buffer(1)
  end subroutine exchange_real

  !> Writes or reads an array of reals.
  subroutine exchange_reals(self, name, values, range)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(inout) :: values(:)
    real(real64), intent(in) :: range(2)
    integer :: k

    if (self%writing) call self%hdf5%put(self%name_of(name), shape(values), values)
    if (.not. self%writing) call self%hdf5%fetch(self%name_of(name), size(values), values)
    self%crc = crc_of(transfer(values, [0_int8]), self%crc)
    if (self%writing) return
    k = first_outside(values, range)
    if (k > 0) call self%object(name, k, size(values), written(values(k)), written(range(1))//" to "//written(range(2)))
  end subroutine exchange_reals

  !> Writes or reads an integer of 64 bits.
  subroutine exchange_long(self, name, value, range)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(inout) :: value
    integer(int64), intent(in) :: range(2)
    integer(int64) :: buffer(1)

    buffer = value
    call self%exchange(name, buffer, range)
    value = buffer(1)
  end subroutine exchange_long

  !> Writes or reads an array of integers of 64 bits.
  subroutine exchange_longs(self, name, values, range)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(inout) :: values(:)
    integer(int64), intent(in) :: range(2)
    integer :: k

    if (self%writing) call self%hdf5%put(self%name_of(name), shape(values), values)
    if (.not. self%writing) call self%hdf5%fetch(self%name_of(name), size(values), values)
    self%crc = crc_of(transfer(values, [0_int8]), self%crc)
    if (self%writing) return
    k = first_outside(values, range)
    if (k > 0) call self%object(name, k, size(values), written(values(k)), written(range(1))//" to "//written(range(2)))
  end subroutine exchange_longs

  !> Writes or reads an array of integers of 32 bits.
  subroutine exchange_integers(self, name, values, range)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int32), intent(inout) :: values(:)
    integer(int64), intent(in) :: range(2)
    integer :: k

    if (self%writing) call self%hdf5%put(self%name_of(name), shape(values), values)
    if (.not. self%writing) call self%hdf5%fetch(self%name_of(name), size(values), values)
    self%crc = crc_of(transfer(values, [0_int8]), self%crc)
    if (self%writing) return
    k = first_outside(int(values, int64), range)
    if (k > 0) call self%object(name, k, size(values), written(values(k)), written(range(1))//" to "//written(range(2)))
  end subroutine exchange_integers

  !> Remembers a value that is out of its range if it is the first one.
  subroutine object(self, name, row, n_rows, value, allowed)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name, value, allowed
    integer, intent(in) :: row, n_rows

    if (allocated(self%flaw) .or. allocated(self%hdf5%failure)) return
    self%flaw = name
    if (n_rows > 1) self%flaw = name//", row "//written(row)
    self%flaw = self%flaw//" is "//value//"; possible: "//allowed
  end subroutine object

end module component_file
