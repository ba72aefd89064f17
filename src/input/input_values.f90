!> From the words of the input to checked values: strict numbers, choices, counts and ranges.
module input_values
  use kinds, only: int64, real64
  use input_problems, only: problem_list_t
  use namelist_scanner, only: scanner_t, token_t
  use parameter_values, only: parameter_value_t, text_length
  use parameters, only: allowed, largest, parameter_t, smallest
  use texts, only: lower_case, nearest_word, shown, written
  implicit none
  private
  public :: store_values, read_real

  integer, parameter :: most_values = 4000000
  character(len=*), parameter :: digits = "0123456789"

contains

  !> Stores the values of one assignment in `slot`; what cannot be stored is reported and leaves the
  !> slot faulty, with the value that it had.
  subroutine store_values(slot, row, scanner, tokens, element, line, bare, where, problems)
    type(parameter_value_t), intent(inout) :: slot
    type(parameter_t), intent(in) :: row
    type(scanner_t), intent(in) :: scanner
    type(token_t), intent(in) :: tokens(:)
    integer, intent(in) :: element                 !! i of name(i) = value; 0: all
    integer, intent(in) :: line                    !! of the name
    logical, intent(in) :: bare                    !! texts may come without quotes
    character(len=*), intent(in) :: where          !! group.variable
    type(problem_list_t), intent(inout) :: problems
    type(parameter_value_t) :: new
    character(len=:), allocatable :: problem
    integer :: k, n, total

    slot%line = line
    slot%given = .true.
    slot%faulty = .true.
    call check_shape(slot, row, tokens, element, problem)
    if (problem /= "") then
      call problems%add(line, where, problem)
      return
    end if
    new = slot
    new%faulty = .false.
    total = row%size
    if (row%size == 0) total = sum(tokens%repeats)
    if (element == 0) call make_room(new, row%kind, total)
    n = max(element - 1, 0)
    do k = 1, size(tokens)
      call store_token(new, n, row, tokens(k), scanner%content(tokens(k)), bare, problem)
      n = n + tokens(k)%repeats
      if (problem == "") cycle
      call problems%add(merge(tokens(k)%line, line, line > 0), where, problem)
      new%faulty = .true.
      if (problems%is_full()) exit
    end do
    if (.not. new%faulty) slot = new
  end subroutine store_values

  !> The number of values must be the number that the variable has.
  pure subroutine check_shape(slot, row, tokens, element, problem)
    type(parameter_value_t), intent(in) :: slot
    type(parameter_t), intent(in) :: row
    type(token_t), intent(in) :: tokens(:)
    integer, intent(in) :: element
    character(len=:), allocatable, intent(out) :: problem
    integer(int64) :: total

    problem = ""
    total = sum(int(tokens%repeats, int64))
    if (element > 0) then
      if (element > row%size .or. .not. slot%is_set()) then
        problem = "it is given as a whole: name = "//trim(row%value)
      else if (total /= 1) then
        problem = written(total)//" values for one element; allowed: "//allowed(row)
      end if
    else if (row%size > 0 .and. total /= row%size) then
      problem = written(total)//" values instead of "//written(row%size)//"; allowed: "//allowed(row)
      if (row%size == 1) problem = problem//", once"
    else if (total > most_values) then
      problem = written(total)//" values; allowed: up to "//written(most_values)
    end if
  end subroutine check_shape

  pure subroutine make_room(slot, kind, n)
    type(parameter_value_t), intent(inout) :: slot
    character(len=*), intent(in) :: kind
    integer, intent(in) :: n

    select case (kind)
    case ("integer")
      if (allocated(slot%integers)) deallocate (slot%integers)
      allocate (slot%integers(n))
    case ("real")
      if (allocated(slot%reals)) deallocate (slot%reals)
      allocate (slot%reals(n))
    case ("logical")
      if (allocated(slot%logicals)) deallocate (slot%logicals)
      allocate (slot%logicals(n))
    case default
      if (allocated(slot%texts)) deallocate (slot%texts)
      allocate (slot%texts(n))
    end select
  end subroutine make_room

  !> Reads one word and stores it after the first n values.
  pure subroutine store_token(slot, n, row, token, word, bare, problem)
    type(parameter_value_t), intent(inout) :: slot
    integer, intent(in) :: n
    type(parameter_t), intent(in) :: row
    type(token_t), intent(in) :: token
    character(len=*), intent(in) :: word
    logical, intent(in) :: bare
    character(len=:), allocatable, intent(out) :: problem
    integer(int64) :: whole
    real(real64) :: number
    logical :: truth

    if (token%quote /= " " .and. row%kind /= "text") then
      problem = shown(word)//" stands in quotes; allowed: "//allowed(row)
      return
    end if
    associate (last => n + token%repeats)
      select case (row%kind)
      case ("integer")
        call read_integer(word, whole, problem)
        if (problem == "") call check_range(real(whole, real64), row, word, problem)
        if (problem == "") slot%integers(n + 1:last) = whole
      case ("real")
        call read_real(word, number, problem)
        if (problem == "") call check_range(number, row, word, problem)
        if (problem == "") slot%reals(n + 1:last) = number
      case ("logical")
        call read_logical(word, truth, problem)
        if (problem == "") slot%logicals(n + 1:last) = truth
      case default
        call check_text(word, row, bare .or. token%quote /= " ", problem)
        if (problem == "") slot%texts(n + 1:last) = word
        return
      end select
    end associate
    if (problem /= "") problem = shown(word)//" "//problem//"; allowed: "//allowed(row)
  end subroutine store_token

  pure subroutine check_range(number, row, word, problem)
    real(real64), intent(in) :: number
    type(parameter_t), intent(in) :: row
    character(len=*), intent(in) :: word
    character(len=:), allocatable, intent(out) :: problem

    problem = ""
    if (number < row%range%lower .or. number > row%range%upper) problem = "is out of range"
  end subroutine check_range

  pure subroutine check_text(word, row, quoted, problem)
    character(len=*), intent(in) :: word
    type(parameter_t), intent(in) :: row
    logical, intent(in) :: quoted
    character(len=:), allocatable, intent(out) :: problem
    character(len=:), allocatable :: meant

    problem = ""
    if (.not. quoted) then
      problem = shown(word)//" is not in quotes; allowed: "//allowed(row)
    else if (len(word) > text_length) then
      problem = "the text has "//written(len(word))//" bytes; allowed: up to "//written(text_length)
    else if (row%choices /= "" .and. all(words_of(row%choices) /= word)) then
      meant = nearest_word(word, words_of(row%choices))
      if (meant /= "") meant = "did you mean """//meant//"""? "
      problem = shown(word)//" is no choice; "//meant//"allowed: "//allowed(row)
    end if
  end subroutine check_text

  pure function words_of(line) result(words)
    character(len=*), intent(in) :: line
    character(len=len(line)), allocatable :: words(:)
    integer :: i, n

    n = count([(line(i:i) /= " " .and. line(i + 1:i + 1) == " ", i=1, len(line) - 1)])
    allocate (words(n))
    read (line, *) words
  end function words_of

  !> Digits with an optional sign, within 64 bits.
  pure subroutine read_integer(word, value, problem)
    character(len=*), intent(in) :: word
    integer(int64), intent(out) :: value
    character(len=:), allocatable, intent(out) :: problem
    integer :: first, status

    value = 0
    problem = ""
    first = 1
    if (scan(word(:min(1, len(word))), "+-") == 1) first = 2
    if (first > len(word) .or. verify(word(first:), digits) > 0) then
      problem = "is not an integer"
      return
    end if
    first = first + verify(word(first:)//"x", "0") - 1
    if (len(word) - first < 19) then
      read (word, *, iostat=status) value
      if (status == 0) return
    end if
    problem = "is out of range"
  end subroutine read_integer

  !> A decimal number, as in Fortran with an optional exponent e or d; zero or of a sane size, so
  !> that neither overflow nor denormal numbers can arise.
  pure subroutine read_real(word, value, problem)
    character(len=*), intent(in) :: word
    real(real64), intent(out) :: value
    character(len=:), allocatable, intent(out) :: problem
    integer, parameter :: longest = 60
    integer :: exponent, status
    logical :: is_zero

    value = 0
    problem = "is not a number"
    if (len(word) > longest) problem = "is too long for a number"
    if (len(word) > longest .or. len(word) == 0) return
    call dissect(word, is_zero, exponent, status)
    if (status /= 0) return
    problem = ""
    if (is_zero) return
    if (abs(exponent) <= 101) then
      read (word, "(f60.0)", iostat=status) value
      if (status == 0 .and. abs(value) >= smallest .and. abs(value) <= largest) return
    end if
    value = 0
    problem = "is out of range (sizes from 1e-100 to 1e100)"
  end subroutine read_real

  !> Checks the syntax of a number and gives the power of ten of its first digit that is not 0.
  pure subroutine dissect(word, is_zero, exponent, status)
    character(len=*), intent(in) :: word
    logical, intent(out) :: is_zero
    integer, intent(out) :: exponent
    integer, intent(out) :: status                 !! 0: it is a number
    integer :: first, last, point, leading, power

    status = 1
    is_zero = .true.
    exponent = 0
    first = 1
    if (scan(word(1:1), "+-") == 1) first = 2
    last = scan(lower_case(word), "ed") - 1
    if (last < 0) last = len(word)
    point = index(word(:last), ".")
    if (verify(word(first:last), digits//".") > 0) return
    if (scan(word(first:last), digits) == 0) return
    if (index(word(:last), ".", back=.true.) /= point) return
    if (point == 0) point = last + 1
    power = 0
    if (last < len(word)) call read_exponent(word(last + 2:), power, status)
    if (last < len(word) .and. status /= 0) return
    status = 0
    leading = first - 1 + scan(word(first:last), "123456789")
    is_zero = leading == first - 1
    exponent = power + point - leading - merge(1, 0, leading < point)
  end subroutine dissect

  pure subroutine read_exponent(word, power, status)
    character(len=*), intent(in) :: word
    integer, intent(out) :: power
    integer, intent(out) :: status
    integer :: first

    power = 0
    status = 1
    first = 1
    if (scan(word(:min(1, len(word))), "+-") == 1) first = 2
    if (first > len(word) .or. verify(word(first:), digits) > 0) return
    status = 0
    power = 1000
    if (len(word) - first < 4) read (word, *) power
    if (len(word) - first >= 4 .and. word(1:1) == "-") power = -power
  end subroutine read_exponent

  pure subroutine read_logical(word, value, problem)
    character(len=*), intent(in) :: word
    logical, intent(out) :: value
    character(len=:), allocatable, intent(out) :: problem

    problem = ""
    value = .false.
    select case (lower_case(word))
    case (".true.", "true", ".t.", "t")
      value = .true.
    case (".false.", "false", ".f.", "f")
    case default
      problem = "is neither true nor false"
    end select
  end subroutine read_logical

end module input_values
