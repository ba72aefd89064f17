!> String utilities: lists of strings, numbers as strings, and suggestions for misspelt words.
module texts
  use, intrinsic :: ieee_arithmetic, only: ieee_is_normal
  use kinds, only: int64, real64
  implicit none
  private
  public :: text_t, growing_text_t, written, written_exactly, lower_case, legible, shown, joined, place_of, nearest_word, suggestion
  public :: about, counted, did_you_mean, line_at, lines_of, size_text, wrapped

  !> String of any length; an array of this type is a list of strings.
  type :: text_t
    character(len=:), allocatable :: text
  end type text_t

  !> String assembled from pieces, in a time proportional to its final length.
  type :: growing_text_t
    private
    character(len=:), allocatable :: buffer
    integer :: length = 0
  contains
    procedure :: add
    procedure :: text => text_so_far
  end type growing_text_t

  !> Converts a number to a short, readable string.
  interface written
    procedure :: written_integer, written_long_integer, written_real
  end interface written

  character(len=*), parameter :: upper_letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
  character(len=*), parameter :: lower_letters = "abcdefghijklmnopqrstuvwxyz"
  character(len=1), parameter, public :: eol = new_line("a")      !! line end
  character(len=*), parameter, public :: byte_order_mark = char(239)//char(187)//char(191)
  character(len=*), parameter, public :: letters = lower_letters//upper_letters, digits = "0123456789"

