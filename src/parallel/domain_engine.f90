!> The event-driven engine of a domain, which also records the motion of the disks in the domain.
module domain_engine
  use disks, only: disk_t, tag_t
  use event_driven, only: event_driven_t
  use histories, only: histories_t
  use kinds, only: int16, int32
  implicit none
  private
  public :: domain_engine_t

  type, extends(event_driven_t) :: domain_engine_t
    type(histories_t) :: histories
  contains
    procedure :: counts
    procedure :: record_collision
    procedure :: record_cell
    procedure :: read_records_ahead
  end type domain_engine_t

contains

  !> True if this domain counts a collision of disk i.
  pure function counts(self, tag, i, code) result(yes)
    class(domain_engine_t), intent(in) :: self
    type(tag_t), intent(in) :: tag(:)
    integer(int32), intent(in) :: i, code          !! index of the disk, and code of its partner
    logical :: yes

    yes = self%histories%counts(tag, i, code)
  end function counts

  !> Records a collision of disks i and j in their histories.
  subroutine record_collision(self, disk, tag, i, j)
    class(domain_engine_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(:)
    type(tag_t), intent(in) :: tag(:)
    integer(int32), intent(in) :: i, j

    call self%histories%record_collision(disk, tag, i, j)
  end subroutine record_collision

  !> Records the cell of disk i in its history.
  subroutine record_cell(self, cell, i)
    class(domain_engine_t), intent(inout) :: self
    integer(int16), intent(in) :: cell(2)
    integer(int32), intent(in) :: i

    call self%histories%record_cell(cell, i)
  end subroutine record_cell

  !> Prefetches the histories of some disks and of their partners.
  subroutine read_records_ahead(self, disk, disks)
    class(domain_engine_t), intent(in) :: self
    type(disk_t), intent(in) :: disk(:)
    integer(int32), intent(in) :: disks(:)

    call self%histories%read_ahead(disk, disks)
  end subroutine read_records_ahead

end module domain_engine
