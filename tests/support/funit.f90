!> Runs `.pf` tests where pFUnit is not installed: its rules of comparison, its words, its exit codes.
!> `translate_pf.py` turns each `@assert` into a call of what is below. What pFUnit refuses does not
!> compile here either: `pf_pair` exists only for the combinations of types that pFUnit accepts.
module funit
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use, intrinsic :: iso_fortran_env, only: error_unit, int32, int64, output_unit, real32, real64
  implicit none
  private
  public :: anyexceptions, pf_real, pf_begin, pf_run, pf_finish, pf_fail, pf_fail_pair
  public :: pf_conform, pf_same, pf_close, pf_relatively_close, pf_width
  public :: pf_holds
  public :: pf_pair, pf_number_pair, pf_real_pair

  integer, parameter :: pf_real = real64      !! the kind in which tolerances apply
  integer, parameter :: pair_length = 132     !! enough for two numbers; long texts are cut
  character(len=*), parameter :: pair_format = "(""expected <"",g0,""> actual <"",g0,"">"")"

  !> Whether two values are equal, by the rules of `@assertEqual`.
  interface pf_same
    module procedure same_int32, same_int32_int64, same_int64, same_int32_real64
    module procedure same_real32_real64, same_real64, same_logical, same_text
  end interface pf_same

  !> What was compared, for the report: of any type, of numbers, of numbers that have a tolerance.
  interface pf_pair
    module procedure pair_int32, pair_int32_int64, pair_int64, pair_int32_real64
    module procedure pair_real32_real64, pair_real64, pair_logical, pair_text
  end interface pf_pair
  interface pf_number_pair
    module procedure pair_int32, pair_int32_int64, pair_int64, pair_int32_real64
    module procedure pair_real32_real64, pair_real64
  end interface pf_number_pair
  interface pf_real_pair
    module procedure pair_int32_real64, pair_real32_real64, pair_real64
  end interface pf_real_pair

  !> A tolerance: default real or the kind of the values.
  interface pf_width
    module procedure width_real32, width_real64
  end interface pf_width

  abstract interface
    !> A test or fixture.
    subroutine test_body()
    end subroutine test_body
  end interface

  !> A condition: a scalar or a vector.
  interface pf_holds
    module procedure holds_scalar, holds_vector
  end interface pf_holds

  logical :: failed = .false.                 !! the present test
  integer :: tests = 0, failures = 0
  character(len=:), allocatable :: filter     !! only tests whose suite.name contains it
  character(len=:), allocatable :: test_name, report

