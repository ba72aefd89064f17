!> Converts words of the input to values, and checks numbers, ranges, keywords and the number of
!> values.
module input_words
  use kinds, only: int64, real64
  use input_problems, only: most_problems, problem_list_t
  use input_text, only: assignment_t, content, token_t
  use input_groups, only: value_t, text_length
  use old_names, only: new_name
  use variables, only: allowed, largest, variable_t, smallest, table, words_of
  use texts, only: counted, did_you_mean, digits, lower_case, nearest_word, shown, written
  implicit none
  private
  public :: store_values, read_real

  integer, parameter :: most_values = 4000000
  character(len=7), parameter :: yes(*) = [character(len=7) :: ".true.", "true", ".t.", "t"]
  character(len=7), parameter :: no(*) = [character(len=7) :: ".false.", "false", ".f.", "f"]

contains

  !> Stores the values of an assignment in `slot`. If a value is invalid, a problem is reported and
  !> `slot` is marked as faulty, but keeps its previous value.
  subroutine store_values(slot, text, assignment, problems)
    type(value_t), intent(inout) :: slot
    character(len=*), intent(in) :: text                 !! text that contains the tokens
    type(assignment_t), intent(in) :: assignment
    type(problem_list_t), intent(inout) :: problems
    type(value_t) :: new
    character(len=:), allocatable :: problem
    integer(int64) :: total
    integer :: k, n

    slot%line = assignment%line
    slot%given = .true.
    slot%faulty = .true.
    if (.not. assignment%sound) return
    associate (tokens => assignment%tokens)
      total = sum(int(tokens%repeats, int64))
      problem = number_problem(slot, text, assignment, total)
      if (problem /= "") then
        call problems%add(assignment%line, assignment%where, problem)
        return
      end if
      new = slot
      new%faulty = .false.
      n = max(assignment%element - 1, 0)
      if (assignment%element == 0) then
        call new%clear()
        if (slot%kind == "real") allocate (new%reals(total))
        if (slot%kind /= "real") allocate (new%texts(total))
      end if
      do k = 1, size(tokens)
        call store_token(new, n, tokens(k), content(text, tokens(k)), assignment%line <= 0, problem)
        n = n + tokens(k)%repeats
        if (problem == "") cycle
        call problems%add(merge(tokens(k)%line, assignment%line, assignment%line > 0), assignment%where, problem)
        new%faulty = .true.
        if (problems%count == most_problems) exit
      end do
    end associate
    if (.not. new%faulty) slot = new
  end subroutine store_values

  !> Reason why an assignment contains the wrong number of values; empty if the number is correct.
  function number_problem(slot, text, assignment, total) result(problem)
    type(value_t), intent(in) :: slot
    character(len=*), intent(in) :: text
    type(assignment_t), intent(in) :: assignment
    integer(int64), intent(in) :: total                  !! number of values
    character(len=:), allocatable :: problem

    problem = ""
    associate (row => table(slot%row))
      if (assignment%element > 0) then
        if (.not. slot%is_set()) then
          problem = "has no value yet, so that no element can be set; give all: "//trim(row%name)//" = "//trim(row%value)
        else if (assignment%element > slot%length()) then
          problem = "has "//counted(int(slot%length(), int64), "value")//"; there is no element "//written(assignment%element)
        else if (total /= 1) then
          problem = counted(total, "value")//" for one element; allowed: "//allowed(row)
        end if
      else if (row%size > 0 .and. total /= row%size) then
        problem = counted(total, "value")//" instead of "//written(row%size)//"; allowed: "//allowed(row)
        if (slot%kind == "real" .and. size(assignment%tokens) == 2*row%size) &
          problem = problem//decimal_hint(text, assignment%tokens)
      else if (total > most_values) then
        problem = counted(total, "value")//"; allowed: up to "//written(most_values)
      end if
    end associate
  end function number_problem

  !> Hint for users who wrote a real number with a decimal comma, as in `0,9`.
  function decimal_hint(text, tokens) result(hint)
    character(len=*), intent(in) :: text
    type(token_t), intent(in) :: tokens(:)
    character(len=:), allocatable :: hint
    integer :: k

    hint = ""
    do k = 1, size(tokens), 2
      if (tokens(k + 1)%first /= tokens(k)%last + 2) return         ! not only a comma between the numbers
      if (verify(content(text, tokens(k + 1)), digits) > 0) return
    end do
    hint = "; "//did_you_mean(content(text, tokens(1))//"."//content(text, tokens(2)))//" the decimal sign is a point"
  end function decimal_hint

  !> Checks one word, and stores its value after the first n values.
  subroutine store_token(slot, n, token, word, is_bare, problem)
    type(value_t), intent(inout) :: slot
    integer, intent(in) :: n
    type(token_t), intent(in) :: token
    character(len=*), intent(in) :: word
    logical, intent(in) :: is_bare                       !! .true. in overrides, where strings need no quotes
    character(len=:), allocatable, intent(out) :: problem
    character(len=:), allocatable :: normal      ! value in a standard form: `.true.` for `T`, for example
    integer(int64) :: whole
    real(real64) :: number
    logical :: quoted

    quoted = scan(token%kind, "'""") > 0
    normal = word
    number = 0
    problem = ""
    associate (row => table(slot%row))
      select case (slot%kind)
      case ("integer")
        call read_integer(word, whole, problem)
        normal = written(whole)
        number = real(whole, real64)
      case ("real")
        call read_real(word, number, problem)
      case ("logical")
        normal = ".false."
        if (any(lower_case(word) == yes)) normal = ".true."
        if (all(lower_case(word) /= [yes, no])) problem = "is neither true nor false"
      case default
        problem = text_problem(row, word, is_bare .or. quoted)
      end select
      if (slot%kind /= "text") then
        if (problem == "" .and. (number < row%range%lower .or. number > row%range%upper)) problem = "is out of range"
        if (quoted) problem = "is in quotes"
        if (problem /= "") problem = shown(word)//" "//problem//"; allowed: "//allowed(row)
      end if
      if (problem /= "") return
      if (slot%kind == "real") then
        slot%reals(n + 1:n + token%repeats) = number
      else
        slot%texts(n + 1:n + token%repeats) = normal
      end if
    end associate
  end subroutine store_token

  !> Reason why a string is invalid: it is not quoted (except in overrides), too long, or not a
  !> keyword of the variable. The result is empty if the string is valid.
  function text_problem(row, word, quoted) result(problem)
    type(variable_t), intent(in) :: row
    character(len=*), intent(in) :: word
    logical, intent(in) :: quoted
    character(len=:), allocatable :: problem
    character(len=:), allocatable :: meant

    problem = ""
    if (.not. quoted) then
      problem = shown(word)//" is not in quotes; allowed: "//allowed(row)
    else if (len(word) > text_length) then
      problem = "the text has "//written(len(word))//" bytes; allowed: up to "//written(text_length)
    else if (row%choices /= "" .and. all(words_of(row%choices) /= word)) then
      meant = nearest_word(word, words_of(row%choices))
      if (meant /= "") meant = did_you_mean(""""//meant//"""")//" "
      problem = shown(word)//" is not allowed; "//meant//"allowed: "//allowed(row)
      meant = new_name(row%group, row%name, word)
      if (meant /= "") problem = "'"//word//"' is called '"//meant//"' now"
    end if
  end function text_problem

  !> True if a word consists of digits with an optional sign.
  pure function is_whole(word)
    character(len=*), intent(in) :: word
    logical :: is_whole
    integer :: first

    first = 1
    if (scan(word, "+-") == 1) first = 2
    is_whole = first <= len(word) .and. verify(word(first:), digits) == 0
  end function is_whole

  !> Reads a 64-bit integer.
  pure subroutine read_integer(word, value, problem)
    character(len=*), intent(in) :: word
    integer(int64), intent(out) :: value
    character(len=:), allocatable, intent(out) :: problem
    integer :: first, status

    value = 0
    problem = "is not an integer"
    if (.not. is_whole(word)) return
    problem = "is out of range"
    first = scan(word//"1", "123456789")
    if (len(word) - first > 18) return
    read (word, *, iostat=status) value
    if (status == 0) problem = ""
  end subroutine read_integer

  !> Reads a decimal number with an optional exponent e or d, as in Fortran. The absolute value must
  !> be 0 or between 1e-100 and 1e100, so that overflow and denormal numbers are impossible.
  pure subroutine read_real(word, value, problem)
    character(len=*), intent(in) :: word
    real(real64), intent(out) :: value
    character(len=:), allocatable, intent(out) :: problem
    integer, parameter :: longest = 60
    character(len=longest) :: mantissa      ! the word without its exponent, with 0 for the decimal point
    integer :: mark, exponent, status

    value = 0
    problem = "is not a number"
    if (len(word) > longest) problem = "is too long for a number"
    if (len(word) > longest .or. len(word) == 0) return
    mark = scan(lower_case(word)//"e", "ed")
    mantissa = word(:mark - 1)
    if (index(mantissa, ".") > 0) mantissa(index(mantissa, "."):index(mantissa, ".")) = "0"
    if (scan(word(:mark - 1), digits) == 0 .or. .not. is_whole(mantissa(:mark - 1))) return
    exponent = 0
    if (mark <= len(word)) then
      if (.not. is_whole(word(mark + 1:))) return
      exponent = huge(exponent)
      if (len(word) - mark <= 5) read (word(mark + 1:), *) exponent
    end if
    problem = ""
    if (scan(word(:mark - 1), "123456789") == 0) return
    if (abs(exponent) <= 200) then                 ! such exponents cannot overflow or underflow
      read (word, "(f60.0)", iostat=status) value
      if (status == 0 .and. abs(value) >= smallest .and. abs(value) <= largest) return
    end if
    value = 0
    problem = "is out of range (sizes from 1e-100 to 1e100)"
  end subroutine read_real

end module input_words
