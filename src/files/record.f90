!> A record: numbers one after the other in one dataset of an open file. They are counted, written or read, each by one line
!> for all three; a checksum behind the last one tells whether they are right.
module record
  use, intrinsic :: iso_c_binding, only: c_f_pointer, c_int, c_int8_t, c_loc, c_long, c_ptr
  use, intrinsic :: iso_fortran_env, only: int8
  use hdf5, only: h5_integer_kind, h5kind_to_type
  use hdf5_objects, only: hdf5_file_t
  use hdf5_series, only: long_integer, series_t
  use kinds, only: int64, real64
  implicit none
  private
  public :: checksum, record_t, counting, reading, writing

  integer, parameter :: counting = 0, writing = 1, reading = 2
  integer(int64), parameter :: bytes_of_word = 8

  !> All numbers are words of 64 bits.
  type :: record_t
    character(len=:), allocatable :: name         !! path of the dataset
    integer :: way = counting
    integer(int64) :: words = 0                   !! so far
    integer(int64), private :: crc = 0            !! of these
  contains
    generic :: exchange => exchange_real, exchange_reals, exchange_long, exchange_longs
    procedure :: make
    procedure :: begin
    procedure :: seal
    procedure :: pass
    procedure, private :: exchange_real, exchange_reals, exchange_long, exchange_longs
  end type record_t

  interface
    !> CRC-32, by zlib, which HDF5 brings along.
    pure function crc32(crc, bytes, length) bind(C) result(continued)
      import :: c_int, c_int8_t, c_long
      integer(c_long), value :: crc                   !! of the bytes before; 0 if there are none
      integer(c_int8_t), intent(in) :: bytes(*)
      integer(c_int), value :: length
      integer(c_long) :: continued
    end function crc32
  end interface

contains

  !> Checksum of some bytes, in eight hexadecimal digits.
  pure function checksum(bytes) result(text)
    integer(int8), intent(in) :: bytes(:)
    character(len=8) :: text

    write (text, "(z8.8)") crc32(0_c_long, bytes, size(bytes, kind=c_int))
  end function checksum

  !> Makes the dataset of a record that has been counted.
  subroutine make(self, file)
    class(record_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    type(series_t) :: words

    words = series_t(self%name, long_integer)
    call words%make(file, self%words)
  end subroutine make

  !> Begins anew, to count, write or read.
  subroutine begin(self, way)
    class(record_t), intent(inout) :: self
    integer, intent(in) :: way

    self%way = way
    self%words = 0
    self%crc = 0
  end subroutine begin

  !> The next number is a real.
  subroutine exchange_real(self, file, value)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(inout), target :: value

    call self%pass(file, c_loc(value), 1)
  end subroutine exchange_real

  !> The next numbers are reals.
  subroutine exchange_reals(self, file, values)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(inout), target, contiguous :: values(:)

    call self%pass(file, c_loc(values), size(values))
  end subroutine exchange_reals

  !> The next number is an integer.
  subroutine exchange_long(self, file, value)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(inout), target :: value

    call self%pass(file, c_loc(value), 1)
  end subroutine exchange_long

  !> The next numbers are integers.
  subroutine exchange_longs(self, file, values)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(inout), target, contiguous :: values(:)

    call self%pass(file, c_loc(values), size(values))
  end subroutine exchange_longs

  !> Ends a record with its checksum, or fails if that which is there is another.
  subroutine seal(self, file)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64) :: crc, there

    crc = self%crc
    there = crc
    call self%exchange(file, there)
    if (there /= crc) call file%check(-1, "be read: the checksum of "//self%name//" is wrong")
  end subroutine seal

  !> Writes or reads the next n words from or to the memory at an address: numbers, or records of them.
  subroutine pass(self, file, address, n)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    type(c_ptr), intent(in) :: address
    integer, intent(in) :: n
    integer(int8), pointer :: bytes(:)

    if (n == 0) return
    if (self%way /= counting) then
      call file%transfer(self%name, self%words + 1, [int(n, int64)], h5kind_to_type(int64, h5_integer_kind), &
        address, self%way == writing)
      call c_f_pointer(address, bytes, [bytes_of_word*n])
      self%crc = crc32(int(self%crc, c_long), bytes, size(bytes, kind=c_int))
    end if
    self%words = self%words + n
  end subroutine pass

end module record
