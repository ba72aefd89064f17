!> The search of one domain: the cells of a part of the box, with the domain's own disks and copies of those around. It
!> notes where they went and what they met, so that one can tell afterwards whether the copies did what the disks that
!> they stand for did elsewhere; and it books only the collisions that are this domain's to count.
module domain_grid
  use, intrinsic :: iso_fortran_env, only: int8
  use kinds, only: int16, int32, int64, real64
  use cell_grid, only: cell_grid_t
  use disks, only: tag_t
  use exact_sums, only: exact_sum_t
  use partners, only: n_sides, nothing
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: copy, deep, domain_grid_t, rim, track_t, vacant, forever

  !> What a slot holds: nothing; an own disk that nobody else has a copy of; one that others may have; a copy.
  integer(int8), parameter :: vacant = 0_int8, deep = 1_int8, rim = 2_int8, copy = 3_int8
  real(real64), parameter :: forever = 2.0e150_real64    !! later than any event

  !> What a disk did in the present window of time.
  type :: track_t
    integer(int16) :: low(2) = 0_int16             !! first column, row that it was in
    integer(int16) :: high(2) = 0_int16            !! last
    integer(int64) :: digest = 0                   !! of the times of its collisions with disks
  end type track_t

  type, extends(cell_grid_t) :: domain_grid_t
    integer(int8), allocatable :: role(:)          !! (slots)
    type(track_t), allocatable :: track(:)         !! (slots) of rims and copies
    integer(int32) :: own_low(2) = 0, own_high(2) = 0      !! columns, rows of the domain
    integer(int32) :: deep_low(2) = 0, deep_high(2) = 0    !! those that are in no other domain's patch
    integer(int32) :: safe_low(2) = 0, safe_high(2) = 0    !! beyond these the patch has an open end
    integer(int8), allocatable :: reached(:, :)    !! (0:,0:) 1: an own disk came near this cell from its domain
    logical :: too_far = .false.                   !! an own disk came to the end of the patch
    ! The counts and sums so far
    integer(int64), private :: events = 0, collisions = 0, obstacle_collisions = 0, wall_collisions(n_sides) = 0
    type(exact_sum_t), private :: virial, dissipated, wall_impulse(n_sides)
  contains
    procedure :: predict
    procedure :: predict_both
    procedure :: cross
    procedure :: begin_window
    procedure :: begin_track
    procedure :: keep_sums
    procedure :: could_have_met
    procedure :: owns
    procedure, private :: note
  end type domain_grid_t

