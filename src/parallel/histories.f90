!> Records the motion of the disks in one domain during the present time window of a parallel run.
!> The history of a disk consists of the range of cells that it visited and a digest (hash) of its
!> collisions. After the window, histories show whether each ghost moved in the same way as its
!> original in the domain that owns it. The module also determines in which domain a collision is
!> counted.
module histories
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int16, int32, int64, real64
  use cell_layout, only: cell_layout_t
  use memory_hints, only: prefetch
  use disks, only: disk_t, tag_t
  implicit none
  private
  public :: history_t, histories_t

  !> History of a disk in the present window. A disk owned by the domain needs no history if it
  !> cannot be a ghost in another domain.
  type :: history_t
    integer(int64) :: digest = 0      !! digest of the times of the disk-disk collisions of this disk
    integer(int32) :: slot = 0
    logical :: own = .false.                       !! .true. if this domain owns the disk, .false. for a ghost
    integer(int16) :: low(2) = 0_int16             !! first column and row visited by the disk
    integer(int16) :: high(2) = 0_int16            !! last column and row visited by the disk
  end type history_t

  type :: histories_t
    type(cell_layout_t) :: layout                  !! cells of the domain and its halo
    integer(int32) :: n_histories = 0
    type(history_t), allocatable :: history(:)     !! histories of disks; size at least n_histories
    !> Index of the history of the disk in each slot; 0 without a history.
    integer(int32), allocatable :: history_of(:)
    integer(int32) :: own_low(2) = 0, own_high(2) = 0      !! first and last column and row of the domain
    !> Columns and rows that belong to no other extended domain.
    integer(int32) :: deep_low(2) = 0, deep_high(2) = 0
    !> Range of columns and rows of the cells whose eight neighbours are all in the extended domain.
    integer(int32) :: safe_low(2) = 0, safe_high(2) = 0
    !> Flags of the cells, with indices from 0. The flag is 1 for each cell outside the domain that
    !> an owned disk has reached, and for the eight neighbours of such a cell; otherwise it is 0.
    integer(int8), allocatable :: reached(:, :)
    !> Whether an owned disk has reached the edge of the extended domain.
    logical :: left_domain = .false.
  contains
    procedure :: record_collision
    procedure :: record_cell
    procedure :: read_ahead
    procedure :: begin_window
    procedure :: begin_history
    procedure :: drop_history
    procedure :: counts
    procedure :: could_have_met
    procedure :: owns
    procedure :: is_own
    procedure :: n_ghosts
    procedure, private :: add_history
  end type histories_t

