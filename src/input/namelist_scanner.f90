!> Cuts namelist text into statements. Fortran's own reader accepts nonsense silently, names neither
!> line nor variable, and can be crashed; so the text is read here, by a small strict grammar:
!>
!>     &group  name = value, value  name(2) = value  name = 3*value  /     ! comment
!>
!> Whatever else stands in the text is a problem with a line number.
module namelist_scanner
  use input_problems, only: problem_list_t
  use texts, only: lower_case, shown
  implicit none
  private
  public :: scanner_t, statement_t, token_t
  public :: group_start, setting

  integer, parameter :: nothing = 0, group_start = 1, setting = 2, end_of_text = 3
  integer, parameter :: most_repeats = 10000000

  character(len=*), parameter :: eol = new_line("a"), blanks = " "//achar(9)
  character(len=*), parameter :: digits = "0123456789"
  character(len=*), parameter :: letters = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
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
    integer :: line = 0
    character(len=:), allocatable :: name        !! of the group or variable, in lower case
    integer :: element = 0                       !! the 2 of name(2) = value; 0: none
    type(token_t), allocatable :: tokens(:)      !! values of a setting
    logical :: sound = .true.                    !! .false.: problems in it have been reported
  end type statement_t

  type :: scanner_t
    character(len=:), allocatable :: text        !! lines that all end in a line feed
    integer :: at = 1                            !! the next character
    integer :: line = 1
    integer :: group_line = 0                    !! where the open group began
    logical :: in_group = .false.
    logical :: quote_open = .false.              !! in this group: its / may be part of a text
    logical :: lost = .false.                    !! some of the text made no sense and was skipped
    character(len=:), allocatable :: group       !! name of the open group
  contains
    procedure :: next_statement
    procedure :: read_values
    procedure :: content
    procedure, private :: between_groups, inside_group, report_open_group
    procedure, private :: read_assignment, read_element
    procedure, private :: read_quoted, read_bare, skip_space, skip_line, word_end, name_follows
  end type scanner_t

