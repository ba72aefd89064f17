!> Whether a run fits into the memory that the machine has free: one that does not is refused before it starts, and one that
!> is short of it goes without domains. On Linux; elsewhere no limit is known.
module memory
  use kinds, only: int64
  use errors, only: error_t, exit_usage, fail
  use settings, only: settings_t
  use texts, only: size_text, written
  implicit none
  private
  public :: check_memory, room_for_domains

  ! Measured with 100 000 to a million disks. [bytes]
  integer(int64), parameter :: per_disk = 410, per_shared_disk = 540, besides = 25000000

contains

  !> Refuses more disks than fit in memory.
  subroutine check_memory(settings, error)
    type(settings_t), intent(in) :: settings
    type(error_t), allocatable, intent(out) :: error
    integer(int64) :: needed

    needed = settings%n_disks()*per_disk + besides
    if (needed > free_memory()) call fail(error, exit_usage, "species.count: "//written(settings%n_disks()) &
      //" disks need about "//size_text(needed)//" of memory, and "//size_text(free_memory())//" are free; use fewer disks")
  end subroutine check_memory

  !> Whether there is memory to cut the box into domains.
  function room_for_domains(settings) result(yes)
    type(settings_t), intent(in) :: settings
    logical :: yes

    yes = settings%n_disks()*per_shared_disk + besides <= free_memory()
  end function room_for_domains

  !> What the machine can give; huge if nobody says. [bytes]
  function free_memory() result(bytes)
    integer(int64) :: bytes
    character(len=80) :: line
    integer :: unit, status

    bytes = huge(bytes)
    open (newunit=unit, file="/proc/meminfo", status="old", action="read", iostat=status)
    do while (status == 0)
      read (unit, "(a)", iostat=status) line
      if (index(line, "MemAvailable:") /= 1) cycle
      read (line(14:), *, iostat=status) bytes
      if (status == 0) bytes = 1024*bytes
      exit
    end do
    close (unit, iostat=status)
  end function free_memory

end module memory