contains

  !> Starts a new window. At its start, no owned disk has left the domain.
  subroutine begin_window(self)
    class(histories_t), intent(inout) :: self

    self%reached = 0_int8
    self%left_domain = .false.
  end subroutine begin_window

  !> Starts a new history of disk i if the disk, in its present cell, can be a ghost in another
  !> domain. The domain owns the disk if this cell is in the domain.
  subroutine begin_history(self, cell, i)
    class(histories_t), intent(inout) :: self
    integer(int16), intent(in) :: cell(2)
    integer(int32), intent(in) :: i

    if (within(cell, self%deep_low, self%deep_high)) then
      call self%drop_history(i)
    else
      if (self%history_of(i) == 0) call self%add_history(i)
      self%history(self%history_of(i)) = history_t(0_int64, i, self%owns(cell), cell, cell)
    end if
  end subroutine begin_history

  !> Assigns an empty history to disk i; the caller sets its contents.
  subroutine add_history(self, i)
    class(histories_t), intent(inout) :: self
    integer(int32), intent(in) :: i

    if (self%n_histories == size(self%history)) self%history = [self%history, self%history]
    self%n_histories = self%n_histories + 1
    self%history_of(i) = self%n_histories
  end subroutine add_history

  !> Deletes the history of disk i, if there is one, by moving the last history in the array to its
  !> place.
  subroutine drop_history(self, i)
    class(histories_t), intent(inout) :: self
    integer(int32), intent(in) :: i
    integer(int32) :: k

    k = self%history_of(i)
    if (k == 0) return
    self%history_of(i) = 0
    if (k < self%n_histories) then
      self%history(k) = self%history(self%n_histories)
      self%history_of(self%history(k)%slot) = k
    end if
    self%n_histories = self%n_histories - 1
  end subroutine drop_history

  !> True if this domain counts a collision of disk i. A disk-disk collision is counted by the owner
  !> of the disk with the lower id. Any other collision is counted by the owner of disk i.
  pure function counts(self, tag, i, code) result(yes)
    class(histories_t), intent(in) :: self
    type(tag_t), intent(in) :: tag(:)
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code             !! code of the partner
    logical :: yes

    if (code <= 0) then
      yes = self%is_own(i)
    else
      yes = self%is_own(merge(i, code, tag(i)%id < tag(code)%id))
    end if
  end function counts

  !> Records a collision of disks i and j, and the cells of both disks.
  subroutine record_collision(self, disk, tag, i, j)
    class(histories_t), intent(inout) :: self
    type(disk_t), intent(in) :: disk(:)
    type(tag_t), intent(in) :: tag(:)
    integer(int32), intent(in) :: i, j

    if (self%history_of(i) > 0) call add_moment(self%history(self%history_of(i))%digest, disk(i)%clock)
    if (self%history_of(j) > 0) call add_moment(self%history(self%history_of(j))%digest, disk(j)%clock)
    call self%record_cell(tag(i)%cell, i)          ! the collision may have changed the cells of i and j
    call self%record_cell(tag(j)%cell, j)
  end subroutine record_collision

  !> Adds the time of a collision to a digest.
  elemental subroutine add_moment(digest, time)
    integer(int64), intent(inout) :: digest
    real(real64), intent(in) :: time

    digest = ieor(ishftc(digest, 11), transfer(time, digest))
  end subroutine add_moment

  !> Prefetches the history indices of several disks and of their partners.
  subroutine read_ahead(self, disk, disks)
    class(histories_t), intent(in) :: self
    type(disk_t), intent(in) :: disk(:)
    integer(int32), intent(in) :: disks(:)
    integer(int32) :: k

    do k = 1, size(disks)
      call prefetch(self%history_of(disks(k)))
      call prefetch(self%history_of(max(disk(disks(k))%partner, 1)))
    end do
  end subroutine read_ahead

  !> Records the cell of disk i.
  subroutine record_cell(self, cell, i)
    class(histories_t), intent(inout) :: self
    integer(int16), intent(in) :: cell(2)
    integer(int32), intent(in) :: i

    if (self%history_of(i) == 0) then
      if (within(cell, self%deep_low, self%deep_high)) return
      call self%add_history(i)                     ! the cell also belongs to another extended domain
      self%history(self%history_of(i)) = history_t(0_int64, i, .true., cell, cell)
    end if
    associate (history => self%history(self%history_of(i)))
      history%low = min(history%low, cell)
      history%high = max(history%high, cell)
      if (history%own .and. .not. self%owns(cell)) call reach(self, cell)
    end associate
  end subroutine record_cell

  !> Records that an owned disk is in a cell outside the domain. There it can touch any disk in the
  !> 3 x 3 cells around it.
  subroutine reach(self, cell)
    class(histories_t), intent(inout) :: self
    integer(int16), intent(in) :: cell(2)
    integer(int32) :: there(2), dx, dy

    if (.not. within(cell, self%safe_low, self%safe_high)) then
      self%left_domain = .true.
      return
    end if
    do dy = -1, 1
      do dx = -1, 1
        there = cell + [dx, dy]
        where (self%layout%n == self%layout%whole) there = modulo(there - 1, self%layout%n) + 1
        self%reached(there(1), there(2)) = 1_int8
      end do
    end do
  end subroutine reach

  !> True if a cell is in a rectangle.
  pure function within(cell, low, high) result(yes)
    integer(int16), intent(in) :: cell(2)
    integer(int32), intent(in) :: low(2), high(2)
    logical :: yes

    yes = cell(1) >= low(1) .and. cell(1) <= high(1) .and. cell(2) >= low(2) .and. cell(2) <= high(2)
  end function within

  !> True if a cell belongs to the domain.
  pure function owns(self, cell) result(yes)
    class(histories_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)
    logical :: yes

    yes = within(cell, self%own_low, self%own_high)
  end function owns

  !> True if the domain owns disk i.
  pure function is_own(self, i) result(yes)
    class(histories_t), intent(in) :: self
    integer(int32), intent(in) :: i
    logical :: yes

    yes = self%history_of(i) == 0
    if (.not. yes) yes = self%history(self%history_of(i))%own
  end function is_own

  !> Number of histories that belong to ghosts.
  pure function n_ghosts(self) result(n)
    class(histories_t), intent(in) :: self
    integer(int32) :: n

    n = count(.not. self%history(:self%n_histories)%own, kind=int32)
  end function n_ghosts

  !> True if a disk that was in the given range of columns and rows during the window could have
  !> touched an owned disk.
  pure function could_have_met(self, low, high) result(yes)
    class(histories_t), intent(in) :: self
    integer(int32), intent(in) :: low(2), high(2)
    logical :: yes
    integer(int32) :: from(2), to(2)

    yes = all(low <= self%own_high + 1 .and. high >= self%own_low - 1)
    if (yes) return
    from = max(low, 0)
    to = min(high, self%layout%n + 1)
    yes = any(self%reached(from(1):to(1), from(2):to(2)) > 0)
  end function could_have_met

end module histories