contains

  !> The next statement; problems on the way are reported and skipped.
  subroutine next_statement(self, statement, problems)
    class(scanner_t), intent(inout) :: self
    type(statement_t), intent(out) :: statement
    type(problem_list_t), intent(inout) :: problems

    do while (statement%kind == nothing)
      call self%skip_space()
      statement%line = self%line
      if (self%at > len(self%text)) then
        if (self%in_group) call self%report_open_group(problems)
        statement%kind = end_of_text
      else if (self%in_group) then
        call self%inside_group(statement, problems)
      else
        call self%between_groups(statement, problems)
      end if
    end do
  end subroutine next_statement

  !> Outside groups only `&name` may stand; anything else is skipped up to a line that begins so.
  subroutine between_groups(self, statement, problems)
    class(scanner_t), intent(inout) :: self
    type(statement_t), intent(inout) :: statement
    type(problem_list_t), intent(inout) :: problems
    integer :: last

    if (self%text(self%at:self%at) == "&") then
      last = self%word_end(self%at + 1)
      self%group = lower_case(self%text(self%at + 1:last))
      self%group_line = self%line
      self%in_group = .true.
      self%quote_open = .false.
      self%at = last + 1
      statement%kind = group_start
      statement%name = self%group
      return
    end if
    last = self%at + index(self%text(self%at:), eol) - 2
    call problems%add(self%line, shown(self%text(self%at:last)), &
      "text outside a group; a group is &name ... /, a comment begins with !")
    self%lost = .true.
    do
      call self%skip_line()
      call self%skip_space()
      if (self%at > len(self%text)) return
      if (self%text(self%at:self%at) == "&") return
    end do
  end subroutine between_groups

  subroutine inside_group(self, statement, problems)
    class(scanner_t), intent(inout) :: self
    type(statement_t), intent(inout) :: statement
    type(problem_list_t), intent(inout) :: problems
    integer :: last

    select case (self%text(self%at:self%at))
    case ("/")
      self%in_group = .false.
      self%at = self%at + 1
    case ("&")
      self%in_group = .false.
      last = self%word_end(self%at + 1)
      if (lower_case(self%text(self%at + 1:last)) == "end") then
        call problems%add(self%line, self%group, "a group ends with /, not with &end")
        self%at = last + 1
      else
        call self%report_open_group(problems)
      end if
    case default
      call self%read_assignment(statement, problems)
    end select
  end subroutine inside_group

  subroutine report_open_group(self, problems)
    class(scanner_t), intent(in) :: self
    type(problem_list_t), intent(inout) :: problems

    if (self%quote_open) return
    call problems%add(self%group_line, self%group, "the closing / is missing")
  end subroutine report_open_group

  subroutine read_assignment(self, statement, problems)
    class(scanner_t), intent(inout) :: self
    type(statement_t), intent(inout) :: statement
    type(problem_list_t), intent(inout) :: problems
    integer :: last, past

    last = self%word_end(self%at)
    if (last < self%at) then
      past = self%at + index(self%text(self%at:), eol) - 1
      call problems%add(self%line, self%group, "unexpected "//shown(self%text(self%at:past - 1)) &
        //"; a variable is name = value")
      self%lost = .true.
      call self%skip_line()
      return
    end if
    statement%name = lower_case(self%text(self%at:last))
    self%at = last + 1
    call self%read_element(statement, problems)
    call self%skip_space()
    if (.not. statement%sound) then
      call self%skip_line()
    else if (character_at(self%text, self%at) /= "=") then
      call problems%add(statement%line, self%group//"."//plain(statement%name), &
        "= is missing after the name; a comment begins with !")
      self%lost = .true.
      if (self%line == statement%line) call self%skip_line()
    else
      self%at = self%at + 1
      allocate (statement%tokens(0))
      call self%read_values(statement%tokens, statement%sound, self%group//"."//plain(statement%name), problems)
      statement%kind = setting
    end if
  end subroutine read_assignment

  !> The `(2)` of `name(2) = value`, if it is there.
  subroutine read_element(self, statement, problems)
    class(scanner_t), intent(inout) :: self
    type(statement_t), intent(inout) :: statement
    type(problem_list_t), intent(inout) :: problems
    integer :: last, length

    if (character_at(self%text, self%at) /= "(") return
    length = verify(self%text(self%at + 1:), digits) - 1
    last = self%at + length
    if (length >= 1 .and. length <= 8 .and. self%text(last + 1:last + 1) == ")") then
      read (self%text(self%at + 1:last), *) statement%element
      self%at = last + 2
    end if
    if (statement%element > 0) return
    call problems%add(statement%line, self%group//"."//plain(statement%name), &
      "in brackets stands the number of one value: name(2) = value")
    statement%sound = .false.
  end subroutine read_element

  !> The values after `=`, up to the next name, `/`, `&` or the end.
  subroutine read_values(self, tokens, sound, where, problems)
    class(scanner_t), intent(inout) :: self
    type(token_t), allocatable, intent(inout) :: tokens(:)
    logical, intent(out) :: sound                    !! .false.: a problem has been reported
    character(len=*), intent(in) :: where            !! group.variable
    type(problem_list_t), intent(inout) :: problems
    type(token_t), allocatable :: longer(:)
    type(token_t) :: token
    character(len=1) :: c
    logical :: after_comma
    integer :: n

    n = 0
    sound = .true.
    after_comma = .true.
    do
      call self%skip_space()
      c = character_at(self%text, self%at)
      if (scan(c, "/&"//eol) > 0 .or. self%name_follows()) exit
      if (c == ",") then
        if (after_comma) call complain("a value is missing before the comma")
        after_comma = .true.
        self%at = self%at + 1
        cycle
      end if
      token = token_t(line=self%line)
      if (scan(c, "'""") > 0) then
        call self%read_quoted(token, sound, where, problems)
      else
        call self%read_bare(token, sound, where, problems)
      end if
      after_comma = .false.
      if (n == size(tokens)) then
        allocate (longer(2*n + 4))
        longer(:n) = tokens
        call move_alloc(longer, tokens)
      end if
      n = n + 1
      tokens(n) = token
    end do
    if (n == 0) call complain("it has no value")
    tokens = tokens(:n)
  contains
    subroutine complain(what)
      character(len=*), intent(in) :: what

      if (sound) call problems%add(self%line, where, what)
      sound = .false.
    end subroutine complain
  end subroutine read_values

  !> Text in quotes, within one line; a doubled quote stands for itself.
  subroutine read_quoted(self, token, sound, where, problems)
    class(scanner_t), intent(inout) :: self
    type(token_t), intent(inout) :: token
    logical, intent(inout) :: sound
    character(len=*), intent(in) :: where
    type(problem_list_t), intent(inout) :: problems
    integer :: step

    token%quote = self%text(self%at:self%at)
    token%first = self%at + 1
    self%at = token%first
    do
      step = scan(self%text(self%at:), token%quote//eol)
      self%at = self%at + step
      if (self%text(self%at - 1:self%at - 1) == eol) then
        call problems%add(token%line, where, "the closing quote "//token%quote//" is missing")
        self%line = self%line + 1
        self%quote_open = .true.
        self%lost = .true.
        sound = .false.
        return
      end if
      if (character_at(self%text, self%at) /= token%quote) exit
      self%at = self%at + 1
    end do
    token%last = self%at - 2
  end subroutine read_quoted

  !> A number, `.true.` or a bare word, with its repeat count; after `3*` also text in quotes.
  subroutine read_bare(self, token, sound, where, problems)
    class(scanner_t), intent(inout) :: self
    type(token_t), intent(inout) :: token
    logical, intent(inout) :: sound
    character(len=*), intent(in) :: where
    type(problem_list_t), intent(inout) :: problems
    integer :: star, status

    token%first = self%at
    token%last = self%word_end(self%at)
    self%at = token%last + 1
    if (token%last < token%first) then
      self%at = self%at + scan(self%text(self%at:), word_characters//blanks//eol//"/,!") - 1
      call problems%add(self%line, where, "unexpected "//shown(self%text(token%first:self%at - 1)))
      sound = .false.
      return
    end if
    star = index(self%text(token%first:token%last), "*")
    if (star < 2) return
    associate (count => self%text(token%first:token%first + star - 2))
      if (verify(count, digits) > 0) return
      status = 1
      if (len(count) <= 8) read (count, *, iostat=status) token%repeats
    end associate
    if (status /= 0 .or. token%repeats < 1 .or. token%repeats > most_repeats) then
      call problems%add(self%line, where, "the count of "//shown(self%text(token%first:token%last))//" is out of range")
      sound = .false.
    end if
    token%first = token%first + star
    if (token%first <= token%last) return
    if (scan(character_at(self%text, self%at), "'""") > 0) then
      call self%read_quoted(token, sound, where, problems)
    else
      call problems%add(self%line, where, "a value is missing after the *")
      sound = .false.
    end if
  end subroutine read_bare

  !> The value as it is meant: doubled quotes are single ones.
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

  !> Goes on at the beginning of the next line.
  pure subroutine skip_line(self)
    class(scanner_t), intent(inout) :: self

    self%at = self%at + index(self%text(self%at:), eol)
    self%line = self%line + 1
  end subroutine skip_line

  !> Last character of the word that begins at `first`; first - 1 if none does.
  pure function word_end(self, first) result(last)
    class(scanner_t), intent(in) :: self
    integer, intent(in) :: first
    integer :: last

    last = first + verify(self%text(first:), word_characters) - 2
  end function word_end

  !> Whether here begins `name =` or `name(...) =`, and not a value.
  pure function name_follows(self)
    class(scanner_t), intent(in) :: self
    logical :: name_follows
    integer :: i

    name_follows = .false.
    i = self%word_end(self%at) + 1
    if (i == self%at) return
    if (character_at(self%text, i) == "(") i = i + scan(self%text(i:), ")"//eol)
    i = i + verify(self%text(i:), blanks//eol) - 1
    name_follows = character_at(self%text, i) == "="
  end function name_follows

  !> A line feed beyond the end.
  pure function character_at(text, position) result(c)
    character(len=*), intent(in) :: text
    integer, intent(in) :: position
    character(len=1) :: c

    c = eol
    if (position <= len(text)) c = text(position:position)
  end function character_at

  !> A name as it stands in a message: long and odd ones cut and quoted.
  pure function plain(name)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: plain

    plain = name
    if (len(name) > 30) plain = shown(name)
  end function plain

end module namelist_scanner
