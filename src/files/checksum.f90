!> A checksum that finds whatever damage a disk or a copy does: CRC-64 (ECMA-182, reflected, as in xz).
module checksum
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int64
  implicit none
  private
  public :: crc_of_bytes, crc_of_file, hexadecimal

  integer(int64), parameter :: polynomial = ior(ishft(int(z"C96C5795", int64), 32), int(z"D7870F42", int64))
  integer(int64), parameter :: block_size = 65536     !! bytes read at once

contains

  pure function crc_of_bytes(bytes) result(crc)
    integer(int8), intent(in) :: bytes(:)
    integer(int64) :: crc

    crc = not(continued(not(0_int64), bytes, remainders()))
  end function crc_of_bytes

  !> Checksum of a file from a byte on, counted from 1. 0 if it cannot be read.
  subroutine crc_of_file(path, first, crc)
    character(len=*), intent(in) :: path
    integer(int64), intent(in) :: first
    integer(int64), intent(out) :: crc
    integer(int8), allocatable :: bytes(:)
    integer(int64) :: table(0:255), position, total
    integer :: unit, status

    crc = 0
    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old", iostat=status)
    if (status /= 0) return
    inquire (unit, size=total)
    table = remainders()
    allocate (bytes(block_size))
    crc = not(0_int64)
    do position = first, total, block_size
      associate (block => bytes(:min(block_size, total - position + 1)))
        read (unit, pos=position, iostat=status) block
        if (status /= 0) exit
        crc = continued(crc, block, table)
      end associate
    end do
    close (unit)
    crc = not(crc)
    if (status /= 0) crc = 0
  end subroutine crc_of_file

  !> The remainder of each byte divided by the polynomial.
  pure function remainders() result(table)
    integer(int64) :: table(0:255)
    integer :: k, bit

    do k = 0, 255
      table(k) = k
      do bit = 1, 8
        if (btest(table(k), 0)) then
          table(k) = ieor(shiftr(table(k), 1), polynomial)
        else
          table(k) = shiftr(table(k), 1)
        end if
      end do
    end do
  end function remainders

  !> Takes more bytes into a running remainder.
  pure function continued(start, bytes, table) result(crc)
    integer(int64), intent(in) :: start
    integer(int8), intent(in) :: bytes(:)
    integer(int64), intent(in) :: table(0:)
    integer(int64) :: crc
    integer :: k

    crc = start
    do k = 1, size(bytes)
      crc = ieor(table(iand(ieor(crc, int(bytes(k), int64)), 255_int64)), shiftr(crc, 8))
    end do
  end function continued

  pure function hexadecimal(number) result(text)
    integer(int64), intent(in) :: number
    character(len=16) :: text

    write (text, "(z16.16)") number
  end function hexadecimal

end module checksum
