!> A frame and a sample of the observables of this moment: their values one after the other.
module moments
  use kinds, only: int32, int64, real64
  use disks, only: columns, image_column, n_columns
  use observables, only: observable_list_t, observed
  use simulation_state, only: simulation_t
  use team, only: many
  implicit none
  private
  public :: frame_sample, in_frames, observable_sample

contains

  !> Whether an optional column is an element of its own in frames.
  pure function in_frames(sim, k) result(yes)
    type(simulation_t), intent(in) :: sim
    integer, intent(in) :: k                      !! number in `disks: columns`
    logical :: yes

    yes = columns(k)%is_element .and. sim%row(k) > 0
  end function in_frames

  !> The frame of this moment, disks in the order of the input.
  function frame_sample(sim, step) result(sample)
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(in) :: step            !! number of the frame, from 0
    real(real64), allocatable :: sample(:, :)     !! (width,1)
    logical :: periodic, shared
    integer(int32) :: i, k, n
    integer :: c, last

    n = sim%n_disks()
    periodic = sim%row(image_column) > 0
    last = 2 + merge(7, 5, periodic)*n
    allocate (sample(last + n*count([(in_frames(sim, c), c=1, n_columns)]), 1))
    sample(:2, 1) = [real(step, real64), sim%time()]
    shared = n >= many
    associate (x => sample(3:2 + 2*n, 1), v => sample(3 + 2*n:2 + 4*n, 1), &
      collisions => sample(3 + 4*n:2 + 5*n, 1), images => sample(3 + 5*n:last, 1))
      !$omp parallel do private(k) if (shared)
      do i = 1, n
        k = sim%tag(i)%id
        x(2*k - 1:2*k) = sim%position(i)
        v(2*k - 1:2*k) = sim%velocity(i)
        collisions(k) = sim%tag(i)%collisions
        if (.not. periodic) cycle
        images(2*k - 1:2*k) = sim%image(i)
        call wrap(sim, x(2*k - 1:2*k), v(2*k - 1:2*k), images(2*k - 1:2*k))
      end do
      !$omp end parallel do
    end associate
    do c = 1, n_columns
      if (.not. in_frames(sim, c)) cycle
      sample(last + sim%tag%id, 1) = sim%values_now(c)
      last = last + n
    end do
  end function frame_sample

  !> Moves a disk by whole periods into the box, which holds its lower sides only, and counts them. The rows come first: in
  !> a sheared box they change the column.
  pure subroutine wrap(sim, x, v, image)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(inout) :: x(2)           !! [length]
    real(real64), intent(inout) :: v(2)           !! [length/time]
    real(real64), intent(inout) :: image(2)       !! periods travelled
    real(real64) :: periods
    integer :: axis

    do axis = 2, 1, -1
      if (.not. sim%box%periodic(axis)) cycle
      associate (lower => sim%box%lower(axis), upper => sim%box%upper(axis), images => sim%images())
        periods = floor((x(axis) - lower)/(upper - lower), int64)
        if (x(axis) - periods*(upper - lower) >= upper) periods = periods + 1
        if (axis == 2) then
          call images%climb(periods, sim%now, x, v, image)
        else
          x(1) = x(1) - periods*(upper - lower)
          image(1) = image(1) + periods
        end if
        x(axis) = max(x(axis), lower)             ! by rounding only
      end associate
    end do
  end subroutine wrap

  !> The observables of this moment.
  pure function observable_sample(sim, step) result(sample)
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(in) :: step            !! number of the sample, from 0
    real(real64), allocatable :: sample(:, :)     !! (width,1)
    type(observable_list_t) :: list

    list = observed(sim)
    associate (values => list%values())
      sample = reshape([real(step, real64), sim%time(), values], [2 + size(values), 1])
    end associate
  end function observable_sample

end module moments
