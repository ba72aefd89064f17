!> What a frame, a sample of the observables and a sample of the event log consist of: the series of each,
!> and the record with their values one after the other, in the same order.
module samples
  use kinds, only: int32, int64, most_exact, real64
  use disks, only: columns, image_column, n_columns
  use errors, only: error_t, exit_broken, fail
  use h5md_layout, only: disk_collisions, disks_group, events_group, image, observables_group, position, step_of, time_of, &
    value_of, velocity
  use hdf5_series, only: double_precision, long_integer, series_t, short_integer, single_precision
  use observables, only: observable_list_t, observed
  use simulation_state, only: simulation_t
  use team, only: many
  implicit none
  private
  public :: frame_series, frame_sample, observable_series, observable_sample, event_series, check_counts

contains

  !> The series of the frames: step, time, and the values of all disks.
  pure function frame_series(sim, single) result(series)
    type(simulation_t), intent(in) :: sim
    logical, intent(in) :: single                 !! numbers with a fraction in single precision
    type(series_t), allocatable :: series(:)
    integer :: reals, n, k

    n = sim%n_disks()
    reals = merge(single_precision, double_precision, single)
    series = [step_and_time(position), series_t(position//value_of, reals, 2, [2, n]), &
      series_t(velocity//value_of, reals, 2, [2, n]), series_t(disk_collisions//value_of, long_integer, 1, [n, 1])]
    if (sim%row(image_column) > 0) series = [series, series_t(image//value_of, long_integer, 2, [2, n])]
    do k = 1, n_columns
      if (in_frames(sim, k)) series = [series, series_t(disks_group//trim(columns(k)%name)//value_of, &
        reals, 1, [n, 1])]
    end do
  end function frame_series

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

  !> The series of the observables: step, time, and every observable.
  pure function observable_series(list) result(series)
    type(observable_list_t), intent(in) :: list
    type(series_t), allocatable :: series(:)
    integer :: k

    allocate (series(2 + list%n))
    series(:2) = step_and_time(observables_group//trim(list%row(1)%name))
    do k = 1, list%n
      associate (row => list%row(k))
        series(2 + k) = series_t(observables_group//trim(row%name)//value_of, &
          merge(long_integer, double_precision, row%is_count), min(row%width - 1, 1), [row%width, 1])
      end associate
    end do
  end function observable_series

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

  !> The series of the event log; its records come from the log.
  pure function event_series() result(series)
    type(series_t) :: series(5)

    series = [series_t(events_group//"time", double_precision), series_t(events_group//"i", short_integer), &
      series_t(events_group//"j", short_integer), series_t(events_group//"impulse", double_precision), &
      series_t(events_group//"momentum_change", double_precision, 1, [2, 1])]
  end function event_series

  !> Fails if a count of a simulation is too large for samples, which hold it as a real.
  subroutine check_counts(sim, error)
    type(simulation_t), intent(in) :: sim
    type(error_t), allocatable, intent(out) :: error
    integer(int32) :: i
    logical :: too_far

    too_far = .false.
    do i = 1, merge(sim%n_disks(), 0, any(sim%box%periodic))
      too_far = too_far .or. any(abs(sim%image(i)) >= int(most_exact, int64))         ! a frame may have to count one period more
    end do
    if (sim%tally%events > int(most_exact, int64) .or. too_far) &
      call fail(error, exit_broken, "more than 2**53 collisions or periods: the output cannot count further")
  end subroutine check_counts

  !> Step and time of an H5MD element.
  pure function step_and_time(element) result(series)
    character(len=*), intent(in) :: element
    type(series_t) :: series(2)

    series = [series_t(element//step_of, long_integer), series_t(element//time_of, double_precision)]
  end function step_and_time

end module samples
