!> Reads tables of disks or obstacles from text files. Each line contains the values of one row; the
!> first line may contain the column names. Empty lines are ignored, and so is text from a # to the
!> end of its line.
module text_table
  use kinds, only: int64, real64
  use errors, only: error_t, exit_files, exit_usage, fail
  use input_words, only: read_real
  use system, only: read_file
  use texts, only: byte_order_mark, counted, eol, joined, shown, written
  implicit none
  private
  public :: text_table_t

  integer, parameter :: longest_line = 1024

  !> A table being read line by line.
  type :: text_table_t
    character(len=:), allocatable :: path
    character(len=:), allocatable :: problem        !! problem with the present line; "" without a problem
    character(len=:), allocatable :: line           !! the present line
    integer :: number = 0                           !! number of the present line
    integer :: n_words = 0                          !! number of words in the present line
    integer :: n = 0                                !! number of rows read so far
    real(real64), allocatable :: rows(:, :)         !! rows read so far; shape (values, at least n)
    integer, allocatable :: lines(:)                !! line number of each row; size at least n
    character(len=:), allocatable, private :: text
    integer(int64), private :: past = 1             !! position of the start of the next line in the text
    !> Positions of the first and the last character of each word in the present line.
    integer, private :: first(longest_line) = 0, last(longest_line) = 0
  contains
    procedure :: open => open_table
    procedure :: begins_with
    procedure :: advance
    procedure :: word
    procedure :: require
    procedure :: read_number
    procedure :: append
    procedure :: close => close_table
  end type text_table_t

contains

  !> Opens a file with `width` values per row.
  subroutine open_table(self, path, width, error)
    class(text_table_t), intent(out) :: self
    character(len=*), intent(in) :: path
    integer, intent(in) :: width
    type(error_t), allocatable, intent(inout) :: error

    self%path = path
    allocate (self%rows(width, 64), self%lines(64))
    call read_file(path, self%text, self%problem)
    if (self%problem /= "") call fail(error, exit_files, path//": cannot be read: "//self%problem)
  end subroutine open_table

  !> True if the file starts with the given characters.
  pure function begins_with(self, mark) result(yes)
    class(text_table_t), intent(in) :: self
    character(len=*), intent(in) :: mark
    logical :: yes

    yes = index(self%text, mark) == 1
  end function begins_with

  !> Advances to the next line that contains words.
  subroutine advance(self, there)
    class(text_table_t), intent(inout) :: self
    logical, intent(out) :: there                   !! .false. at the end of the text and after a problem
    integer(int64) :: begin

    do
      there = self%problem == "" .and. self%past <= len(self%text, int64)
      if (.not. there) return
      begin = self%past
      self%past = begin + index(self%text(begin:), eol, kind=int64)
      if (self%past == begin) self%past = len(self%text, int64) + 2    ! the last line may lack a line feed
      self%line = self%text(begin:self%past - 2)
      self%number = self%number + 1
      if (self%number == 1 .and. index(self%line, byte_order_mark) == 1) &
        self%line = self%line(len(byte_order_mark) + 1:)
      if (len_trim(self%line) > longest_line) self%problem = "the line is too long"
      if (self%problem /= "") cycle
      call find_words(self%line, self%first, self%last, self%n_words)
      if (self%n_words > 0) return
    end do
  end subroutine advance

  !> Splits a line into words.
  pure subroutine find_words(line, first, last, n)
    character(len=*), intent(in) :: line
    integer, intent(inout) :: first(:), last(:)
    integer, intent(out) :: n                       !! number of words
    character(len=*), parameter :: separators = " ,"//achar(9)//achar(13)
    integer :: begin, past, comment

    comment = index(line//"#", "#")
    n = 0
    past = 1
    do
      begin = past - 1 + verify(line(past:comment - 1)//"x", separators)
      if (begin >= comment) exit
      past = begin - 1 + scan(line(begin:comment - 1)//" ", separators)
      n = n + 1
      first(n) = begin
      last(n) = past - 1
    end do
  end subroutine find_words

  !> Word k of the present line.
  pure function word(self, k)
    class(text_table_t), intent(in) :: self
    integer, intent(in) :: k
    character(len=:), allocatable :: word

    word = self%line(self%first(k):self%last(k))
  end function word

  !> Reports a problem unless the present line contains one value for each of the given columns.
  pure subroutine require(self, names)
    class(text_table_t), intent(inout) :: self
    character(len=*), intent(in) :: names(:)        !! column names of the file

    if (self%n_words /= size(names)) &
      self%problem = counted(int(self%n_words, int64), "value")//"; expected: "//joined(names, " ")
  end subroutine require

  !> Converts word k of the present line to a number.
  pure subroutine read_number(self, k, value)
    class(text_table_t), intent(inout) :: self
    integer, intent(in) :: k
    real(real64), intent(out) :: value

    call read_real(self%word(k), value, self%problem)
    if (self%problem /= "") self%problem = shown(self%word(k))//" "//self%problem
  end subroutine read_number

  !> Appends a row to the table.
  pure subroutine append(self, values)
    class(text_table_t), intent(inout) :: self
    real(real64), intent(in) :: values(:)

    if (self%n == size(self%lines)) then
      self%rows = reshape(self%rows, [size(values), 2*self%n], pad=[0.0_real64])
      self%lines = [self%lines, self%lines]
    end if
    self%n = self%n + 1
    self%rows(:, self%n) = values
    self%lines(self%n) = self%number
  end subroutine append

  !> Frees unused space of the table, and reports the problem of the last line read, if any.
  subroutine close_table(self, error)
    class(text_table_t), intent(inout) :: self
    type(error_t), allocatable, intent(inout) :: error

    self%rows = self%rows(:, :self%n)
    self%lines = self%lines(:self%n)
    if (self%problem /= "") &
      call fail(error, exit_usage, self%path//":"//written(self%number)//": "//self%problem)
  end subroutine close_table

end module text_table
