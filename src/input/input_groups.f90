!> Values of all input variables as used in the run, ordered by group and name. All of them are
!> stored in the output file; the module `settings` contains the same values as typed data.
module input_groups
  use kinds, only: int64, real64
  use input_problems, only: problem_list_t
  use variables, only: allowed, either, excludes, is_repeated, name_length, table, words_of
  use texts, only: growing_text_t, written, written_exactly
  implicit none
  private
  public :: value_t, group_t, text_length, range_of, json_text, same_value, same_values

  integer, parameter :: text_length = 512      !! maximum length of a string [bytes]
  !> Maximum number of values written in an assignment; longer lists are truncated.
  integer, parameter, public :: most_written = 100

  !> Value of one variable: an array `reals` for real variables, `texts` for all others. Integers
  !> are stored as decimal digits, which can represent every 64-bit integer. Logicals are stored as
  !> `.true.` or `.false.`. For a variable without a value, neither array is allocated.
  type :: value_t
    integer :: row = 0                         !! row of the variable in the table of variables
    character(len=name_length) :: name = ""
    character(len=8) :: kind = ""              !! type of the values: 'integer', 'real', 'logical' or 'text'
    logical :: given = .false.                 !! .true. if the user has set the variable
    !> .true. if the user has set an invalid value, which has been reported.
    logical :: faulty = .false.
    !> Line number of the assignment in the input file, or -k for override number k.
    integer :: line = 0
    !> Bit mask: bit i is set if element i was assigned by name(i) = value.
    integer :: elements = 0
    real(real64), allocatable :: reals(:)
    character(len=text_length), allocatable :: texts(:)
  contains
    procedure :: is_set
    procedure :: length
    procedure :: integers
    procedure :: clear
    procedure :: json
  end type value_t

  !> One group of the input. A repeated group is stored once per instance. Functions that return the
  !> value of a variable return `otherwise` if the variable has no value.
  type :: group_t
    character(len=8) :: name = ""
    !> Name of an instance of a repeated group; otherwise blank.
    character(len=text_length) :: instance = ""
    integer :: number = 0      !! number of this instance among the groups of the same name, starting at 1
    !> Line number of the start of the group; 0 if the input file does not contain the group.
    integer :: line = 0
    !> Positions of the characters & and / at the start and the end of the group.
    integer :: first = 0, last = 0
    type(value_t), allocatable :: values(:)
  contains
    procedure :: integer_of, real_of, reals_of, text_of
    procedure :: given, faulty
    procedure :: put_text, put_reals
    procedure :: name_instance
    procedure :: complain, demand
    procedure :: infer_choices, check_choices
    procedure :: value_line
  end type group_t