contains

  !> Appends a piece to the string.
  pure subroutine add(self, piece)
    class(growing_text_t), intent(inout) :: self
    character(len=*), intent(in) :: piece
    character(len=:), allocatable :: longer
    integer :: needed

    needed = self%length + len(piece)
    if (.not. allocated(self%buffer)) self%buffer = ""
    if (needed > len(self%buffer)) then
      allocate (character(len=2*needed) :: longer)
      longer(:self%length) = self%buffer(:self%length)
      call move_alloc(longer, self%buffer)
    end if
    self%buffer(self%length + 1:needed) = piece
    self%length = needed
  end subroutine add

  !> Concatenation of all pieces added so far.
  pure function text_so_far(self) result(text)
    class(growing_text_t), intent(in) :: self
    character(len=:), allocatable :: text

    text = ""
    if (allocated(self%buffer)) text = self%buffer(:self%length)
  end function text_so_far

  !> Converts a default integer to a string.
  pure function written_integer(number) result(text)
    integer, intent(in) :: number
    character(len=:), allocatable :: text

    text = written_long_integer(int(number, int64))
  end function written_integer

  !> Converts a 64-bit integer to a string.
  pure function written_long_integer(number) result(text)
    integer(int64), intent(in) :: number
    character(len=:), allocatable :: text
    character(len=24) :: buffer

    write (buffer, "(i0)") number
    text = trim(buffer)
  end function written_long_integer

  !> Converts a real number to a string without trailing zeros. An exponent is used only if the
  !> string becomes shorter.
  pure recursive function written_real(number) result(text)
    real(real64), intent(in) :: number
    character(len=:), allocatable :: text
    character(len=24) :: buffer
    integer :: exponent

    ! NaN, infinite or denormal; for a denormal number 10**exponent would underflow
    if (.not. ieee_is_normal(number)) then
      write (buffer, "(es24.16e3)") number
      text = trim(adjustl(buffer))
    else if (number == 0 .or. (abs(number) >= 1.0e-3_real64 .and. abs(number) < 1.0e6_real64)) then
      write (buffer, "(f24.6)") number
      text = trim(adjustl(buffer(:verify(buffer, "0", back=.true.))))
      if (text(len(text):) == ".") text = text(:len(text) - 1)
    else
      exponent = floor(log10(abs(number)))
      text = written_real(number/10.0_real64**exponent)//"e"//written_integer(exponent)
    end if
  end function written_real

  !> Converts a real number to a string with enough digits to recover exactly the same number.
  pure function written_exactly(number) result(text)
    real(real64), intent(in) :: number
    character(len=:), allocatable :: text
    character(len=24) :: buffer
    real(real64) :: again

    text = written_real(number)
    read (text, *) again
    if (again == number) return
    write (buffer, "(es24.16e3)") number
    text = trim(adjustl(buffer))
  end function written_exactly

  !> Converts ASCII letters to lower case.
  pure function lower_case(text) result(lower)
    character(len=*), intent(in) :: text
    character(len=len(text)) :: lower
    integer :: i, letter

    do i = 1, len(text)
      lower(i:i) = text(i:i)
      letter = index(upper_letters, text(i:i))
      if (letter > 0) lower(i:i) = lower_letters(letter:letter)
    end do
  end function lower_case

  !> Replaces each control character by `?`.
  pure function legible(text) result(line)
    character(len=*), intent(in) :: text
    character(len=len(text)) :: line
    integer :: i

    line = text
    do i = 1, len(line)
      if (iachar(line(i:i)) < 32 .or. iachar(line(i:i)) == 127) line(i:i) = "?"
    end do
  end function legible

  !> Quotes a string from a user or a file for a message. Control characters are replaced, and a
  !> long string is truncated.
  pure function shown(text) result(quoted)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: quoted
    integer, parameter :: longest = 40
    integer :: last

    last = min(len(text), longest)
    do while (last > longest - 4 .and. last < len(text))
      if (iand(iachar(text(last + 1:last + 1)), 192) /= 128) exit   ! a UTF-8 character must stay whole
      last = last - 1
    end do
    quoted = legible(text(:last))
    if (len(text) > longest) quoted = quoted//"..."
    quoted = '"'//quoted//'"'
  end function shown

  !> Joins words into one line, separated by `glue`.
  pure function joined(words, glue) result(line)
    character(len=*), intent(in) :: words(:)
    character(len=*), intent(in) :: glue
    character(len=:), allocatable :: line
    type(growing_text_t) :: growing
    integer :: i

    do i = 1, size(words)
      if (i > 1) call growing%add(glue)
      call growing%add(trim(words(i)))
    end do
    line = growing%text()
  end function joined

  !> Wraps a text at blanks into lines of at most `width` characters. All lines but the first start
  !> with `margin`; a word longer than `width` occupies a line of its own.
  pure function wrapped(text, width, margin) result(lines)
    character(len=*), intent(in) :: text, margin
    integer, intent(in) :: width
    character(len=:), allocatable :: lines
    integer :: first, cut

    lines = ""
    first = 1
    do while (len_trim(text) - first + 1 > width)
      cut = index(text(first:first + width), " ", back=.true.)
      if (cut == 0) cut = index(text(first:len_trim(text)), " ")
      if (cut == 0) exit
      lines = lines//text(first:first + cut - 2)//eol//margin
      first = first + cut
    end do
    lines = lines//trim(text(first:))
  end function wrapped

  !> Index of a word in a list; 0 if the list does not contain it.
  pure function place_of(word, words) result(place)
    character(len=*), intent(in) :: word
    character(len=*), intent(in) :: words(:)
    integer :: place

    do place = 1, size(words)
      if (words(place) == word) return
    end do
    place = 0
  end function place_of

  !> Advice about a misspelt word: the most similar known word, and how to see all known words, or a
  !> list of them. A long list appears only if no known word is similar.
  pure function suggestion(word, known, listed, to_see_all) result(advice)
    character(len=*), intent(in) :: word
    character(len=*), intent(in) :: known(:)
    character(len=*), intent(in), optional :: listed(:)     !! words listed instead of `known`
    character(len=*), intent(in), optional :: to_see_all    !! option of the program that lists `known`
    character(len=:), allocatable :: advice
    integer, parameter :: longest_list = 20

    advice = nearest_word(word, known)
    if (advice /= "") advice = did_you_mean(""""//advice//"""")
    if (advice /= "" .and. present(to_see_all)) then
      advice = advice//" "//to_see_all//" lists all"
    else if (advice == "" .and. present(listed)) then
      advice = "known: "//joined(listed, ", ")
    else if (advice == "" .or. size(known) <= longest_list) then
      advice = advice//" known: "//joined(known, ", ")
    end if
    advice = trim(adjustl(advice))
  end function suggestion

  !> Question that suggests a word, or several in one text.
  pure function did_you_mean(text) result(question)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: question

    question = "did you mean "//text//"?"
  end function did_you_mean

  !> Known word that was probably meant by `word`. A known word is suggested if it starts with
  !> `word`, or if it differs from `word` in at most a third of the letters. The result is empty if
  !> no known word is similar.
  pure function nearest_word(word, known) result(nearest)
    character(len=*), intent(in) :: word
    character(len=*), intent(in) :: known(:)
    character(len=:), allocatable :: nearest
    integer, parameter :: longest = 64
    integer :: k, distance, least

    nearest = ""
    if (len(word) > longest) return
    least = (len(word) + 1)/3
    do k = 1, size(known)
      distance = edit_distance(lower_case(word), trim(known(k)))
      if (distance > least) cycle
      if (distance == least .and. nearest /= "") cycle
      least = distance
      nearest = trim(known(k))
    end do
    if (nearest /= "" .or. len(word) < 3) return
    do k = size(known), 1, -1
      if (index(known(k), lower_case(word)) == 1) nearest = trim(known(k))
    end do
  end function nearest_word

  !> Edit distance of two words: the number of insertions, deletions, substitutions and swaps of
  !> adjacent letters that turn `a` into `b` (optimal string alignment, Damerau, 1964,
  !> doi:10.1145/363958.363994).
  pure function edit_distance(a, b) result(distance)
    character(len=*), intent(in) :: a, b
    integer :: distance
    integer :: d(-1:len(a), -1:len(b)), i, j, change

    d(0:, 0) = [(i, i=0, len(a))]
    d(0, 0:) = [(j, j=0, len(b))]
    do j = 1, len(b)
      do i = 1, len(a)
        change = merge(0, 1, a(i:i) == b(j:j))
        d(i, j) = min(d(i - 1, j) + 1, d(i, j - 1) + 1, d(i - 1, j - 1) + change)
        if (i == 1 .or. j == 1) cycle
        if (a(i:i) == b(j - 1:j - 1) .and. a(i - 1:i - 1) == b(j:j)) then
          d(i, j) = min(d(i, j), d(i - 2, j - 2) + 1)
        end if
      end do
    end do
    distance = d(len(a), len(b))
  end function edit_distance

  !> Formats a number of bytes as kB or MB, for messages.
  pure function size_text(bytes) result(text)
    integer(int64), intent(in) :: bytes
    character(len=:), allocatable :: text

    if (bytes < 1000000) then
      text = written((bytes + 999)/1000)//" kB"
    else
      text = written((bytes + 500000)/1000000)//" MB"
    end if
  end function size_text

  !> Formats a positive number, rounded to three significant digits.
  pure function about(number) result(text)
    real(real64), intent(in) :: number
    character(len=:), allocatable :: text
    real(real64) :: unit

    unit = 10.0_real64**(floor(log10(number)) - 2)
    text = written(anint(number/unit)*unit)
  end function about

  !> Formats a number and a noun, in the plural unless the number is 1: `1 value`, `2 values`.
  pure function counted(number, noun) result(text)
    integer(int64), intent(in) :: number
    character(len=*), intent(in) :: noun
    character(len=:), allocatable :: text

    text = written(number)//" "//noun
    if (number /= 1) text = text//"s"
  end function counted

  !> The line of a text that contains character k. The position k may also be just after the end of
  !> the text.
  pure function line_at(text, k) result(line)
    character(len=*), intent(in) :: text
    integer, intent(in) :: k                      !! position of a character in the text
    character(len=:), allocatable :: line

    line = text(index(text(:k - 1), eol, back=.true.) + 1:)
    line = line(:index(line//eol, eol) - 1)
  end function line_at

  !> Splits a text into lines, without their line ends.
  subroutine lines_of(text, lines)
    character(len=*), intent(in) :: text
    type(text_t), allocatable, intent(out) :: lines(:)
    type(text_t) :: line
    integer :: first, last

    allocate (lines(0))
    first = 1
    do while (first <= len(text))
      last = first - 1 + index(text(first:)//eol, eol)
      line%text = text(first:last - 1)
      ! text_t(...) would leak memory with gfortran 12
      lines = [lines, line]
      first = last + 1
    end do
  end subroutine lines_of

end module texts