contains

  !> A new window begins: no own disk has left the domain yet.
  subroutine begin_window(self)
    class(domain_grid_t), intent(inout) :: self

    self%reached = 0_int8
    self%too_far = .false.
  end subroutine begin_window

  !> Disk i begins a new track where it is. Of own disks also the role follows from that.
  subroutine begin_track(self, tag, i)
    class(domain_grid_t), intent(inout) :: self
    type(tag_t), intent(in) :: tag
    integer(int32), intent(in) :: i

    self%track(i) = track_t(tag%cell, tag%cell)
    if (self%role(i) == copy) return
    self%role(i) = deep
    if (any(tag%cell < self%deep_low .or. tag%cell > self%deep_high)) self%role(i) = rim
  end subroutine begin_track

  !> Takes the counts and sums of a simulation as booked.
  subroutine keep_sums(self, sim)
    class(domain_grid_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim

    self%events = sim%events
    self%collisions = sim%collisions
    self%virial = sim%virial
    self%dissipated = sim%dissipated
    self%wall_collisions = sim%wall_collisions
    self%obstacle_collisions = sim%obstacle_collisions
    self%wall_impulse = sim%wall_impulse
  end subroutine keep_sums

  !> Predicts disk i. If it has just met a wall, that counts only if the disk is an own one.
  subroutine predict(self, sim, i)
    class(domain_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i

    if (self%role(i) == vacant) then
      sim%disk(i)%event_time = forever
      sim%disk(i)%partner = nothing
      return
    end if
    if (sim%events /= self%events) then
      if (self%role(i) == copy) then
        sim%events = self%events
        sim%dissipated = self%dissipated
        sim%wall_collisions = self%wall_collisions
        sim%obstacle_collisions = self%obstacle_collisions
        sim%wall_impulse = self%wall_impulse
      else
        call self%keep_sums(sim)
      end if
    end if
    call self%cell_grid_t%predict(sim, i)
  end subroutine predict

  !> Predicts the disks i and j, which have just collided. That counts where the one with the lower id is an own one.
  subroutine predict_both(self, sim, i, j)
    class(domain_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j

    if (self%role(merge(i, j, sim%tag(i)%id < sim%tag(j)%id)) == copy) then
      sim%events = self%events
      sim%collisions = self%collisions
      sim%virial = self%virial
      sim%dissipated = self%dissipated
    else
      self%events = sim%events
      self%collisions = sim%collisions
      self%virial = sim%virial
      self%dissipated = sim%dissipated
    end if
    if (self%role(i) /= deep) call add_moment(self%track(i)%digest, sim%disk(i)%clock)
    if (self%role(j) /= deep) call add_moment(self%track(j)%digest, sim%disk(j)%clock)
    call self%cell_grid_t%predict_both(sim, i, j)
    call self%note(sim%tag(i)%cell, i)
    call self%note(sim%tag(j)%cell, j)
  end subroutine predict_both

  !> Adds a collision to a digest.
  elemental subroutine add_moment(digest, time)
    integer(int64), intent(inout) :: digest
    real(real64), intent(in) :: time

    digest = ieor(ishftc(digest, 11), transfer(time, digest))
  end subroutine add_moment

  !> Moves disk i into the next cell, and notes that.
  subroutine cross(self, sim, i, code)
    class(domain_grid_t), intent(inout) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    integer(int32), intent(in) :: code

    call self%cell_grid_t%cross(sim, i, code)
    call self%note(sim%tag(i)%cell, i)
  end subroutine cross

  !> Notes that disk i is in a cell.
  subroutine note(self, cell, i)
    class(domain_grid_t), intent(inout) :: self
    integer(int16), intent(in) :: cell(2)
    integer(int32), intent(in) :: i

    if (self%role(i) == deep) then
      if (all(cell >= self%deep_low .and. cell <= self%deep_high)) return
      self%role(i) = rim                           ! from here on others could have seen it
      self%track(i) = track_t(cell, cell)
    else
      self%track(i)%low = min(self%track(i)%low, cell)
      self%track(i)%high = max(self%track(i)%high, cell)
    end if
    if (self%role(i) == rim .and. .not. self%owns(cell)) call reach(self, cell)
  end subroutine note

  !> Notes that an own disk has left the domain: it may meet whoever is in the nine cells around.
  subroutine reach(self, cell)
    class(domain_grid_t), intent(inout) :: self
    integer(int16), intent(in) :: cell(2)
    integer(int32) :: there(2), dx, dy

    if (any(cell < self%safe_low .or. cell > self%safe_high)) then
      self%too_far = .true.
      return
    end if
    do dy = -1, 1
      do dx = -1, 1
        there = cell + [dx, dy]
        where (self%patch%n == self%patch%whole) there = modulo(there - 1, self%patch%n) + 1
        self%reached(there(1), there(2)) = 1_int8
      end do
    end do
  end subroutine reach

  !> Whether a cell belongs to the domain.
  pure function owns(self, cell) result(yes)
    class(domain_grid_t), intent(in) :: self
    integer(int16), intent(in) :: cell(2)
    logical :: yes

    yes = all(cell >= self%own_low .and. cell <= self%own_high)
  end function owns

  !> Whether a disk that was in these columns and rows, and nowhere else, could have met an own one.
  pure function could_have_met(self, low, high) result(yes)
    class(domain_grid_t), intent(in) :: self
    integer(int32), intent(in) :: low(2), high(2)
    logical :: yes
    integer(int32) :: from(2), to(2)

    yes = all(low <= self%own_high + 1 .and. high >= self%own_low - 1)
    if (yes) return
    from = max(low, 0)
    to = min(high, self%patch%n + 1)
    yes = any(self%reached(from(1):to(1), from(2):to(2)) > 0)
  end function could_have_met

end module domain_grid
