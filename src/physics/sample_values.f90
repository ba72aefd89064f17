!> Values of frames and of observables at the present time, as flat arrays for the output.
module sample_values
  use kinds, only: int32, int64, real64
  use observables, only: observable_list_t, observed
  use simulation_state, only: simulation_t
  use team, only: many
  implicit none
  private
  public :: frame_column_t, frame_columns, frame_sample, observable_sample, wrap

  !> A quantity that frames contain for each disk.
  type :: frame_column_t
    character(len=16) :: name
    integer :: width = 1
    logical :: is_count = .false.
  end type frame_column_t

  !> Columns of a frame: first the columns that exist in all runs, then the columns that exist only in some runs.
  type(frame_column_t), parameter :: columns(*) = [frame_column_t("position", 2), frame_column_t("velocity", 2), &
    frame_column_t("event_count", is_count=.true.), frame_column_t("image", 2, is_count=.true.), &
    frame_column_t("angular_velocity"), frame_column_t("orientation"), frame_column_t("recycled", is_count=.true.)]

contains

  !> Columns of the frames of a simulation: the positions, and the columns named in `wanted`. Without `wanted` the frames have all
  !> columns.
  pure function frame_columns(sim, wanted) result(list)
    type(simulation_t), intent(in) :: sim
    character(len=*), intent(in), optional :: wanted(:)   !! names of the wanted columns
    type(frame_column_t), allocatable :: list(:)
    integer :: k

    list = pack(columns, [.true., .true., .true., any(sim%box%periodic), sim%features%rotation, sim%features%orientation, &
      allocated(sim%recycled)])
    if (present(wanted)) list = pack(list, [.true., (any(wanted == list(k)%name), k=2, size(list))])
  end function frame_columns

  !> The frame at the present time, with the disks in the order of the input.
  function frame_sample(sim, step, list) result(sample)
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(in) :: step            !! number of the frame, counted from 0
    type(frame_column_t), intent(in) :: list(:)   !! columns of the frame
    real(real64), allocatable :: sample(:, :)     !! (width,1)
    logical :: shared
    real(real64) :: x(2), v(2), image(2)
    integer(int32) :: i, k, n
    integer :: c, first
    integer :: at(size(columns))                  ! index of the first element of each column; 0 for columns that the frame lacks

    n = sim%n_disks()
    allocate (sample(2 + n*sum(list%width), 1))
    sample(:2, 1) = [real(step, real64), sim%time()]
    first = 3
    at = 0
    do c = 1, size(list)
      at(findloc(columns%name, list(c)%name, dim=1)) = first
      first = first + n*list(c)%width
    end do
    shared = n >= many
    !$omp parallel do private(k, x, v, image) if (shared)
    do i = 1, n
      k = sim%tag(i)%id - 1
      x = sim%position(i)
      v = sim%velocity(i)
      image = 0
      if (any(sim%box%periodic)) then
        image = sim%extra(i)%image
        call wrap(sim, x, v, image)
      end if
      if (at(1) > 0) sample(at(1) + 2*k:at(1) + 2*k + 1, 1) = x
      if (at(2) > 0) sample(at(2) + 2*k:at(2) + 2*k + 1, 1) = v
      if (at(3) > 0) sample(at(3) + k, 1) = sim%tag(i)%collisions
      if (at(4) > 0) sample(at(4) + 2*k:at(4) + 2*k + 1, 1) = image
      if (at(5) > 0) sample(at(5) + k, 1) = sim%spin(i)
      if (at(6) > 0) sample(at(6) + k, 1) = sim%extra(i)%angle + sim%spin(i)*(sim%now - sim%disk(i)%clock)
      if (at(7) > 0) sample(at(7) + k, 1) = sim%recycled(k + 1)
    end do
    !$omp end parallel do
  end function frame_sample

  !> Moves a disk by whole periods into the box and counts the periods. Points on the left and lower side belong to the box, points
  !> on the right and upper side do not. Shifts along y are applied first, because in a sheared box a shift along y also changes x.
  pure subroutine wrap(sim, x, v, image)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(inout) :: x(2)           !! [length]
    real(real64), intent(inout) :: v(2)           !! [length/time]
    real(real64), intent(inout) :: image(2)       !! number of periods by which the disk has moved
    real(real64) :: periods
    integer :: axis

    do axis = 2, 1, -1
      if (.not. sim%box%periodic(axis)) cycle
      associate (lower => sim%box%lower(axis), upper => sim%box%upper(axis), images => sim%images())
        periods = floor((x(axis) - lower)/(upper - lower), int64)
        if (x(axis) - periods*(upper - lower) >= upper) periods = periods + 1
        if (axis == 2) then
          call images%enter_image_frame(periods, sim%now, x, v, image)
        else
          x(1) = x(1) - periods*(upper - lower)
          image(1) = image(1) + periods
        end if
        x(axis) = max(x(axis), lower)             ! a rounding error may have moved the position out of the box
      end associate
    end do
  end subroutine wrap

  !> The values of all observables at the present time.
  pure function observable_sample(sim, step) result(sample)
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(in) :: step            !! number of the sample, counted from 0
    real(real64), allocatable :: sample(:, :)     !! (width,1)
    type(observable_list_t) :: list

    list = observed(sim)
    associate (values => list%values())
      sample = reshape([real(step, real64), sim%time(), values], [2 + size(values), 1])
    end associate
  end function observable_sample

end module sample_values
