!> What a frame, a sample of the observables and a sample of the event log consist of: the series of each,
!> and the record with their values one after the other, in the same order.
module samples
  use kinds, only: int32, int64, real64
  use box_geometry, only: box_t
  use errors, only: error_t, exit_broken, fail
  use h5md_layout, only: disk_collisions, events_group, image, observables_group, position, step_of, time_of, &
    value_of, velocity
  use hdf5_series, only: double_precision, long_integer, series_t, short_integer, single_precision
  use observables, only: observable_list_t, observed
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: frame_series, frame_sample, observable_series, observable_sample, event_series, check_counts

contains

  !> The series of the frames: step, time, and the values of n disks.
  pure function frame_series(n, single, periodic) result(series)
    integer, intent(in) :: n
    logical, intent(in) :: single                 !! positions and velocities in single precision
    logical, intent(in) :: periodic               !! any axis: count the periods, too
    type(series_t), allocatable :: series(:)
    integer :: reals

    reals = merge(single_precision, double_precision, single)
    series = [step_and_time(position), series_t(position//value_of, reals, 2, [2, n]), &
      series_t(velocity//value_of, reals, 2, [2, n]), series_t(disk_collisions//value_of, long_integer, 1, [n, 1])]
    if (periodic) series = [series, series_t(image//value_of, long_integer, 2, [2, n])]
  end function frame_series

  !> The frame of this moment, disks in the order of the input.
  pure function frame_sample(sim, step) result(sample)
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(in) :: step            !! number of the frame, from 0
    real(real64), allocatable :: sample(:, :)     !! (width,1)
    integer(int64) :: periods(2)
    integer(int32) :: i, k, n

    n = sim%n_disks()
    allocate (sample(2 + merge(7, 5, any(sim%box%periodic))*n, 1))
    sample(:2, 1) = [real(step, real64), sim%time()]
    associate (x => sample(3:2 + 2*n, 1), v => sample(3 + 2*n:2 + 4*n, 1), &
      collisions => sample(3 + 4*n:2 + 5*n, 1), images => sample(3 + 5*n:, 1))
      do i = 1, n
        k = sim%tag(i)%id
        x(2*k - 1:2*k) = sim%position(i)
        v(2*k - 1:2*k) = sim%velocity(i)
        collisions(k) = sim%tag(i)%collisions
        if (size(images) == 0) cycle
        periods = sim%image(:, i)
        call wrap(sim%box, x(2*k - 1:2*k), periods)
        images(2*k - 1:2*k) = periods
      end do
    end associate
  end function frame_sample

  !> Moves a point by whole periods into the box, which holds its lower sides only, and counts them.
  pure subroutine wrap(box, x, image)
    type(box_t), intent(in) :: box
    real(real64), intent(inout) :: x(2)           !! [length]
    integer(int64), intent(inout) :: image(2)     !! periods travelled
    integer(int64) :: periods(2)

    associate (edges => box%edges())
      periods = merge(floor((x - box%lower)/edges, int64), 0_int64, box%periodic)
      where (box%periodic .and. x - periods*edges >= box%upper) periods = periods + 1
      image = image + periods
      x = x - periods*edges
    end associate
    where (box%periodic) x = max(x, box%lower)    ! by rounding only
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
    type(series_t) :: series(4)

    series = [series_t(events_group//"time", double_precision), series_t(events_group//"i", short_integer), &
      series_t(events_group//"j", short_integer), series_t(events_group//"impulse", double_precision)]
  end function event_series

  !> Fails if a count of a simulation is too large for samples, which hold it as a real.
  subroutine check_counts(sim, error)
    type(simulation_t), intent(in) :: sim
    type(error_t), allocatable, intent(out) :: error
    integer(int64), parameter :: most = 2_int64**digits(1.0_real64)

    if (sim%events > most .or. any(abs(sim%image) >= most)) & ! a frame may have to count one period more
      call fail(error, exit_broken, "more than 2**53 collisions or periods: the output cannot count further")
  end subroutine check_counts

  !> Step and time of an H5MD element.
  pure function step_and_time(element) result(series)
    character(len=*), intent(in) :: element
    type(series_t) :: series(2)

    series = [series_t(element//step_of, long_integer), series_t(element//time_of, double_precision)]
  end function step_and_time

end module samples
