!> Files whose components are either written or read, each in one line for both; a checksum tells whether they are right.
module component_file
  use, intrinsic :: iso_fortran_env, only: int8
  use hdf5_objects, only: hdf5_file_t
  use kinds, only: int32, int64, real64
  use checksums, only: crc_of
  implicit none
  private
  public :: component_file_t

  type :: component_file_t
    type(hdf5_file_t) :: hdf5
    logical :: writing = .false.
    character(len=:), allocatable :: group        !! before all names
    integer(int64) :: crc = 0                     !! of all values so far
  contains
    generic :: exchange => exchange_real, exchange_reals, exchange_long, exchange_longs, exchange_integers
    procedure :: name_of
    procedure, private :: exchange_real, exchange_reals, exchange_long, exchange_longs, exchange_integers
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
  subroutine exchange_real(self, name, value)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(inout) :: value
    real(real64) :: buffer(1)

    buffer = value
    call self%exchange(name, buffer)
    value = buffer(1)
  end subroutine exchange_real

  !> Writes or reads an array of reals.
  subroutine exchange_reals(self, name, values)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(inout) :: values(:)

    if (self%writing) call self%hdf5%put(self%name_of(name), shape(values), values)
    if (.not. self%writing) call self%hdf5%fetch(self%name_of(name), size(values), values)
    self%crc = crc_of(transfer(values, [0_int8]), self%crc)
  end subroutine exchange_reals

  !> Writes or reads an integer of 64 bits.
  subroutine exchange_long(self, name, value)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(inout) :: value
    integer(int64) :: buffer(1)

    buffer = value
    call self%exchange(name, buffer)
    value = buffer(1)
  end subroutine exchange_long

  !> Writes or reads an array of integers of 64 bits.
  subroutine exchange_longs(self, name, values)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(inout) :: values(:)

    if (self%writing) call self%hdf5%put(self%name_of(name), shape(values), values)
    if (.not. self%writing) call self%hdf5%fetch(self%name_of(name), size(values), values)
    self%crc = crc_of(transfer(values, [0_int8]), self%crc)
  end subroutine exchange_longs

  !> Writes or reads an array of integers of 32 bits.
  subroutine exchange_integers(self, name, values)
    class(component_file_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int32), intent(inout) :: values(:)

    if (self%writing) call self%hdf5%put(self%name_of(name), shape(values), values)
    if (.not. self%writing) call self%hdf5%fetch(self%name_of(name), size(values), values)
    self%crc = crc_of(transfer(values, [0_int8]), self%crc)
  end subroutine exchange_integers

end module component_file
