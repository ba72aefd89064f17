!> Cuts namelist text into statements. Fortran's own reader silently accepts nonsense, names neither
!> line nor variable, and can be crashed; so the text is read here, with a small strict grammar:
!>
!>     &group  name = value, value  name(2) = value  name = 3*value  /     ! comment
!>
!> Anything else in the text is a problem with a line number.
module namelist_scanner
  use input_problems, only: problem_list_t
  use texts, only: digits, letters, lower_case, shown
  implicit none
  private
  public :: scanner_t, statement_t, token_t, plain
  public :: group_start, setting

  integer, parameter :: nothing = 0, group_start = 1, setting = 2, end_of_text = 3
  integer, parameter :: most_repeats = 10000000

  character(len=*), parameter :: eol = new_line("a"), blanks = " "//achar(9)
  character(len=*), parameter :: word_characters = digits//".+-"//letters//"_*%#:$@?<>|[]{}~^`\"

  !> One value: `text(first:last)` of the scanner, without its quotes.
  type :: token_t
    integer :: first = 1, last = 0
    integer :: line = 0
    integer :: repeats = 1                       !! the 3 of 3*value
    character(len=1) :: quote = " "              !! ' or "; blank: none
  end type token_t

  type :: statement_t
    integer :: kind = nothing                    !! group_start, setting or end_of_text
    integer :: line = 0                          !! > 0: of the file; else no part of it, see `value_t`
    character(len=:), allocatable :: name        !! of the group or variable, in lower case
    character(len=:), allocatable :: where       !! group.variable, for messages
    integer :: first = 0                         !! its place in the text
    integer :: element = 0                       !! the 2 of name(2) = value; 0: none
    type(token_t), allocatable :: tokens(:)      !! values of a setting
    logical :: sound = .true.                    !! .false.: problems in it have been reported
  end type statement_t

  type :: scanner_t
    character(len=:), allocatable :: text        !! every line ends in a line feed
    integer :: at = 1                            !! the next character
    integer :: line = 1
    integer :: group_line = 0                    !! where the open group began
    integer :: closed = 0                        !! where the last group ended, that had an end: its /
    logical :: in_group = .false.
    logical :: quote_open = .false.              !! in this group: its / may be part of a text
    logical :: lost = .false.                    !! text was skipped that could not be understood
    character(len=:), allocatable :: group       !! name of the open group, for messages
  contains
    procedure :: next_statement
    procedure :: read_values
    procedure :: content
    procedure, private :: complain, skip_space, skip_line, rest_of_line, character_here, word_end
  end type scanner_t