contains

  !> Index of a variable within `values`.
  pure function slot_of(self, name) result(k)
    class(group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    integer :: k

    do k = 1, size(self%values)
      if (self%values(k)%name == name) return
    end do
    k = 0
  end function slot_of

  !> True if the variable has a value.
  pure function is_set(self)
    class(value_t), intent(in) :: self
    logical :: is_set

    is_set = allocated(self%reals) .or. allocated(self%texts)
  end function is_set

  !> Number of values; 0 if the variable has no value.
  pure function length(self)
    class(value_t), intent(in) :: self
    integer :: length

    length = 0
    if (allocated(self%reals)) length = size(self%reals)
    if (allocated(self%texts)) length = size(self%texts)
  end function length

  !> Values of an integer variable.
  pure function integers(self) result(numbers)
    class(value_t), intent(in) :: self
    integer(int64), allocatable :: numbers(:)

    if (.not. allocated(self%texts)) then
      allocate (numbers(0))
    else
      allocate (numbers(size(self%texts)))
      read (self%texts, *) numbers
    end if
  end function integers

  !> True if all variables have the same values in two inputs. Unset variables are compared by their
  !> defaults.
  pure function same_values(one, other) result(yes)
    type(group_t), intent(in) :: one(:), other(:)  !! groups of the two inputs, in the same order
    logical :: yes
    integer :: g, k

    yes = size(one) == size(other)
    do g = 1, merge(size(one), 0, yes)
      do k = 1, size(one(g)%values)
        yes = yes .and. same_value(one(g)%values(k), other(g)%values(k))
      end do
    end do
  end function same_values

  !> True if two values of a variable are equal.
  pure function same_value(one, other) result(yes)
    type(value_t), intent(in) :: one, other
    logical :: yes

    yes = (allocated(one%reals) .eqv. allocated(other%reals)) .and. (allocated(one%texts) .eqv. allocated(other%texts))
    if (yes .and. allocated(one%reals)) then
      yes = size(one%reals) == size(other%reals)
      if (yes) yes = all(.not. abs(one%reals - other%reals) > 0)
    else if (yes .and. allocated(one%texts)) then
      yes = size(one%texts) == size(other%texts)
      if (yes) yes = all(one%texts == other%texts)
    end if
  end function same_value

  !> Removes the value of a variable.
  pure subroutine clear(self)
    class(value_t), intent(inout) :: self

    if (allocated(self%reals)) deallocate (self%reals)
    if (allocated(self%texts)) deallocate (self%texts)
  end subroutine clear

  !> First value of an integer variable.
  pure function integer_of(self, name, otherwise) result(number)
    class(group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(in) :: otherwise
    integer(int64) :: number

    number = otherwise
    associate (slot => self%values(slot_of(self, name)))
      if (slot%is_set()) read (slot%texts(1), *) number
    end associate
  end function integer_of

  !> Values of a real variable; empty if the variable has no value.
  pure function reals_of(self, name) result(numbers)
    class(group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    real(real64), allocatable :: numbers(:)

    associate (slot => self%values(slot_of(self, name)))
      if (allocated(slot%reals)) then
        numbers = slot%reals
      else
        allocate (numbers(0))
      end if
    end associate
  end function reals_of

  !> First value of a real or integer variable.
  pure function real_of(self, name, otherwise) result(number)
    class(group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: otherwise
    real(real64) :: number

    number = otherwise
    associate (slot => self%values(slot_of(self, name)))
      if (allocated(slot%reals)) then
        number = slot%reals(1)
      else if (slot%is_set()) then
        read (slot%texts(1), *) number
      end if
    end associate
  end function real_of

  !> First value of a variable that is not real; an empty string if the variable has no value.
  pure function text_of(self, name) result(text)
    class(group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: text

    text = ""
    associate (slot => self%values(slot_of(self, name)))
      if (allocated(slot%texts)) text = trim(slot%texts(1))
    end associate
  end function text_of

  !> True if the user has set the variable.
  pure function given(self, name)
    class(group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    logical :: given

    given = self%values(slot_of(self, name))%given
  end function given

  !> True if the user has set the variable to an invalid value. The problem has then been reported.
  pure function faulty(self, name)
    class(group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    logical :: faulty

    faulty = self%values(slot_of(self, name))%faulty
  end function faulty

  !> Assigns a default name to an obstacle, species or source without a name. The default name of a
  !> change is its number.
  pure subroutine name_instance(self)
    class(group_t), intent(inout) :: self

    if (.not. is_repeated(self%name)) return
    if (self%text_of("name") == "" .and. self%name == "change") call self%put_text("name", written(self%number))
    if (self%text_of("name") == "") call self%put_text("name", trim(self%name)//written(self%number))
    self%instance = self%text_of("name")
  end subroutine name_instance

  !> Stores a derived string as the value of a variable.
  pure subroutine put_text(self, name, text)
    class(group_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    character(len=*), intent(in) :: text

    associate (slot => self%values(slot_of(self, name)))
      call slot%clear()
      allocate (slot%texts(1))
      slot%texts(1) = text
    end associate
  end subroutine put_text

  !> Stores derived real numbers as the values of a variable.
  pure subroutine put_reals(self, name, numbers)
    class(group_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: numbers(:)

    self%values(slot_of(self, name))%reals = numbers
  end subroutine put_reals

  !> Reports a problem with a variable. The message cites the line of the assignment or, without an
  !> assignment, the first line of the group.
  pure subroutine complain(self, name, what, problems)
    class(group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    character(len=*), intent(in) :: what       !! the problem, and the allowed values
    type(problem_list_t), intent(inout) :: problems

    associate (line => self%values(slot_of(self, name))%line)
      call problems%add(merge(self%line, line, line == 0), trim(self%name)//"."//name, what)
    end associate
  end subroutine complain

  !> Reports that a required variable is missing.
  pure subroutine demand(self, name, problems)
    class(group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    type(problem_list_t), intent(inout) :: problems

    associate (slot => self%values(slot_of(self, name)))
      if (.not. slot%given) call self%complain(name, "is missing; give "//allowed(table(slot%row)), problems)
    end associate
  end subroutine demand

  !> Infers choices, such as `placement = 'grid'`, from the other variables. A choice is implied if
  !> a variable is set that has an effect only with this choice, such as `grid`. If several
  !> variables imply different choices, the last variable in the table takes precedence.
  pure subroutine infer_choices(self)
    class(group_t), intent(inout) :: self
    character(len=len(table%goes_with)), allocatable :: words(:)   ! variable name and values of a condition
    integer :: k

    do k = 1, size(self%values)
      words = words_of(table(self%values(k)%row)%goes_with)
      if (size(words) == 0 .or. .not. self%values(k)%given) cycle
      if (.not. self%given(words(1))) call self%put_text(words(1), words(2))
    end do
  end subroutine infer_choices

  !> Checks the variables whose effect depends on choices. A variable required by a choice must be
  !> set. The value of a variable without effect is removed. If the user has set such a variable, an
  !> error is reported, because no part of an input may be ignored silently. Variables that exclude
  !> each other are also reported.
  pure subroutine check_choices(self, problems)
    class(group_t), intent(inout) :: self
    type(problem_list_t), intent(inout) :: problems
    character(len=len(table%goes_with)), allocatable :: words(:)   ! variable name and values of a condition
    character(len=len(table%goes_with)) :: word
    integer :: j, k

    do k = 1, size(self%values)
      associate (slot => self%values(k), row => table(self%values(k)%row))
        words = words_of(row%goes_with)
        if (size(words) > 0) then
          word = self%text_of(words(1))
          if (.not. any(words(2:) == word)) then
            call slot%clear()
            if (slot%given .and. word /= "" .and. .not. self%faulty(words(1))) call self%complain(trim(slot%name), &
              "has no effect with "//trim(words(1))//" = '"//trim(word)//"'; it applies with "//either(words(2:)), problems)
            cycle
          else if (row%status == "required" .and. .not. slot%given) then
            call demand_one(self, k, trim(words(1)), trim(word), problems)
          end if
        end if
        if (.not. slot%given) cycle
        do j = 1, size(self%values)
          if (self%values(j)%given .and. excludes(slot%row, self%values(j)%row)) call self%complain(trim(slot%name), &
            "cannot be given together with "//trim(self%values(j)%name)//"; give only one of them", problems)
        end do
      end associate
    end do
  end subroutine check_choices

  !> Reports an unset variable that is required by a choice. If the choice requires one of two
  !> variables that exclude each other, for example drive.temperature or drive.velocity, the problem
  !> is reported only once.
  pure subroutine demand_one(self, k, choice, word, problems)
    class(group_t), intent(in) :: self
    integer, intent(in) :: k                           !! index of the variable in `self%values`
    character(len=*), intent(in) :: choice, word  !! name and value of the variable that represents the choice
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: needed
    integer :: j

    needed = trim(self%name)//"."//trim(self%values(k)%name)
    do j = 1, size(self%values)
      associate (other => self%values(j), row => self%values(k)%row)
        if (.not. (excludes(row, other%row) .or. excludes(other%row, row))) cycle
        if (.not. any(words_of(table(other%row)%goes_with) == word)) cycle
        if (other%given .or. j < k) return
        needed = needed//" or "//trim(self%name)//"."//trim(other%name)
      end associate
    end do
    call self%complain(choice, "'"//word//"' needs "//needed, problems)
  end subroutine demand_one

  !> Indices of the first and the last group with one of the given names. If there is no such group,
  !> the last index is smaller than the first.
  pure function range_of(groups, names) result(range)
    type(group_t), intent(in) :: groups(:)   !! groups, in the order of the table
    character(len=*), intent(in) :: names(:)           !! group names that are adjacent in the table
    integer :: range(2), k
    logical :: named(size(groups))

    named = [(any(names == groups(k)%name), k=1, size(groups))]
    range(1) = max(findloc(named, .true., dim=1), 1)
    range(2) = range(1) + count(named) - 1
  end function range_of

  !> Assignment of a value to a variable, such as `species.bed.radius = 0.005`.
  pure function value_line(self, k, most) result(text)
    class(group_t), intent(in) :: self
    integer, intent(in) :: k                   !! index of the variable in the group
    integer, intent(in), optional :: most      !! maximum number of values; a longer list is truncated
    character(len=:), allocatable :: text
    integer :: longest

    longest = most_written
    if (present(most)) longest = most
    text = trim(self%name)//"."
    if (self%instance /= "") text = text//trim(self%instance)//"."
    text = text//trim(self%values(k)%name)//" = "//self%values(k)%json(longest)
  end function value_line

  !> Converts the value or values of a variable to JSON. A list of more than `most` values is
  !> truncated.
  pure function json(self, most) result(text)
    class(value_t), intent(in) :: self
    integer, intent(in), optional :: most
    character(len=:), allocatable :: text
    type(growing_text_t) :: growing
    integer :: k, n, last

    n = self%length()
    last = n
    if (present(most)) last = min(n, most)
    do k = 1, last
      if (k > 1) call growing%add(", ")
      select case (self%kind)
      case ("real")
        call growing%add(written_exactly(self%reals(k)))
      case ("integer")
        call growing%add(trim(self%texts(k)))
      case ("logical")
        call growing%add(trim(merge("true ", "false", self%texts(k) == ".true.")))
      case default
        call growing%add(json_text(self%texts(k)))
      end select
    end do
    if (last < n) call growing%add(", ... "//written(n)//" values")
    text = growing%text()
    if (table(self%row)%size /= 1 .or. n > 1) text = "["//text//"]"
  end function json

  !> Converts a string to JSON, without its trailing blanks.
  pure function json_text(text) result(quoted)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: quoted
    character(len=2) :: code
    integer :: i

    quoted = """"
    do i = 1, len_trim(text)
      if (iachar(text(i:i)) < 32) then
        write (code, "(z2.2)") iachar(text(i:i))
        quoted = quoted//"\u00"//code
      else
        if (scan(text(i:i), """\") > 0) quoted = quoted//"\"
        quoted = quoted//text(i:i)
      end if
    end do
    quoted = quoted//""""
  end function json_text

end module input_groups
