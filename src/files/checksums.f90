!> Checksums: CRC-32, by zlib, which HDF5 brings along.
module checksums
  use, intrinsic :: iso_c_binding, only: c_int, c_int8_t, c_long
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int64
  implicit none
  private
  public :: checksum, crc_of

  interface
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

    write (text, "(z8.8)") crc_of(bytes, 0_int64)
  end function checksum

  !> The checksum as a number, of some bytes after others.
  pure function crc_of(bytes, before) result(crc)
    integer(int8), intent(in) :: bytes(:)
    integer(int64), intent(in) :: before               !! of the bytes before; 0 if there are none
    integer(int64) :: crc

    crc = crc32(int(before, c_long), bytes, size(bytes, kind=c_int))
  end function crc_of

end module checksums
