!> The output file of a run in H5MD layout: where frames, observables and events stand.
!> https://www.nongnu.org/h5md/h5md.html, version 1.1.
!>
!> A file never changes its layout. When the number of samples is known at the start it has room for just
!> these; else, when the room is used up, and at the end, a file that fits takes its place in one instant.
module h5md_file
  use kinds, only: int32, int64, real64
  use hdf5_objects, only: hdf5_file_t
  use hdf5_series, only: double_precision, long_integer, series_t, short_integer, single_precision
  use sample_track, only: track_t
  use system, only: remove_file, seconds
  implicit none
  private
  public :: h5md_file_t

  real(real64), parameter :: longest_wait = 0.05_real64 !! of a sample before it is written [s]

  type :: h5md_file_t
    type(hdf5_file_t) :: file
    type(track_t) :: frames, observables, events
  contains
    procedure :: plan_frames
    procedure :: plan_observables
    procedure :: plan_events
    procedure :: make_tracks
    procedure :: put_observables
    procedure :: put_events
    procedure :: reserve_frame
    procedure :: write_old
    procedure :: write_all
    procedure :: trim => trim_file
    procedure :: close => close_file
    procedure, private :: capacities
    procedure, private :: reserve
    procedure, private :: rebuild
  end type h5md_file_t

  character(len=*), parameter :: disks = "particles/disks/"
  integer, parameter, public :: position_series = 3, velocity_series = 4, collisions_series = 5, image_series = 6