contains

  !> The next statement; problems on the way are reported and skipped.
  subroutine next_statement(self, statement, problems)
    class(scanner_t), intent(inout) :: self
    type(statement_t), intent(out) :: statement
    type(problem_list_t), intent(inout) :: problems
    integer :: last

    do while (statement%kind == nothing)
      call self%skip_space()
      statement%line = self%line
      statement%first = self%at
      if (self%at > len(self%text)) then
        if (self%in_group) call report_open_group()
        statement%kind = end_of_text
      else if (.not. self%in_group) then
        call between_groups()
      else
        select case (self%character_here())
        case ("/")
          self%in_group = .false.
          self%closed = self%at
          self%at = self%at + 1
        case ("&")
          self%in_group = .false.
          last = self%word_end(self%at + 1)
          if (lower_case(self%text(self%at + 1:last)) == "end") then
            call problems%add(self%line, self%group, "a group ends with /, not with &end")
            self%at = last + 1
          else
            call report_open_group()
          end if
        case default
          call read_assignment()
        end select
      end if
    end do

  contains

    !> Reports that a group has no end, unless an open quote may have swallowed it.
    subroutine report_open_group()
      if (.not. self%quote_open) call problems%add(self%group_line, self%group, "the closing / is missing")
    end subroutine report_open_group

    !> Outside groups only `&name` is allowed; anything else is skipped up to a line that begins with &.
    subroutine between_groups()
      character(len=:), allocatable :: problem

      last = self%at
      problem = "text outside a group; a group is &name ... /, a comment begins with !"
      if (self%character_here() == "&") then
        last = self%word_end(self%at + 1)
        problem = "the name of a group follows directly after &, without quotes"
      end if
      if (last > self%at) then
        statement%kind = group_start
        statement%name = lower_case(self%text(self%at + 1:last))
        self%group = plain(statement%name)
        self%group_line = self%line
        self%in_group = .true.
        self%quote_open = .false.
        self%at = last + 1
        return
      end if
      call problems%add(self%line, shown(self%rest_of_line()), problem)
      self%lost = .true.
      do
        call self%skip_line()
        call self%skip_space()
        if (self%at > len(self%text) .or. self%character_here() == "&") return
      end do
    end subroutine between_groups

    !> Reads `name = values`.
    subroutine read_assignment()
      last = self%word_end(self%at)
      if (last < self%at) then
        call problems%add(self%line, self%group, "unexpected "//shown(self%rest_of_line()) &
          //"; a variable is set as name = value")
        self%lost = .true.
        call self%skip_line()
        return
      end if
      statement%name = lower_case(self%text(self%at:last))
      statement%where = self%group//"."//plain(statement%name)
      self%at = last + 1
      if (self%character_here() == "(") call read_element()
      call self%skip_space()
      if (.not. statement%sound) then
        call self%skip_line()
      else if (self%character_here() /= "=") then
        call problems%add(statement%line, statement%where, "= is missing after the name; a comment begins with !")
        self%lost = .true.
        if (self%line == statement%line) call self%skip_line()
      else
        self%at = self%at + 1
        call self%read_values(statement, problems)
        statement%kind = setting
      end if
    end subroutine read_assignment

    !> Reads the `(2)` of `name(2) = value`.
    subroutine read_element()
      integer :: length

      length = verify(self%text(self%at + 1:), digits) - 1
      last = self%at + length
      if (length >= 1 .and. length <= 8 .and. self%text(last + 1:last + 1) == ")") then
        read (self%text(self%at + 1:last), *) statement%element
        self%at = last + 2
      end if
      if (statement%element < 1) &
        call self%complain(statement, "brackets hold the number of one value, as in name(2) = value", problems)
    end subroutine read_element
  end subroutine next_statement

  !> Reports what is wrong with a statement.
  subroutine complain(self, statement, what, problems)
    class(scanner_t), intent(in) :: self
    type(statement_t), intent(inout) :: statement
    character(len=*), intent(in) :: what
    type(problem_list_t), intent(inout) :: problems

    call problems%add(merge(self%line, statement%line, statement%line > 0), statement%where, what)
    statement%sound = .false.
  end subroutine complain

  !> Reads the values after `=`, up to the next name, `/`, `&` or the end.
  subroutine read_values(self, statement, problems)
    class(scanner_t), intent(inout) :: self
    type(statement_t), intent(inout) :: statement
    type(problem_list_t), intent(inout) :: problems
    type(token_t), allocatable :: tokens(:)
    type(token_t) :: token
    character(len=1) :: c
    logical :: after_comma
    integer :: n

    n = 0
    allocate (tokens(4))
    after_comma = .true.
    do
      call self%skip_space()
      c = self%character_here()
      if (scan(c, "/&"//eol) > 0 .or. name_follows()) exit
      if (c == ",") then
        if (after_comma) call self%complain(statement, "a value is missing before the comma", problems)
        after_comma = .true.
        self%at = self%at + 1
        cycle
      end if
      token = token_t(line=self%line)
      if (scan(c, "'""") > 0) call read_quoted()
      if (scan(c, "'""") == 0) call read_bare()
      after_comma = .false.
      if (n == size(tokens)) tokens = [tokens, tokens]
      n = n + 1
      tokens(n) = token
    end do
    if (n == 0 .and. statement%sound) call self%complain(statement, "it has no value", problems)
    statement%tokens = tokens(:n)

  contains

    !> Whether `name =` or `name(...) =` begins here, and not a value.
    function name_follows()
      logical :: name_follows
      integer :: i

      name_follows = .false.
      i = self%word_end(self%at) + 1
      if (i == self%at) return
      if (self%text(i:i) == "(") i = i + scan(self%text(i:), ")"//eol)
      i = i + verify(self%text(i:), blanks//eol) - 1
      name_follows = self%text(i:i) == "="
    end function name_follows

    !> Reads text in quotes, within one line; a doubled quote stands for itself.
    subroutine read_quoted()
      token%quote = self%character_here()
      token%first = self%at + 1
      self%at = token%first
      do
        self%at = self%at + scan(self%text(self%at:), token%quote//eol)
        if (self%text(self%at - 1:self%at - 1) == eol) then
          call self%complain(statement, "the closing quote "//token%quote//" is missing", problems)
          self%line = self%line + 1
          self%quote_open = .true.
          self%lost = .true.
          return
        end if
        if (self%character_here() /= token%quote) exit
        self%at = self%at + 1
      end do
      token%last = self%at - 2
    end subroutine read_quoted

    !> Reads a number, `.true.` or a bare word, with its repeat count; after `3*` also text in quotes.
    subroutine read_bare()
      integer :: star, status

      token%first = self%at
      token%last = self%word_end(self%at)
      self%at = token%last + 1
      if (token%last < token%first) then
        self%at = self%at + scan(self%text(self%at:), word_characters//blanks//eol//"/,!") - 1
        call self%complain(statement, "unexpected "//shown(self%text(token%first:self%at - 1)), problems)
        return
      end if
      star = index(self%text(token%first:token%last), "*")
      if (star < 2) return
      associate (count => self%text(token%first:token%first + star - 2))
        if (verify(count, digits) > 0) return
        status = 1
        if (len(count) <= 8) read (count, *, iostat=status) token%repeats
      end associate
      if (status /= 0 .or. token%repeats < 1 .or. token%repeats > most_repeats) call self%complain(statement, &
        "the repeat count of "//shown(self%text(token%first:token%last))//" is out of range", problems)
      token%first = token%first + star
      if (token%first <= token%last) return
      if (scan(self%character_here(), "'""") > 0) then
        call read_quoted()
      else
        call self%complain(statement, "a value is missing after the *", problems)
      end if
    end subroutine read_bare
  end subroutine read_values

  !> The value that a token stands for: doubled quotes are single ones.
  pure function content(self, token) result(value)
    class(scanner_t), intent(in) :: self
    type(token_t), intent(in) :: token
    character(len=:), allocatable :: value
    integer :: i, n

    value = self%text(token%first:token%last)
    if (token%quote == " ") return
    n = 0
    i = 1
    do while (i <= len(value))
      n = n + 1
      value(n:n) = value(i:i)
      i = i + merge(2, 1, value(i:i) == token%quote)
    end do
    value = value(:n)
  end function content

  !> Skips blanks, line ends and comments.
  pure subroutine skip_space(self)
    class(scanner_t), intent(inout) :: self
    integer :: step

    do
      step = verify(self%text(self%at:), blanks)
      if (step == 0) then
        self%at = len(self%text) + 1
        return
      end if
      self%at = self%at + step - 1
      if (scan(self%text(self%at:self%at), eol//"!") == 0) return
      call self%skip_line()
    end do
  end subroutine skip_space

  !> Moves to the beginning of the next line.
  pure subroutine skip_line(self)
    class(scanner_t), intent(inout) :: self

    self%at = self%at + index(self%text(self%at:), eol)
    self%line = self%line + 1
  end subroutine skip_line

  !> From here to the end of the line.
  pure function rest_of_line(self) result(text)
    class(scanner_t), intent(in) :: self
    character(len=:), allocatable :: text

    text = self%text(self%at:self%at + index(self%text(self%at:), eol) - 2)
  end function rest_of_line

  !> The next character; a line feed beyond the end.
  pure function character_here(self) result(c)
    class(scanner_t), intent(in) :: self
    character(len=1) :: c

    c = eol
    if (self%at <= len(self%text)) c = self%text(self%at:self%at)
  end function character_here

  !> Last character of the word that begins at `first`; first - 1 if none does.
  pure function word_end(self, first) result(last)
    class(scanner_t), intent(in) :: self
    integer, intent(in) :: first
    integer :: last

    last = first + verify(self%text(first:), word_characters) - 2
  end function word_end

  !> A name as shown in a message: cut and quoted if it is long.
  pure function plain(name)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: plain

    plain = name
    if (len(name) > 30) plain = shown(name)
  end function plain

end module namelist_scanner
