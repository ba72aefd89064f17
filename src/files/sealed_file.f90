!> Files that begin with a line that holds a checksum of all that follows. It is CRC-32, by zlib, which HDF5
!> brings along.
module sealed_file
  use, intrinsic :: iso_c_binding, only: c_int, c_int8_t, c_long
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int64
  use system, only: what_is, write_start
  implicit none
  private
  public :: seal, flaw_of, checksum, crc_of

  integer, parameter :: header_length = 64
  integer(int64), parameter :: block_size = 65536     !! bytes read at once

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

  !> Writes the first line of a file, over bytes left free for it, and reads all back: only this reveals a full disk.
  subroutine seal(path, title, done)
    character(len=*), intent(in) :: path, title
    logical, intent(out) :: done
    character(len=header_length) :: header, required
    integer :: status

    call read_file(path, title, header, required, status)
    done = status == 0
    if (done) call write_start(path, required, done)
    if (done) done = flaw_of(path, title) == ""
  end subroutine seal

  !> What is wrong with a file that should have this title; empty if its checksum is right.
  function flaw_of(path, title) result(flaw)
    character(len=*), intent(in) :: path, title
    character(len=:), allocatable :: flaw
    character(len=header_length) :: header, required
    integer :: status

    flaw = what_is(path)
    if (flaw /= "a file" .and. flaw /= "nothing") then
      flaw = "is "//flaw
      return
    end if
    call read_file(path, title, header, required, status)
    flaw = ""
    if (status /= 0) then
      flaw = "cannot be read"
    else if (header == "") then
      flaw = "is empty"
    else if (header(:len(title)) /= title) then
      flaw = "is damaged, of another version, or not a checkpoint: it does not begin with """//title//""""
    else if (header /= required) then
      flaw = "is damaged or cut short: its checksum is wrong"
    end if
  end function flaw_of

  !> Reads a file: its first line, and what that must be.
  subroutine read_file(path, title, header, required, status)
    character(len=*), intent(in) :: path, title
    character(len=header_length), intent(out) :: header, required
    integer, intent(out) :: status                     !! 0: the file has been read
    integer(int8) :: bytes(block_size)
    integer(int64) :: position, length, total
    integer(c_long) :: crc
    integer :: unit

    header = ""
    crc = 0
    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old", iostat=status)
    if (status /= 0) return
    inquire (unit, size=total)
    read (unit, iostat=status) header(:min(total, int(header_length, int64)))
    do position = header_length + 1, total, block_size
      length = min(block_size, total - position + 1)
      if (status == 0) read (unit, pos=position, iostat=status) bytes(:length)
      if (status == 0) crc = crc32(crc, bytes, int(length, c_int))
    end do
    close (unit)
    write (required, "(a,z8.8)") title//", CRC-32 of the rest: ", crc
    required(header_length:) = new_line("a")
  end subroutine read_file

end module sealed_file