contains

  !> The frames of n disks.
  subroutine plan_frames(self, n, single, wrapped)
    class(h5md_file_t), intent(inout) :: self
    integer, intent(in) :: n
    logical, intent(in) :: single                       !! positions and velocities in single precision
    logical, intent(in) :: wrapped                      !! periodic: count the periods, too
    integer :: reals

    reals = merge(single_precision, double_precision, single)
    self%frames%counter = disks//"committed"
    self%frames%series = [moments(disks//"position"), series_t(disks//"position/value", reals, 2, [2, n]), &
      series_t(disks//"velocity/value", reals, 2, [2, n]), &
      series_t(disks//"collisions/value", short_integer, 1, [n, 1])]
    if (wrapped) self%frames%series = [self%frames%series, series_t(disks//"image/value", short_integer, 2, [2, n])]
  end subroutine plan_frames

  !> The observables, by name below /observables.
  subroutine plan_observables(self, names, widths, are_counts)
    class(h5md_file_t), intent(inout) :: self
    character(len=*), intent(in) :: names(:)
    integer, intent(in) :: widths(:)                    !! number of components; 1: a scalar
    logical, intent(in) :: are_counts(:)
    integer :: k

    self%observables%counter = "observables/committed"
    self%observables%series = moments("observables/"//trim(names(1)))
    do k = 1, size(names)
      self%observables%series = [self%observables%series, series_t("observables/"//trim(names(k)) &
        //"/value", merge(long_integer, double_precision, are_counts(k)), min(widths(k) - 1, 1), [widths(k), 1])]
    end do
  end subroutine plan_observables

  !> The list of collisions.
  subroutine plan_events(self)
    class(h5md_file_t), intent(inout) :: self

    self%events%counter = "events/committed"
    self%events%series = [series_t("events/time", double_precision), series_t("events/i", short_integer), &
      series_t("events/j", short_integer), series_t("events/impulse", double_precision)]
  end subroutine plan_events

  !> Step and time of an H5MD element.
  pure function moments(element) result(series)
    character(len=*), intent(in) :: element
    type(series_t) :: series(2)

    series = [series_t(element//"/step", long_integer), series_t(element//"/time", double_precision)]
  end function moments

  !> Makes room in a new file for what is planned.
  subroutine make_tracks(self, frames, samples)
    class(h5md_file_t), intent(inout) :: self
    integer(int64), intent(in) :: frames, samples       !! of observables; 0: unknown

    call self%frames%make(self%file, frames)
    call self%observables%make(self%file, samples)
    call self%events%make(self%file, 0_int64)
  end subroutine make_tracks

  !> Appends one sample of all observables.
  subroutine put_observables(self, time, values)
    class(h5md_file_t), intent(inout) :: self
    real(real64), intent(in) :: time
    real(real64), intent(in) :: values(:)               !! components one after the other
    integer :: k, first

    call self%reserve([0_int64, 1_int64, 0_int64])
    associate (track => self%observables)
      call track%put_moment(self%file, time)
      first = 1
      do k = 3, size(track%series)
        associate (series => track%series(k), part => values(first:first + product(track%series(k)%shape) - 1))
          if (series%storage == long_integer) then
            call series%put(self%file, track%put + 1, 1_int64, nint(part, int64))
          else
            call series%put(self%file, track%put + 1, 1_int64, part)
          end if
          first = first + size(part)
        end associate
      end do
      call track%commit(self%file, 1_int64)
    end associate
  end subroutine put_observables

  !> Appends n collisions.
  subroutine put_events(self, n, time, pair, impulse)
    class(h5md_file_t), intent(inout) :: self
    integer, intent(in) :: n
    real(real64), intent(in) :: time(:), impulse(:)
    integer(int32), intent(in) :: pair(:, :)            !! (2,:)
    integer(int32), allocatable :: column(:)
    integer(int64) :: first, count

    if (n == 0) return
    count = n
    call self%reserve([0_int64, 0_int64, count])
    associate (track => self%events)
      first = track%put + 1
      call track%series(1)%put(self%file, first, count, time)
      column = pair(1, :n)
      call track%series(2)%put(self%file, first, count, column)
      column = pair(2, :n)
      call track%series(3)%put(self%file, first, count, column)
      call track%series(4)%put(self%file, first, count, impulse)
      call track%commit(self%file, count)
    end associate
  end subroutine put_events

  !> Makes sure that there is room for one more frame.
  subroutine reserve_frame(self)
    class(h5md_file_t), intent(inout) :: self

    call self%reserve([1_int64, 0_int64, 0_int64])
  end subroutine reserve_frame

  !> Makes sure that there is room for more samples of each track.
  subroutine reserve(self, more)
    class(h5md_file_t), intent(inout) :: self
    integer(int64), intent(in) :: more(3)               !! frames, observables, events
    integer(int64) :: wanted(3)

    wanted = [self%frames%larger(more(1)), self%observables%larger(more(2)), self%events%larger(more(3))]
    if (any(wanted > self%capacities())) call self%rebuild(wanted)
  end subroutine reserve

  pure function capacities(self) result(n)
    class(h5md_file_t), intent(in) :: self
    integer(int64) :: n(3)

    n = [self%frames%capacity, self%observables%capacity, self%events%capacity]
  end function capacities

  !> Gives up the room that is not used. If there is no room for the copy it stays: the counters hold.
  subroutine trim_file(self)
    class(h5md_file_t), intent(inout) :: self
    integer(int64) :: used(3)

    call self%write_all()
    if (allocated(self%file%trouble)) return
    used = [self%frames%committed, self%observables%committed, self%events%committed]
    if (all(used == self%capacities())) return
    call self%rebuild(used)
    if (allocated(self%file%trouble)) deallocate (self%file%trouble)
  end subroutine trim_file

  !> Puts a file with other capacities in the place of this one.
  subroutine rebuild(self, capacity)
    class(h5md_file_t), intent(inout) :: self
    integer(int64), intent(in) :: capacity(3)
    character(len=*), parameter :: fixed(8) = [character(len=23) :: "h5md", "parameters", &
      "provenance", disks//"box", disks//"id", disks//"species", disks//"mass", disks//"radius"]
    type(h5md_file_t) :: new
    integer :: k, length

    call self%write_all()
    if (allocated(self%file%trouble)) return
    call remove_file(self%file%path//"_new")
    call new%file%create(self%file%path//"_new", 0, name=self%file%path)
    do k = 1, size(fixed)
      call new%file%copy(self%file, trim(fixed(k)))
    end do
    do k = 3, size(self%observables%series)
      length = index(self%observables%series(k)%name, "/kinetic_energy/")
      if (length > 0) call copy_population(self%observables%series(k)%name(:length - 1))
    end do
    call new%frames%copy(new%file, self%frames, self%file, capacity(1))
    call new%observables%copy(new%file, self%observables, self%file, capacity(2))
    call new%events%copy(new%file, self%events, self%file, capacity(3))
    call new%file%flush()
    call new%file%rename()
    if (allocated(new%file%trouble)) then
      self%file%trouble = new%file%trouble
      self%file%unsaved = new%file%unsaved
      call new%close()
      call remove_file(self%file%path//"_new")
    else
      call self%close()
      self%file = new%file
      self%frames = new%frames
      self%observables = new%observables
      self%events = new%events
    end if

  contains

    !> What a group of observables holds besides its series.
    subroutine copy_population(group)
      character(len=*), intent(in) :: group

      call new%file%copy(self%file, group//"/particle_number")
      call new%file%put(group//"@dimension", [integer ::], [2_int32])
    end subroutine copy_population

  end subroutine rebuild

  subroutine close_file(self)
    class(h5md_file_t), intent(inout) :: self

    call self%frames%close()
    call self%observables%close()
    call self%events%close()
    call self%file%close()
  end subroutine close_file

  !> Writes the samples that have waited long enough.
  subroutine write_old(self)
    class(h5md_file_t), intent(inout) :: self
    real(real64) :: now

    now = seconds()
    if (now - self%frames%waiting_since > longest_wait) call self%frames%write_waiting(self%file)
    if (now - self%observables%waiting_since > longest_wait) call self%observables%write_waiting(self%file)
    if (now - self%events%waiting_since > longest_wait) call self%events%write_waiting(self%file)
  end subroutine write_old

  !> Writes all samples that wait.
  subroutine write_all(self)
    class(h5md_file_t), intent(inout) :: self

    call self%frames%write_waiting(self%file)
    call self%observables%write_waiting(self%file)
    call self%events%write_waiting(self%file)
  end subroutine write_all

end module h5md_file
