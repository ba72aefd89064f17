!> Runs `.pf` tests where pFUnit is not installed, with the same rules of comparison, words and exit codes. `translate_pf.py`
!> converts each `@assert` to a call of a procedure of this module. Comparisons that pFUnit refuses do not compile here either:
!> comparisons exist only for combinations of types that pFUnit accepts.
module funit
  use, intrinsic :: iso_fortran_env, only: error_unit, int32, int64, output_unit, real64
  implicit none
  private
  public :: anyexceptions, pf_real, pf_begin, pf_run, pf_finish, pf_fail, pf_check
  public :: pf_conform, pf_unequal, pf_apart, pf_unordered, pf_holds

  integer, parameter :: pf_real = real64      !! kind in which numbers are compared
  integer, parameter :: pair_length = 132     !! enough for two numbers; longer texts are cut
  character(len=*), parameter :: pair_format = "(""expected <"",g0,""> actual <"",g0,"">"")"

  !> Returns the first difference between two values by the rules of `@assertEqual`, or '' if there is none.
  interface pf_unequal
    module procedure unequal_int32, unequal_int32_int64, unequal_int64, unequal_real64, unequal_logical, unequal_text
  end interface pf_unequal

  abstract interface
    !> Interface of a test or fixture.
    subroutine test_body()
    end subroutine test_body
  end interface

  !> Asserts a condition, which is a scalar or a vector.
  interface pf_holds
    module procedure holds_scalar, holds_vector
  end interface pf_holds

  logical :: failed = .false.                 !! the present test has failed
  integer :: tests = 0, failures = 0
  character(len=:), allocatable :: filter     !! only tests whose suite.name contains this text are run
  character(len=:), allocatable :: test_name, report

contains

  !> Returns whether the present test has failed. The translated code calls this function after each procedure with assertions.
  logical function anyexceptions()
    anyexceptions = failed
  end function anyexceptions

  !> Reads the command line. The only option `-f text` selects the tests whose names contain the text.
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

  !> Runs the `@before` procedure of the file, one test, and the `@after` procedure, which runs even after a failure.
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

  !> Prints a summary, and returns the exit status 0 or 2. A file without tests also counts as a failure.
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

  !> Marks the present test as failed, and stores the file, the line and the reason.
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

  !> Asserts a comparison of array elements. The assertion reports the first wrong element.
  subroutine pf_check(file, line, what, pairs, message)
    character(len=*), intent(in) :: file, what
    integer, intent(in) :: line
    character(len=*), intent(in) :: pairs(:)  !! (n) description of the failure of each element, in array element order
    character(len=*), intent(in), optional :: message
    character(len=12) :: number
    integer :: k
    k = findloc(pairs /= "", .true., dim=1)
    if (k == 0) return
    write (number, "(i0)") k
    call pf_fail(file, line, what//" failed at element "//trim(number)//": "//trim(pairs(k)), message)
  end subroutine pf_check

  !> Returns true if two arrays have the same shape, or if the expected value is a scalar.
  pure logical function pf_conform(expected, actual)
    integer, intent(in) :: expected(:), actual(:)  !! shapes
    pf_conform = size(expected) == 0
    if (size(expected) == size(actual)) pf_conform = all(expected == actual)
  end function pf_conform

  elemental character(len=pair_length) function unequal_int32(expected, actual) result(pair)
    integer(int32), intent(in) :: expected, actual
    pair = ""
    if (expected /= actual) write (pair, pair_format) expected, actual
  end function unequal_int32

  elemental character(len=pair_length) function unequal_int32_int64(expected, actual) result(pair)
    integer(int32), intent(in) :: expected
    integer(int64), intent(in) :: actual
    pair = ""
    if (expected /= actual) write (pair, pair_format) expected, actual
  end function unequal_int32_int64

  elemental character(len=pair_length) function unequal_int64(expected, actual) result(pair)
    integer(int64), intent(in) :: expected, actual
    pair = ""
    if (expected /= actual) write (pair, pair_format) expected, actual
  end function unequal_int64

  !> Compares two real numbers. Infinite values are equal to themselves, and NaN is not equal to any number.
  elemental character(len=pair_length) function unequal_real64(expected, actual) result(pair)
    real(real64), intent(in) :: expected, actual
    pair = pf_unordered(expected, actual, expected == actual)
  end function unequal_real64

  elemental character(len=pair_length) function unequal_logical(expected, actual) result(pair)
    logical, intent(in) :: expected, actual
    pair = ""
    if (expected .neqv. actual) write (pair, pair_format) expected, actual
  end function unequal_logical

  !> Compares two texts; blanks at both ends are ignored.
  elemental character(len=pair_length) function unequal_text(expected, actual) result(pair)
    character(len=*), intent(in) :: expected, actual
    character(len=50) :: shown(2)
    shown = [character(len=50) :: adjustl(expected), adjustl(actual)]
    pair = ""
    if (adjustl(expected) /= adjustl(actual)) write (pair, pair_format) trim(shown(1)), trim(shown(2))
  end function unequal_text

  !> Returns the first difference that exceeds an absolute tolerance.
  elemental character(len=pair_length) function pf_apart(expected, actual, tolerance) result(pair)
    real(real64), intent(in) :: expected, actual, tolerance
    pair = ""
    if (expected /= actual) pair = pf_unordered(expected, actual, abs(actual - expected) <= tolerance)
  end function pf_apart

  !> Returns the two numbers as text if they do not satisfy a relation, and '' otherwise.
  elemental character(len=pair_length) function pf_unordered(expected, actual, holds) result(pair)
    real(real64), intent(in) :: expected, actual
    logical, intent(in) :: holds
    pair = ""
    if (.not. holds) write (pair, pair_format) expected, actual
  end function pf_unordered

  pure logical function holds_scalar(condition) result(holds)
    logical, intent(in) :: condition
    holds = condition
  end function holds_scalar

  pure logical function holds_vector(condition) result(holds)
    logical, intent(in) :: condition(:)
    holds = all(condition)
  end function holds_vector
end module funit
