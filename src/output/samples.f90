!> Series of a frame, of a sample of the observables, and of an event in the event log.
module samples
  use kinds, only: int32, int64, largest_exact
  use errors, only: error_t, exit_broken, fail
  use event_log, only: event_log_t
  use h5md_layout, only: disks_group, events_group, observables_group, position, step_of, time_of, value_of
  use hdf5_series, only: double_precision, long_integer, series_t, short_integer, single_precision
  use sample_numbers, only: sample_t
  use sample_values, only: frame_column_t
  use observables, only: observable_list_t
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: frame_series, observable_series, event_series, event_samples, check_counts

contains

  !> Series of a frame: step, time, and the values of all disks.
  pure function frame_series(list, n, single) result(series)
    type(frame_column_t), intent(in) :: list(:)   !! columns of the frames
    integer, intent(in) :: n                      !! number of disks
    logical, intent(in) :: single                 !! .true. for single precision
    type(series_t) :: series(2 + size(list))
    integer :: k

    series(:2) = step_and_time(position)
    do k = 1, size(list)
      associate (width => list(k)%width)
        series(2 + k) = series_t(disks_group//trim(list(k)%name)//value_of, merge(single_precision, double_precision, single), &
          width, merge([2, n], [n, 1], width == 2))
        if (list(k)%is_count) series(2 + k)%storage = short_integer
      end associate
    end do
  end function frame_series

  !> Series of a sample of the observables: step, time, and every observable.
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

  !> Series of the event log, in the order of the values in a log entry.
  pure function event_series() result(series)
    type(series_t) :: series(5)

    series = [series_t(events_group//"time", double_precision), series_t(events_group//"i", short_integer), &
      series_t(events_group//"j", short_integer), series_t(events_group//"impulse", double_precision), &
      series_t(events_group//"momentum_change", double_precision, 1, [2, 1])]
  end function event_series

  !> Converts the logged events to samples: times, impulses and momentum changes, and the two
  !> partners of each event.
  function event_samples(log) result(samples)
    type(event_log_t), intent(in) :: log
    type(sample_t) :: samples

    ! With `source=` and this vector subscript, gfortran 12 would allocate wrong values.
    allocate (samples%reals(4, log%n), samples%integers(2, log%n))
    samples%reals = log%record([1, 4, 5, 6], :log%n)
    samples%integers = int(log%record(2:3, :log%n), int64)
  end function event_samples

  !> Reports an error if a counter of the simulation is too large to be represented exactly as a
  !> real number in a sample.
  subroutine check_counts(sim, error)
    type(simulation_t), intent(in) :: sim
    type(error_t), allocatable, intent(out) :: error
    integer(int32) :: i
    logical :: too_far

    too_far = .false.
    do i = 1, merge(sim%n_disks(), 0, any(sim%box%periodic))
      ! An image counter must be less than `largest_exact`, because a frame may contain the counter
      ! plus 1.
      too_far = too_far .or. any(abs(sim%extra(i)%image) >= largest_exact)
    end do
    if (sim%tally%events > int(largest_exact, int64) .or. too_far) &
      call fail(error, exit_broken, "more than 2**53 collisions or periods: the output cannot count further")
  end subroutine check_counts

  !> Series of the step and the time of an H5MD element.
  pure function step_and_time(element) result(series)
    character(len=*), intent(in) :: element
    type(series_t) :: series(2)

    series = [series_t(element//step_of, long_integer), series_t(element//time_of, double_precision)]
  end function step_and_time

end module samples
