!> What domains tell each other. After a window of time all publish what their own disks near the border did, and compare
!> it with what their copies did; if no own disk can have met a wrong copy, the copies are put right. The rule, and why it
!> is right, is in docs/theory.md.
module domain_borders
  use kinds, only: int16, int32
  use disks, only: disk_t, tag_t
  use domain_grid, only: copy, domain_grid_t, forever, rim, track_t, vacant
  use domains, only: copy_of, domain_t, list_copies, report_t
  use partners, only: nothing
  implicit none
  private
  public :: publish, refresh, verify

contains

  !> Reports on the own disks that others could have copies of.
  subroutine publish(self)
    type(domain_t), intent(inout) :: self
    type(report_t), allocatable :: more(:)
    integer(int32) :: k, n

    if (.not. allocated(self%reported)) allocate (self%reported(256))
    n = 0
    select type (grid => self%engine%search)
    type is (domain_grid_t)
      do k = 1, size(grid%role, kind=int32)
        if (grid%role(k) /= rim) cycle
        if (n == size(self%reported)) then
          allocate (more(2*n))
          more(:n) = self%reported
          call move_alloc(more, self%reported)
        end if
        n = n + 1
        associate (report => self%reported(n), first => self%patch%first)
          report%disk = self%sim%disk(k)
          report%tag = self%sim%tag(k)
          report%track = grid%track(k)
          report%home = self%home(k)
          if (size(self%sim%image) > 0) report%image = self%sim%image(:, k)
          report%low = grid%track(k)%low + first - 1
          report%high = grid%track(k)%high + first - 1
          report%cell = modulo(self%sim%tag(k)%cell + first - 2, self%patch%whole) + 1
        end associate
      end do
    end select
    self%n_reports = n
  end subroutine publish

  !> Finds out whether the k-th domain's own disks can have met anybody whose history was not the true one.
  subroutine verify(domain, k)
    type(domain_t), intent(inout) :: domain(:)
    integer(int32), intent(in) :: k
    integer(int32) :: m, n, r, s, found
    logical :: met, moved

    found = 0
    moved = .false.
    n = sum(domain(domain(k)%neighbour)%n_reports)
    if (allocated(domain(k)%same)) then
      if (size(domain(k)%same) < n) deallocate (domain(k)%same)
    end if
    if (.not. allocated(domain(k)%same)) allocate (domain(k)%same(2*n))
    n = 0
    select type (grid => domain(k)%engine%search)
    type is (domain_grid_t)
      domain(k)%good = domain(k)%done .and. .not. grid%too_far
      do m = 1, size(domain(k)%neighbour)
        associate (other => domain(domain(k)%neighbour(m)))
          do r = 1, other%n_reports
            n = n + 1
            domain(k)%same(n) = .false.
            if (.not. came_near(domain(k), grid, other%reported(r), met)) cycle
            s = copy_of(domain(k), other%reported(r)%tag%id)
            if (s > 0) then
              found = found + 1
              if (size(domain(k)%sim%image) > 0) moved = any(domain(k)%sim%image(:, s) /= other%reported(r)%image)
              domain(k)%same(n) = same_history(domain(k)%sim%disk(s), domain(k)%sim%tag(s), grid%track(s), &
                other%reported(r)) .and. .not. moved
              met = met .or. grid%could_have_met(int(grid%track(s)%low, int32), int(grid%track(s)%high, int32))
            end if
            if (met .and. .not. domain(k)%same(n)) domain(k)%good = .false.
          end do
        end associate
      end do
      if (found < count(grid%role == copy)) domain(k)%good = .false.     ! a copy that nobody owns
    end select
  end subroutine verify

  !> Whether a disk that a neighbour reports on came into the patch, in any image; `met`: to where it could have met an
  !> own disk.
  function came_near(self, grid, report, met) result(near)
    type(domain_t), intent(in) :: self
    type(domain_grid_t), intent(in) :: grid
    type(report_t), intent(in) :: report
    logical, intent(out) :: met
    logical :: near
    integer(int32) :: low(2), high(2), reach(2), ix, iy

    near = .false.
    met = .false.
    reach = merge(1, 0, self%sim%box%periodic .and. self%patch%n < self%patch%whole)
    do iy = -reach(2), reach(2)
      do ix = -reach(1), reach(1)
        low = report%low - self%patch%first + 1 + [ix, iy]*self%patch%whole
        high = report%high - self%patch%first + 1 + [ix, iy]*self%patch%whole
        if (any(low > self%patch%n .or. high < 1)) cycle
        near = .true.
        met = met .or. grid%could_have_met(low, high)
      end do
    end do
  end function came_near

  !> Whether a copy had the history that its owner reports.
  pure function same_history(disk, tag, track, report) result(yes)
    type(disk_t), intent(in) :: disk
    type(tag_t), intent(in) :: tag
    type(track_t), intent(in) :: track
    type(report_t), intent(in) :: report
    logical :: yes

    yes = tag%collisions == report%tag%collisions .and. track%digest == report%track%digest &
      .and. tag%met == report%tag%met .and. .not. (any(disk%x /= report%disk%x) &
      .or. any(disk%v /= report%disk%v) .or. disk%clock /= report%disk%clock)
  end function same_history

  !> Puts the copies of the k-th domain right, takes over who came, gives up who left. All reports must be good.
  subroutine refresh(domain, k)
    type(domain_t), intent(inout) :: domain(:)
    integer(int32), intent(in) :: k
    integer(int32), allocatable :: waiting(:)
    integer(int32) :: m, n, r, n_waiting
    logical :: met

    allocate (waiting(sum(domain(domain(k)%neighbour)%n_reports)))
    n_waiting = 0
    n = 0
    select type (grid => domain(k)%engine%search)
    type is (domain_grid_t)
      do r = 1, size(grid%role, kind=int32)
        if (grid%role(r) /= rim) cycle
        if (.not. grid%owns(domain(k)%sim%tag(r)%cell)) grid%role(r) = copy
        call grid%begin_track(domain(k)%sim%tag(r), r)
      end do
      do m = 1, size(domain(k)%neighbour)
        associate (other => domain(domain(k)%neighbour(m)))
          do r = 1, other%n_reports
            n = n + 1
            if (came_near(domain(k), grid, other%reported(r), met)) &
              call take_over(domain(k), grid, other%reported(r), domain(k)%same(n), n_waiting, waiting)
          end do
        end associate
      end do
      call grid%begin_window()
      do m = 1, n_waiting
        call grid%predict(domain(k)%sim, waiting(m))
        call domain(k)%engine%queue%schedule(domain(k)%sim%disk, domain(k)%sim%tag, waiting(m))
      end do
      call list_copies(domain(k), grid)
    end select
  end subroutine refresh

  !> Takes over what the owner reports of a disk that is, or was, in the patch.
  subroutine take_over(self, grid, report, same, n_waiting, waiting)
    type(domain_t), intent(inout) :: self
    type(domain_grid_t), intent(inout) :: grid
    type(report_t), intent(in) :: report
    logical, intent(in) :: same                    !! the copy had the same history
    integer(int32), intent(inout) :: n_waiting, waiting(:)   !! (n_waiting) slots whose events are to be predicted
    integer(int32) :: s, cell(2), stamp, window

    cell = modulo(report%cell - self%patch%first, self%patch%whole) + 1
    s = copy_of(self, report%tag%id)
    if (any(cell > self%patch%n)) then
      if (s > 0) call leave(self, grid, s)
      return
    end if
    if (s == 0) then
      if (self%n_vacant == 0) then
        self%good = .false.                        ! no room: to be loaded anew
        return
      end if
      s = self%vacancy(self%n_vacant)
      self%n_vacant = self%n_vacant - 1
    else if (.not. same .or. any(self%sim%tag(s)%cell /= cell)) then
      if (self%patch%holds(self%sim%tag(s)%cell)) call grid%take_out(self%sim%tag(s), s)
    else
      if (grid%owns(self%sim%tag(s)%cell)) grid%role(s) = rim
      call grid%begin_track(self%sim%tag(s), s)
      return
    end if
    stamp = self%sim%disk(s)%stamp + 1
    window = self%sim%tag(s)%window
    self%sim%disk(s) = report%disk
    self%sim%tag(s) = report%tag
    self%sim%disk(s)%stamp = stamp
    self%sim%disk(s)%event_time = forever
    self%sim%tag(s)%window = window
    self%home(s) = report%home
    if (size(self%sim%image) > 0) self%sim%image(:, s) = report%image
    call grid%insert(self%sim%tag(s), s, int(cell, int16))
    grid%role(s) = merge(rim, copy, grid%owns(self%sim%tag(s)%cell))
    call grid%begin_track(self%sim%tag(s), s)
    n_waiting = n_waiting + 1
    waiting(n_waiting) = s
  end subroutine take_over

  !> The copy in slot s leaves the patch.
  subroutine leave(self, grid, s)
    type(domain_t), intent(inout) :: self
    type(domain_grid_t), intent(inout) :: grid
    integer(int32), intent(in) :: s

    if (self%patch%holds(self%sim%tag(s)%cell)) call grid%take_out(self%sim%tag(s), s)
    self%sim%disk(s)%event_time = forever
    self%sim%disk(s)%partner = nothing
    self%sim%disk(s)%stamp = self%sim%disk(s)%stamp + 1
    self%sim%tag(s)%id = 0
    grid%role(s) = vacant
    self%n_vacant = self%n_vacant + 1
    self%vacancy(self%n_vacant) = s
  end subroutine leave

end module domain_borders