contains

  !> Whether the present test has failed; a helper that asserts is followed by this question.
  logical function anyexceptions()
    anyexceptions = failed
  end function anyexceptions

  !> Reads the one option: `-f text` runs the tests whose names contain the text.
  subroutine pf_begin()
    integer :: length
    character(len=2) :: option
    filter = ""
    report = ""
    if (command_argument_count() == 0) return
    call get_command_argument(1, option)
    call get_command_argument(2, length=length)
    if (option /= "-f" .or. command_argument_count() /= 2) then
      write (error_unit, "(a)") "usage: unit_tests [-f part_of_a_name]"
      stop 1
    end if
    deallocate (filter)
    allocate (character(len=length) :: filter)
    call get_command_argument(2, filter)
  end subroutine pf_begin

  !> One test between the file's `@before` and `@after`; the latter runs also after a failure.
  subroutine pf_run(name, test, before, after)
    character(len=*), intent(in) :: name      !! suite.test
    procedure(test_body) :: test
    procedure(test_body), optional :: before, after
    if (index(name, filter) == 0) return
    tests = tests + 1
    failed = .false.
    test_name = name
    write (output_unit, "(a)", advance="no") "."
    flush (output_unit)
    if (present(before)) call before()
    if (.not. failed) then
      call test()
      if (present(after)) call after()
    end if
    if (failed) then
      failures = failures + 1
      write (output_unit, "(a)", advance="no") "F"
    end if
  end subroutine pf_run

  !> The report, and exit status 0 or 2. No test at all is a failure too.
  subroutine pf_finish()
    write (output_unit, "(a)") ""
    if (failures == 0 .and. tests > 0) then
      write (output_unit, "(a,/,a,i0,a)") " OK", " (", tests, merge(" test) ", " tests)", tests == 1)
      return
    end if
    write (output_unit, "(a)") report//" FAILURES!!!"
    write (output_unit, "(2(a,i0))") "Tests run: ", tests, ", Failures: ", failures
    flush (output_unit)
    stop 2
  end subroutine pf_finish

  !> Marks the present test as failed and notes where and why.
  subroutine pf_fail(file, line, what, message)
    character(len=*), intent(in) :: file, what
    integer, intent(in) :: line
    character(len=*), intent(in), optional :: message
    character(len=12) :: number
    character, parameter :: nl = new_line("a")
    write (number, "(i0)") line
    failed = .true.
    report = report//"Failure in: "//test_name//nl//"  Location: ["//file//":"//trim(number)//"]"//nl
    if (present(message)) report = report//"  "//message//nl
    if (what /= "") report = report//"  "//what//nl
  end subroutine pf_fail

  !> A failed comparison, reported at the first element that is wrong.
  subroutine pf_fail_pair(file, line, what, good, pairs, message)
    character(len=*), intent(in) :: file, what
    integer, intent(in) :: line
    logical, intent(in) :: good(:)            !! (n) in array element order
    character(len=*), intent(in) :: pairs(:)  !! (n) as from `pf_pair`
    character(len=*), intent(in), optional :: message
    character(len=12) :: number
    integer :: k
    k = findloc(good, .false., dim=1)
    write (number, "(i0)") k
    if (size(good) == 1) then
      call pf_fail(file, line, what//" failed: "//trim(pairs(k)), message)
    else
      call pf_fail(file, line, what//" failed at element "//trim(number)//": "//trim(pairs(k)), message)
    end if
  end subroutine pf_fail_pair

  !> Arrays of the same shape, or a scalar expected of every element.
  pure logical function pf_conform(expected, actual)
    integer, intent(in) :: expected(:), actual(:)  !! shapes
    pf_conform = size(expected) == 0
    if (size(expected) == size(actual)) pf_conform = all(expected == actual)
  end function pf_conform

  elemental logical function same_int32(expected, actual) result(same)
    integer(int32), intent(in) :: expected, actual
    same = expected == actual
  end function same_int32

  elemental logical function same_int32_int64(expected, actual) result(same)
    integer(int32), intent(in) :: expected
    integer(int64), intent(in) :: actual
    same = expected == actual
  end function same_int32_int64

  elemental logical function same_int64(expected, actual) result(same)
    integer(int64), intent(in) :: expected, actual
    same = expected == actual
  end function same_int64

  elemental logical function same_int32_real64(expected, actual) result(same)
    integer(int32), intent(in) :: expected
    real(real64), intent(in) :: actual
    same = expected == actual
  end function same_int32_real64

  elemental logical function same_real32_real64(expected, actual) result(same)
    real(real32), intent(in) :: expected
    real(real64), intent(in) :: actual
    same = expected == actual
  end function same_real32_real64

  !> Infinite values equal themselves; NaN equals nothing.
  elemental logical function same_real64(expected, actual) result(same)
    real(real64), intent(in) :: expected, actual
    same = expected == actual
  end function same_real64

  elemental logical function same_logical(expected, actual) result(same)
    logical, intent(in) :: expected, actual
    same = expected .eqv. actual
  end function same_logical

  !> Blanks at both ends do not count.
  elemental logical function same_text(expected, actual) result(same)
    character(len=*), intent(in) :: expected, actual
    same = adjustl(expected) == adjustl(actual)
  end function same_text

  !> Within an absolute tolerance.
  elemental logical function pf_close(expected, actual, tolerance)
    real(real64), intent(in) :: expected, actual, tolerance
    pf_close = expected == actual
    if (pf_close .or. ieee_is_nan(expected) .or. ieee_is_nan(actual)) return
    pf_close = abs(actual - expected) <= tolerance
  end function pf_close

  !> Within a tolerance relative to the expected value, which must not be 0.
  elemental logical function pf_relatively_close(expected, actual, tolerance)
    real(real64), intent(in) :: expected, actual, tolerance
    pf_relatively_close = .false.
    if (expected == 0.0_real64) return
    pf_relatively_close = pf_close(expected, actual, tolerance*abs(expected))
  end function pf_relatively_close

  pure real(real64) function width_real32(tolerance) result(width)
    real(real32), intent(in) :: tolerance
    width = real(tolerance, real64)
  end function width_real32

  pure real(real64) function width_real64(tolerance) result(width)
    real(real64), intent(in) :: tolerance
    width = tolerance
  end function width_real64

  pure logical function holds_scalar(condition) result(holds)
    logical, intent(in) :: condition
    holds = condition
  end function holds_scalar

  pure logical function holds_vector(condition) result(holds)
    logical, intent(in) :: condition(:)
    holds = all(condition)
  end function holds_vector

  elemental character(len=pair_length) function pair_int32(expected, actual) result(pair)
    integer(int32), intent(in) :: expected, actual
    write (pair, pair_format) expected, actual
  end function pair_int32

  elemental character(len=pair_length) function pair_int32_int64(expected, actual) result(pair)
    integer(int32), intent(in) :: expected
    integer(int64), intent(in) :: actual
    write (pair, pair_format) expected, actual
  end function pair_int32_int64

  elemental character(len=pair_length) function pair_int64(expected, actual) result(pair)
    integer(int64), intent(in) :: expected, actual
    write (pair, pair_format) expected, actual
  end function pair_int64

  elemental character(len=pair_length) function pair_int32_real64(expected, actual) result(pair)
    integer(int32), intent(in) :: expected
    real(real64), intent(in) :: actual
    write (pair, pair_format) expected, actual
  end function pair_int32_real64

  elemental character(len=pair_length) function pair_real32_real64(expected, actual) result(pair)
    real(real32), intent(in) :: expected
    real(real64), intent(in) :: actual
    write (pair, pair_format) expected, actual
  end function pair_real32_real64

  elemental character(len=pair_length) function pair_real64(expected, actual) result(pair)
    real(real64), intent(in) :: expected, actual
    write (pair, pair_format) expected, actual
  end function pair_real64

  elemental character(len=pair_length) function pair_logical(expected, actual) result(pair)
    logical, intent(in) :: expected, actual
    write (pair, pair_format) expected, actual
  end function pair_logical

  elemental character(len=pair_length) function pair_text(expected, actual) result(pair)
    character(len=*), intent(in) :: expected, actual
    character(len=50) :: shown(2)
    shown = [character(len=50) :: adjustl(expected), adjustl(actual)]
    write (pair, pair_format) trim(shown(1)), trim(shown(2))
  end function pair_text
end module funit
