!> Values of frames and of observables at the present time, for the output.
module sample_values
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use kinds, only: int32, int64, real64
  use observables, only: observable_list_t, observed
  use sample_numbers, only: first_values, sample_t
  use simulation_state, only: simulation_t, system_t
  use team, only: many
  implicit none
  private
  public :: all_columns, column_words, frame_column_t, frame_columns, frame_sample, has_columns, observable_sample, wrap

  !> A quantity stored in frames for each disk.
  type :: frame_column_t
    character(len=17) :: name
    integer :: width = 1
    logical :: is_count = .false.                 !! whether the values are integers
    character(len=80) :: meaning = ""             !! for `--explain`; a drive describes its own column
    character(len=80) :: needs = ""               !! requirement of this column, for messages
  end type frame_column_t

  !> Placeholder for the name of `drive_count`, which depends on the driving.
  character(len=*), parameter :: the_count = ""
  !> All columns, in the order of the conditions in `has_columns` and of the cases in
  !> `frame_sample`.
  type(frame_column_t), parameter :: all_columns(*) = [ &
    frame_column_t("position", 2, meaning="Positions of the disks."), &
    frame_column_t("velocity", 2, meaning="Velocities of the disks."), &
    frame_column_t("event_count", is_count=.true., meaning="Number of events of each disk since the start."), &
    frame_column_t("present", 1, .true., "Value 1 for disks in the box and 0 for others, if disks can leave or enter.", &
      "side.open, a source (&source) or species.waiting"), &
    frame_column_t("image", 2, .true., "Number of box periods that each disk has crossed, if a boundary is periodic.", &
      "a periodic axis (box.boundary)"), &
    frame_column_t("angular_velocity", meaning="Angular velocities, if disks rotate.", &
      needs="disks that rotate, for example by contact.tangential_restitution"), &
    frame_column_t("orientation", meaning="Orientations, if disks rotate or are active.", &
      needs="disks that rotate, active disks, or a file (species.file) with orientations"), &
    frame_column_t(the_count, is_count=.true.)]
  !> Names of the columns, separated by blanks.
  character(len=*), parameter :: column_words = &
    transfer(all_columns%name, repeat(" ", len(all_columns%name)*size(all_columns)))

