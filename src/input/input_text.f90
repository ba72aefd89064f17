!> Reads the text of an input file and splits it into lines and tokens. The namelist reader of
!> Fortran accepts some invalid texts silently, names neither the line nor the variable in its
!> messages, and can crash. Therefore this module and `namelist_input` implement a small, strict
!> grammar. A group has the form `&group name = value, value name(2) = value name = 3*value /`, and
!> a comment starts with `!`. Any other text is an error, reported with its line number.
module input_text
  use kinds, only: int64
  use errors, only: error_t, exit_files, exit_usage, fail
  use system, only: file_size, is_folder, names_beside, read_file
  use texts, only: byte_order_mark, did_you_mean, digits, eol, letters, nearest_word, shown, written
  implicit none
  private
  public :: read_text, unix_lines
  public :: assignment_t, content, cut, plain, split_element, token_t, word, unclosed, ending

  integer(int64), parameter :: largest_file = 4194304   !! [bytes]
  integer, private :: i
  character(len=1), parameter :: control(*) = [(achar(i), i=0, 8), achar(11), achar(12), (achar(i), i=14, 31), achar(127)]

  !> First bytes of an HDF5 file (HDF5 File Format Specification, section II.A)
  character(len=*), parameter :: hdf5_signature = char(137)//"HDF"//achar(13)//achar(10)//achar(26)//achar(10)

  !> Kinds of tokens. A single character such as & or = forms its own kind. The kind of a quoted
  !> string is its quotation mark.
  character(len=1), parameter :: word = "w", unclosed = "u", junk = "?", ending = "e"
  character(len=*), parameter :: blanks = " "//achar(9), quotes = "'""", marks = "&/=,()"
  character(len=*), parameter :: word_characters = digits//".+-"//letters//"_*%#:$@?<>|[]{}~^`\"

  !> A token, from character `first` to character `last` of the text, including quotation marks.
  type :: token_t
    character(len=1) :: kind
    integer :: first, last, line
    integer :: repeats                           !! repeat count, such as 3 in 3*value
  end type token_t

  type :: assignment_t
    !> Line number in the input file, or -k for override number k.
    integer :: line = 0
    character(len=:), allocatable :: where       !! group.variable, for messages
    !> Index of the assigned element, such as 2 in name(2) = value; 0 without an index.
    integer :: element = 0
    type(token_t), allocatable :: tokens(:)      !! tokens of the assigned values
    logical :: sound = .true.                    !! .false. after a problem of the assignment was reported
  end type assignment_t

