!> Compares and corrects ghosts (copies of disks owned by neighbouring domains) after each time
!> window. A ghost is wrong if its motion differed from the motion of its original. If a disk owned
!> by the domain can have touched a wrong ghost, the window is invalid. Otherwise the wrong ghosts
!> are corrected. The page docs/explanation/algorithm.md proves that this criterion is sufficient.
module domain_borders
  use kinds, only: int16, int32, int64
  use domains, only: correction_t, domain_t, forever, list_ghosts, slot_of_ghost
  use partners, only: nothing
  use histories, only: history_t
  implicit none
  private
  public :: compare_ghosts, correct_ghosts

contains

  !> Determines whether a disk owned by domain k can have touched a wrong or missing ghost, and
  !> lists the corrections for the ghosts of this domain. The states of the neighbouring domains are
  !> read but not changed.
  subroutine compare_ghosts(domain, k)
    type(domain_t), intent(inout) :: domain(:)
    integer(int32), intent(in) :: k
    integer(int32) :: m, found

    found = 0
    associate (self => domain(k))
      self%n_corrections = 0
      self%valid = self%done .and. .not. self%engine%histories%left_domain
      do m = 1, size(self%neighbour)
        if (self%valid) call compare(self, domain(self%neighbour(m)), found)
      end do
      if (found < self%engine%histories%n_ghosts()) self%valid = .false.  ! a ghost without an owner
    end associate
  end subroutine compare_ghosts

  !> Compares the ghosts in a domain with the original disks of one neighbouring domain.
  subroutine compare(self, other, found)
    type(domain_t), intent(inout) :: self
    type(domain_t), intent(in) :: other
    integer(int32), intent(inout) :: found         !! number of ghosts whose owners were found
    integer(int32) :: r, s, t, cell(2), shift(2)
    logical :: met, near, same

    shift = other%layout%first - self%layout%first
    associate (mine => self%engine%histories, theirs => other%engine%histories)
      do r = 1, theirs%n_histories
        if (.not. theirs%history(r)%own) cycle
        t = theirs%history(r)%slot
        s = slot_of_ghost(self, other%sim%tag(t)%id)
        cell = modulo(other%sim%tag(t)%cell + shift - 1, self%layout%whole) + 1
        if (s > 0) then
          found = found + 1
          associate (history => mine%history(mine%history_of(s)))
            ! ghosts outside the extended domain must be removed or corrected
            same = history%digest == theirs%history(r)%digest .and. same_state() &
              .and. self%layout%holds(self%sim%tag(s)%cell)
            if (same .and. all(self%sim%tag(s)%cell == cell .and. cell <= self%layout%n)) cycle
            near = came_near(theirs%history(r), met)
            if (.not. met) met = mine%could_have_met(int(history%low, int32), int(history%high, int32))
          end associate
        else
          same = .false.
          near = came_near(theirs%history(r), met)
          if (.not. (near .and. (met .or. all(cell <= self%layout%n)))) cycle
        end if
        if (met .and. .not. same) self%valid = .false.
        if (.not. self%valid) return
        call add_correction()
      end do
    end associate
  contains

    !> True if a disk of the neighbouring domain, in any periodic image, was inside the extended
    !> domain during the window. `met` is set to .true. if the disk could have touched a disk owned
    !> by this domain.
    function came_near(history, met) result(near)
      type(history_t), intent(in) :: history
      logical, intent(out) :: met
      logical :: near
      integer(int32) :: low(2), high(2), reach(2), ix, iy

      near = .false.
      met = .false.
      reach = merge(1, 0, self%sim%box%periodic .and. self%layout%n < self%layout%whole)
      do iy = -reach(2), reach(2)
        do ix = -reach(1), reach(1)
          low = history%low + shift + [ix, iy]*self%layout%whole
          high = history%high + shift + [ix, iy]*self%layout%whole
          if (any(low > self%layout%n .or. high < 1)) cycle
          near = .true.
          met = met .or. self%engine%histories%could_have_met(low, high)
        end do
      end do
    end function came_near

    !> True if ghost s in this domain and disk t in the neighbouring domain have the same state,
    !> including the last collision partner.
    pure function same_state() result(yes)
      logical :: yes

      associate (mine => self%sim%disk(s), theirs => other%sim%disk(t))
        yes = .not. (mine%clock /= theirs%clock .or. mine%x(1) /= theirs%x(1) .or. mine%x(2) /= theirs%x(2) &
          .or. mine%v(1) /= theirs%v(1) .or. mine%v(2) /= theirs%v(2)) &
          .and. self%sim%tag(s)%collisions == other%sim%tag(t)%collisions &
          .and. self%sim%tag(s)%last_partner == other%sim%tag(t)%last_partner
      end associate
      if (.not. yes .or. .not. allocated(self%sim%extra)) return
      ! Optional data are compared bit by bit.
      yes = all(transfer(self%sim%extra(s), [0_int64]) == transfer(other%sim%extra(t), [0_int64]))
    end function same_state

    !> Adds the true state of disk t in the neighbouring domain to the list of corrections.
    subroutine add_correction()
      if (.not. allocated(self%corrections)) allocate (self%corrections(256))
      if (self%n_corrections == size(self%corrections)) self%corrections = [self%corrections, self%corrections]
      self%n_corrections = self%n_corrections + 1
      associate (correction => self%corrections(self%n_corrections))
        correction%whole_disk_t = other%sim%whole_disk(t)
        correction%global_index = other%global_index(t)
        correction%cell = cell
        correction%slot = s
      end associate
    end subroutine add_correction
  end subroutine compare

  !> Applies the corrections: updates ghosts, adds ghosts of disks that have entered the extended
  !> domain, and removes ghosts of disks that have left it.
  subroutine correct_ghosts(self)
    type(domain_t), intent(inout) :: self
    integer(int32), allocatable :: waiting(:)      ! indices of disks whose events must be predicted
    integer(int32) :: k, n_waiting, slot

    allocate (waiting(self%n_corrections))
    n_waiting = 0
    associate (histories => self%engine%histories)
      call histories%begin_window()
      do k = histories%n_histories, 1, -1
        slot = histories%history(k)%slot
        call histories%begin_history(self%sim%tag(slot)%cell, slot)
      end do
    end associate
    do k = 1, self%n_corrections
      call apply_correction(self%corrections(k))
    end do
    do k = 1, n_waiting
      call self%engine%search%predict(self%sim, waiting(k))
      call self%engine%queue%schedule(self%sim%disk, self%sim%tag, waiting(k))
    end do
    call list_ghosts(self)
    self%n_corrections = 0
  contains

    !> Applies one correction.
    subroutine apply_correction(correction)
      type(correction_t), intent(in) :: correction
      integer(int32) :: s, counter, window

      s = correction%slot
      if (any(correction%cell > self%layout%n)) then
        if (s > 0) call leave(s)
        return
      end if
      if (s == 0) then
        s = self%vacant
        self%valid = s > 0 .and. self%valid          ! without a vacant slot, the domain must be loaded again
        if (s == 0) return
        self%vacant = self%global_index(s)
      else if (self%layout%holds(self%sim%tag(s)%cell)) then
        call self%engine%search%take_out(self%sim%tag(s), s)
      end if
      window = self%sim%tag(s)%window
      counter = self%sim%disk(s)%collision_counter + 1
      call self%sim%place_disk(s, correction%whole_disk_t)
      self%sim%tag(s)%window = window
      self%sim%disk(s)%collision_counter = counter
      self%sim%disk(s)%event_time = forever
      self%global_index(s) = correction%global_index
      call self%engine%search%insert(self%sim, s, int(correction%cell, int16))
      call self%engine%histories%begin_history(self%sim%tag(s)%cell, s)
      n_waiting = n_waiting + 1
      waiting(n_waiting) = s
    end subroutine apply_correction

    !> Removes ghost s, whose original has left the extended domain.
    subroutine leave(s)
      integer(int32), intent(in) :: s

      if (self%layout%holds(self%sim%tag(s)%cell)) call self%engine%search%take_out(self%sim%tag(s), s)
      call self%engine%histories%drop_history(s)
      self%sim%disk(s)%event_time = forever
      self%sim%disk(s)%partner = nothing
      self%sim%disk(s)%collision_counter = self%sim%disk(s)%collision_counter + 1
      self%sim%tag(s)%id = 0
      self%global_index(s) = self%vacant
      self%vacant = s
    end subroutine leave
  end subroutine correct_ghosts

end module domain_borders