contains

  !> True for each of `all_columns` that is available in frames of a system.
  pure function has_columns(system, periodic) result(yes)
    class(system_t), intent(in) :: system
    logical, intent(in) :: periodic(2)                    !! whether the box is periodic along each axis
    logical :: yes(size(all_columns))

    yes = [.true., .true., .true., system%features%open, any(periodic), system%features%rotation, &
      system%features%orientation, system%kick_counter() /= ""]
  end function has_columns

  !> Columns of the frames of a system: the positions, and the columns in `wanted`; by default, all
  !> available columns.
  pure function frame_columns(system, periodic, wanted) result(list)
    class(system_t), intent(in) :: system
    logical, intent(in) :: periodic(2)                    !! as in `has_columns`
    character(len=*), intent(in), optional :: wanted(:)   !! names of the requested columns
    type(frame_column_t), allocatable :: list(:)
    integer :: k

    list = all_columns
    where (list%name == the_count) list%name = system%kick_counter()
    list = pack(list, has_columns(system, periodic))
    if (present(wanted)) list = pack(list, [.true., (any(wanted == list(k)%name), k=2, size(list))])
  end function frame_columns

  !> The present frame, with disks in the order of the input. Positions and velocities of waiting
  !> disks are NaN.
  function frame_sample(sim, step, list) result(sample)
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(in) :: step            !! number of the frame, counted from 0
    type(frame_column_t), intent(in) :: list(:)   !! columns of the frame
    type(sample_t) :: sample
    logical :: shared, inside
    real(real64) :: x(2), v(2), image(2)
    real(real64) :: absent                        ! NaN, for disks outside the box
    integer(int32) :: i, k, n
    integer :: n_integers                         ! number of integers per disk
    integer :: at(size(all_columns))              ! index of disk 1 in each column; 0 for missing columns

    n = sim%n_disks()
    n_integers = sum(list%width, list%is_count)
    allocate (sample%reals(1 + n*(sum(list%width) - n_integers), 1), sample%integers(1 + n*n_integers, 1))
    sample%integers(1, 1) = step
    sample%reals(1, 1) = sim%time()
    at = places(list, n)
    shared = n >= many
    absent = ieee_value(absent, ieee_quiet_nan)
    associate (reals => sample%reals(:, 1), integers => sample%integers(:, 1))
      !$omp parallel do private(k, x, v, image, inside) if (shared)
      do i = 1, n
        k = sim%tag(i)%id - 1
        inside = sim%is_inside(i)
        x = sim%position(i)
        v = sim%velocity(i)
        image = 0
        if (any(sim%box%periodic) .and. inside) then
          image = sim%extra(i)%image
          call wrap(sim, x, v, image)
        end if
        if (.not. inside) x = absent
        if (.not. inside) v = absent
        if (at(1) > 0) reals(at(1) + 2*k:at(1) + 2*k + 1) = x
        if (at(2) > 0) reals(at(2) + 2*k:at(2) + 2*k + 1) = v
        if (at(3) > 0) integers(at(3) + k) = sim%tag(i)%collisions
        if (at(4) > 0) integers(at(4) + k) = merge(1, 0, inside)
        if (at(5) > 0) integers(at(5) + 2*k:at(5) + 2*k + 1) = int(image, int64)
        if (at(6) > 0) reals(at(6) + k) = merge(sim%spin(i), absent, inside)
        if (at(7) > 0) reals(at(7) + k) = sim%extra(i)%angle + sim%spin(i)*(sim%now - sim%disk(i)%clock)
        if (at(7) > 0 .and. .not. inside) reals(at(7) + k) = absent
        if (at(8) > 0) integers(at(8) + k) = sim%drive_count(k + 1)
      end do
      !$omp end parallel do
    end associate
  end function frame_sample

  !> Index of the first value of each of `all_columns` among the reals or the integers of a frame; 0
  !> for columns not in the frame.
  pure function places(list, n) result(at)
    type(frame_column_t), intent(in) :: list(:)   !! columns of the frame
    integer(int32), intent(in) :: n               !! number of disks
    integer :: at(size(all_columns)), first(size(list))
    integer :: c, column

    at = 0
    first = 1 + first_values(n*list%width, list%is_count)    ! after step and time
    do c = 1, size(list)
      column = findloc(all_columns%name, list(c)%name, dim=1)
      if (column == 0) column = findloc(all_columns%name, the_count, dim=1)
      at(column) = first(c)
    end do
  end function places

  !> Moves a disk by whole periods into the box and counts the periods. Points on the left and lower
  !> side belong to the box; points on the right and upper side do not. Shifts along y come first,
  !> because in a sheared box they also change x.
  pure subroutine wrap(sim, x, v, image)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(inout) :: x(2)           !! [length]
    real(real64), intent(inout) :: v(2)           !! [length/time]
    real(real64), intent(inout) :: image(2)       !! image counters, to which the crossed periods are added
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
        x(axis) = max(x(axis), lower)      ! a rounding error may have moved the position out of the box
      end associate
    end do
  end subroutine wrap

  !> The values of all observables at the present time.
  pure function observable_sample(sim, step) result(sample)
    type(simulation_t), intent(in) :: sim
    integer(int64), intent(in) :: step            !! number of the sample, counted from 0
    type(sample_t) :: sample
    type(observable_list_t) :: list
    logical, allocatable :: is_count(:), is_real(:)
    integer :: c, k

    list = observed(sim)
    is_count = [([(list%row(k)%is_count, c=1, list%row(k)%width)], k=1, list%n)]
    associate (values => list%values())
      is_real = .not. is_count
      sample%reals = reshape([sim%time(), pack(values, is_real)], [1 + count(is_real), 1])
      sample%integers = reshape([step, int(pack(values, is_count), int64)], [1 + count(is_count), 1])
    end associate
  end function observable_sample

end module sample_values