contains

  !> Reads the bytes of a regular file.
  subroutine read_text(path, text, error)
    character(len=*), intent(in) :: path
    character(len=:), allocatable, intent(out) :: text
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: problem
    integer(int64) :: bytes
    integer :: odd

    bytes = file_size(path)
    if (bytes < 0) then
      call fail(error, exit_files, path//": there is no such file"//advice(path))
    else if (is_folder(path)) then
      call fail(error, exit_files, path//": is a folder, not an input file")
    else if (bytes == 0) then
      call fail(error, exit_usage, path//": is empty, or a pipe or a device instead of a file")
    else if (is_hdf5(path)) then
      call fail(error, exit_usage, path//": is an HDF5 file, but an input is a text file; to continue a run, repeat its command " &
        //"with --resume: ricochet INPUT.nml -o "//path//" --resume")
    else if (bytes > largest_file) then
      call fail(error, exit_usage, path//": has "//written(bytes)// &
        " bytes; an input file has at most "//written(largest_file))
    end if
    if (allocated(error)) return
    call read_file(path, text, problem)
    if (problem /= "") then
      call fail(error, exit_files, path//": cannot be read: "//problem)
      return
    end if
    odd = scan(text, transfer(control, repeat(" ", size(control))))
    if (odd > 0) call fail(error, exit_usage, path//": is not a text file: byte "//written(odd)// &
      " is a control character, code "//written(iachar(text(odd:odd))))
  end subroutine read_text

  !> Whether a file begins like an HDF5 file, such as the output of a run; false if it cannot be
  !> read.
  function is_hdf5(path)
    character(len=*), intent(in) :: path
    logical :: is_hdf5
    character(len=len(hdf5_signature)) :: start
    integer :: unit, status

    start = ""
    open (newunit=unit, file=path, access="stream", form="unformatted", action="read", status="old", iostat=status)
    is_hdf5 = status == 0
    if (.not. is_hdf5) return
    read (unit, iostat=status) start
    close (unit)
    is_hdf5 = status == 0 .and. start == hdf5_signature
  end function is_hdf5

  !> Suggests the input file with the most similar name, in the folder of the path or in the folder
  !> `input`.
  function advice(path)
    character(len=*), intent(in) :: path
    character(len=:), allocatable :: advice
    character(len=*), parameter :: extension = ".nml", inputs = "input/"
    character(len=:), allocatable :: name

    name = path(index(path, "/", back=.true.) + 1:)
    if (index(name//"|", extension//"|") > 0) name = name(:len(name) - len(extension))
    associate (known => [names_beside(path, extension), names_beside(inputs, extension)])
      advice = nearest_word(name, known)
      if (advice == "") advice = nearest_word(name(:index(name, ".", back=.true.) - 1), known)
    end associate
    if (advice == "") return
    name = path(:index(path, "/", back=.true.))//advice//extension
    if (file_size(name) < 0) name = inputs//advice//extension
    advice = "; "//did_you_mean(name)
  end function advice

  !> Normalises the line ends of a text to line feeds, and removes a byte order mark.
  pure function unix_lines(text) result(lines)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: lines
    character(len=*), parameter :: carriage_return = achar(13)
    integer :: i, n, first

    allocate (character(len=len(text) + 1) :: lines)
    first = 1
    if (index(text, byte_order_mark) == 1) first = 4
    n = 0
    do i = first, len(text)
      if (i > 1 .and. text(i:i) == eol) then
        if (text(i - 1:i - 1) == carriage_return) cycle
      end if
      n = n + 1
      lines(n:n) = text(i:i)
      if (text(i:i) == carriage_return) lines(n:n) = eol
    end do
    lines = lines(:n)//eol
  end function unix_lines

  !> Splits a text into tokens. The list ends with several tokens of kind `ending`, so that a parser
  !> can look ahead.
  pure subroutine cut(text, tokens)
    character(len=*), intent(in) :: text         !! text whose lines all end in a line feed
    type(token_t), allocatable, intent(out) :: tokens(:)
    character(len=1) :: c
    integer :: at, line, last, n

    allocate (tokens(len(text) + 5))
    n = 0
    line = 1
    at = 1
    do while (at <= len(text))
      c = text(at:at)
      last = at
      if (c == eol) then
        line = line + 1
      else if (c == "!") then
        last = at + index(text(at:), eol) - 2
      else if (scan(c, blanks) == 0) then
        n = n + 1
        tokens(n) = token_t(c, at, at, line, 1)
        if (scan(c, quotes) > 0) then
          call end_quote(tokens(n))
        else if (scan(c, word_characters) > 0) then
          tokens(n)%kind = word
          tokens(n)%last = at + verify(text(at:), word_characters) - 2
        else if (scan(c, marks) == 0) then
          tokens(n)%kind = junk
          tokens(n)%last = at + scan(text(at:), word_characters//blanks//eol//quotes//marks//"!") - 2
        end if
        last = tokens(n)%last
      end if
      at = last + 1
    end do
    tokens(n + 1:n + 5) = token_t(ending, at, at - 1, line, 1)
    tokens = tokens(:n + 5)

  contains

    !> Finds the end of a quoted string, which must end in the line in which it begins. A doubled
    !> quotation mark represents a single one.
    pure subroutine end_quote(token)
      type(token_t), intent(inout) :: token

      do
        token%last = token%last + scan(text(token%last + 1:), token%kind//eol)
        if (text(token%last:token%last) == eol) then
          token%kind = unclosed
          token%last = token%last - 1
          return
        end if
        if (text(token%last + 1:token%last + 1) /= token%kind) return
        token%last = token%last + 1
      end do
    end subroutine end_quote
  end subroutine cut

  !> Value of a token. In a quoted string, doubled quotation marks are replaced by single ones.
  pure function content(text, token) result(value)
    character(len=*), intent(in) :: text
    type(token_t), intent(in) :: token
    character(len=:), allocatable :: value
    integer :: i, n

    value = text(token%first:token%last)
    if (scan(token%kind, quotes) == 0) return
    n = 0
    i = 2
    do while (i < len(value))
      n = n + 1
      value(n:n) = value(i:i)
      i = i + merge(2, 1, value(i:i) == token%kind)
    end do
    value = value(:n)
  end function content

  !> Formats a name for messages: a long name is truncated and quoted.
  pure function plain(name)
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: plain

    plain = name
    if (len(name) > 30) plain = shown(name)
  end function plain

  !> Splits a name such as `gravity(2)` into the name of the variable and the index of its element.
  !> Parentheses without a number stay part of the name.
  subroutine split_element(name, element)
    character(len=:), allocatable, intent(inout) :: name
    integer, intent(out) :: element                     !! index of the element; 0 without an index
    integer :: bracket

    element = 0
    bracket = index(name, "(")
    if (bracket == 0 .or. index(name, ")") /= len(name)) return
    associate (number => name(bracket + 1:len(name) - 1))
      if (number == "" .or. verify(number, digits) > 0 .or. len(number) > 8) return
      read (number, *) element
    end associate
    if (element > 0) name = name(:bracket - 1)
  end subroutine split_element

end module input_text
