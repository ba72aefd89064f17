!> Progress report of a run: completed fraction, rate, and estimated time of arrival (ETA).
module progress_line
  use kinds, only: int64, never, real64
  use simulation_state, only: simulation_t
  use status_line, only: status_line_t
  use stop_rules, only: stop_rule_t
  use system, only: seconds
  use texts, only: about
  implicit none
  private
  public :: progress_line_t

  !> Number of reports over which rates are averaged.
  integer, parameter :: window = 20

  type, extends(status_line_t) :: progress_line_t
    private
    real(real64) :: started = 0.0_real64           !! clock time when the program started [s]
    integer :: n = 0                               !! number of reports so far
    ! Circular buffers with the values at the most recent reports
    real(real64) :: clock(0:window - 1) = 0.0_real64       !! clock time [s]
    real(real64) :: share(0:window - 1) = 0.0_real64       !! completed fraction of the run
    integer(int64) :: collisions(0:window - 1) = 0_int64   !! number of disk–disk collisions
    integer(int64) :: events(0:window - 1) = 0_int64       !! number of events
  contains
    procedure :: start
    procedure :: report
    procedure, private :: bounces
  end type progress_line_t

contains

  !> Starts the reports of a run, or of the next part of a run.
  subroutine start(self, sim, stop_rule, started)
    class(progress_line_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(stop_rule_t), intent(in) :: stop_rule
    real(real64), intent(in) :: started            !! clock time when the program started [s]

    self%started = started
    self%n = 0
    call remember(self, sim, stop_rule)
  end subroutine start

  !> Displays a progress report if one is due.
  subroutine report(self, sim, stop_rule)
    class(progress_line_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(stop_rule_t), intent(in) :: stop_rule
    character(len=200) :: line
    real(real64) :: span, rate, left
    integer :: first, last

    if (.not. self%is_due()) return
    call remember(self, sim, stop_rule)
    last = modulo(self%n - 1, window)
    first = modulo(max(self%n - window, 0), window)
    span = max(self%clock(last) - self%clock(first), 1.0e-3_real64)
    rate = (self%collisions(last) - self%collisions(first))/span
    left = never
    if (self%share(last) > self%share(first)) left = (1 - self%share(last))*span/(self%share(last) - self%share(first))
    write (line, "(""t "",g0.6,""  "",f5.1,"" %  "",i0,"" collisions  "",a,"" per s  ETA "",a)") sim%time(), &
      100*self%share(last), sim%tally%collisions, about(max(rate, 1.0_real64)), clock_text(left)
    if (self%bounces(sim, first, last)) line = trim(line)//"  slow: disks bounce on walls, which contact.contact_time prevents"
    call self%show(trim(line))
  end subroutine report

  !> True if, under gravity, almost all events between two reports were bounces on dissipative
  !> walls.
  pure function bounces(self, sim, first, last) result(yes)
    class(progress_line_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer, intent(in) :: first, last                !! buffer positions of the two reports, earlier first
    logical :: yes
    integer(int64), parameter :: many = 100           ! minimum ratio of events to collisions

    yes = sim%n_disks() > 1 .and. sim%box%has_gravity() .and. sim%box%has_lossy_walls() &
      .and. self%events(last) - self%events(first) > many*(1 + self%collisions(last) - self%collisions(first))
  end function bounces

  !> Stores the time, the completed fraction, and the numbers of collisions and events. Rates are
  !> calculated from the differences between two such records.
  subroutine remember(self, sim, stop_rule)
    class(progress_line_t), intent(inout) :: self
    type(simulation_t), intent(in) :: sim
    type(stop_rule_t), intent(in) :: stop_rule
    integer :: k

    k = modulo(self%n, window)
    self%clock(k) = seconds()
    self%share(k) = stop_rule%share(sim, self%clock(k) - self%started)
    self%collisions(k) = sim%tally%collisions
    self%events(k) = sim%tally%events
    self%n = self%n + 1
  end subroutine remember

  !> Formats a duration in seconds as h:mm:ss.
  pure function clock_text(s) result(text)
    real(real64), intent(in) :: s
    character(len=:), allocatable :: text
    character(len=20) :: line
    integer :: whole

    text = "?"
    if (.not. s < 3.6e6_real64) return
    whole = nint(s)
    write (line, "(i0,"":"",i2.2,"":"",i2.2)") whole/3600, modulo(whole/60, 60), modulo(whole, 60)
    text = trim(line)
  end function clock_text

end module progress_line
