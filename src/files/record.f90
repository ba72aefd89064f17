!> Checkpoint records. A record is a sequence of numbers in one dataset, together with a checksum.
!> Depending on the mode, the same sequence of calls counts, writes or reads the numbers. The order
!> of reading therefore always equals the order of writing.
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

  !> A sequence of 64-bit numbers.
  type :: record_t
    character(len=:), allocatable :: name         !! path of the dataset
    integer :: mode = counting
    integer(int64) :: words = 0                   !! number of words counted, written or read so far
    integer(int64), private :: crc = 0            !! checksum of the words written or read so far
    type(series_t), private :: series             !! the dataset, open between `begin` and `seal`
  contains
    generic :: exchange => exchange_real, exchange_reals, exchange_long, exchange_longs
    procedure :: make
    procedure :: begin
    procedure :: seal
    procedure :: pass
    procedure, private :: exchange_real, exchange_reals, exchange_long, exchange_longs
  end type record_t

  interface
    !> CRC-32 checksum from the library zlib, on which HDF5 depends.
    pure function crc32(crc, bytes, length) bind(C) result(continued)
      import :: c_int, c_int8_t, c_long
      integer(c_long), value :: crc                   !! checksum of the preceding bytes; 0 at the beginning
      integer(c_int8_t), intent(in) :: bytes(*)
      integer(c_int), value :: length
      integer(c_long) :: continued
    end function crc32
  end interface

contains

  !> Checksum of an array of bytes, in eight hexadecimal digits.
  pure function checksum(bytes) result(text)
    integer(int8), intent(in) :: bytes(:)
    character(len=8) :: text

    write (text, "(z8.8)") crc32(0_c_long, bytes, size(bytes, kind=c_int))
  end function checksum

  !> Creates the dataset of a record once its numbers have been counted.
  subroutine make(self, file)
    class(record_t), intent(in) :: self
    type(hdf5_file_t), intent(inout) :: file
    type(series_t) :: words

    words = series_t(self%name, long_integer)
    call words%make(file, self%words)
    call words%close(file)
  end subroutine make

  !> Returns to the beginning of the record, to count, write or read its numbers.
  subroutine begin(self, mode, file)
    class(record_t), intent(inout) :: self
    integer, intent(in) :: mode
    type(hdf5_file_t), intent(inout) :: file

    self%mode = mode
    self%words = 0
    self%crc = 0
    if (mode == counting) return
    self%series = series_t(self%name, long_integer)
    call self%series%find(file)
  end subroutine begin

  !> Counts, writes or reads one real number.
  subroutine exchange_real(self, file, value)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(inout), target :: value

    call self%pass(file, c_loc(value), 1)
  end subroutine exchange_real

  !> Counts, writes or reads an array of real numbers.
  subroutine exchange_reals(self, file, values)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    real(real64), intent(inout), target, contiguous :: values(:)

    call self%pass(file, c_loc(values), size(values))
  end subroutine exchange_reals

  !> Counts, writes or reads one integer.
  subroutine exchange_long(self, file, value)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(inout), target :: value

    call self%pass(file, c_loc(value), 1)
  end subroutine exchange_long

  !> Counts, writes or reads an array of integers.
  subroutine exchange_longs(self, file, values)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64), intent(inout), target, contiguous :: values(:)

    call self%pass(file, c_loc(values), size(values))
  end subroutine exchange_longs

  !> Writes the checksum at the end of a record, or compares the stored checksum with the checksum
  !> of the numbers that were read. A difference is recorded as a failure of the file.
  subroutine seal(self, file)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    integer(int64) :: crc, there

    crc = self%crc
    there = crc
    call self%exchange(file, there)
    if (there /= crc) call file%check(-1, "be read: the checksum of "//self%name//" is wrong")
    call self%series%close(file)
  end subroutine seal

  !> Counts, writes or reads n words of 64 bits, stored in memory from `address` on. The words are
  !> numbers, or components of derived types without padding.
  subroutine pass(self, file, address, n)
    class(record_t), intent(inout) :: self
    type(hdf5_file_t), intent(inout) :: file
    type(c_ptr), intent(in) :: address
    integer, intent(in) :: n
    integer(int8), pointer :: bytes(:)

    if (n == 0) return
    if (self%mode /= counting) then
      call self%series%pass(file, self%words + 1, int(n, int64), h5kind_to_type(int64, h5_integer_kind), address, &
        self%mode == writing)
      call c_f_pointer(address, bytes, [bytes_of_word*n])
      self%crc = crc32(int(self%crc, c_long), bytes, size(bytes, kind=c_int))
    end if
    self%words = self%words + n
  end subroutine pass

end module record
