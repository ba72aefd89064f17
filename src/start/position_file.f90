!> Reads disks from a text file with one line `x y` or `x y vx vy` per disk. A file may have other columns if its first line
!> contains the names of the columns, in lower or upper case. Empty lines, and text from a # to the end of its line, are ignored.
module position_file
  use kinds, only: int64, real64
  use errors, only: exit_files, exit_usage, fail
  use input_text, only: byte_order_mark, find_words, longest_line
  use input_words, only: read_real
  use settings, only: disks_in_file_t
  use system, only: read_file
  use texts, only: counted, eol, joined, lower_case, place_of, shown, suggestion, written
  implicit none
  private
  public :: angle_row, column_names, mass_row, radius_row, read_positions, spin_row

  !> Names of the columns of a file of disks. Row k of the table of disks that is read from the file contains the quantity
  !> `column_names(k)`. Radius and mass are the last two names, so that a single loop can check both.
  character(len=*), parameter :: column_names(*) = [character(len=7) :: "x", "y", "vx", "vy", "omega", "angle", "radius", "mass"]
  integer, parameter :: spin_row = 5, angle_row = 6, radius_row = 7, mass_row = 8
  character(len=*), parameter :: known_names(*) = [character(len=7) :: column_names, "species"]
  integer, parameter :: species_column = size(known_names)
  character(len=*), parameter :: numpy_mark = char(147)//"NUMPY", zip_mark = "PK"//achar(3)//achar(4)

contains

  !> Reads the disks of one species, or all disks if there is no column for the species.
  subroutine read_positions(path, names, s, disks)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: names(:)                !! names of all species
    integer, intent(in) :: s                                !! index of the species
    type(disks_in_file_t), intent(inout) :: disks
    character(len=longest_line) :: line
    character(len=:), allocatable :: text, problem
    real(real64), allocatable :: table(:, :)                ! (column_names,n) values of the disks
    integer, allocatable :: lines(:)                        ! (n) line number of each disk
    ! For each column of the file, index of its name in `known_names`; empty before the first line has been read.
    integer, allocatable :: column(:)
    integer :: first(longest_line), last(longest_line)      ! positions of the first and last character of each word in the line
    integer(int64) :: begin, past                           ! beginning and end of a line in the text
    integer :: number, n, n_words

    allocate (table(size(column_names), 64), lines(64), column(0))
    n = 0
    call read_file(path, text, problem)
    if (problem /= "") then
      call fail(disks%error, exit_files, path//": cannot be read: "//problem)
      return
    end if
    number = 0
    past = 1
    do while (past <= len(text, int64))
      begin = past
      past = begin + index(text(begin:), eol, kind=int64)
      if (past == begin) past = len(text, int64) + 2        ! the last line may lack a line feed
      line = text(begin:past - 2)
      number = number + 1
      if (number == 1 .and. index(line, byte_order_mark) == 1) line = line(len(byte_order_mark) + 1:)
      if (n == size(lines)) then
        table = reshape(table, [size(table, 1), 2*n], pad=[0.0_real64])
        lines = [lines, lines]
      end if
      lines(n + 1) = number
      call read_line()
      if (problem /= "") exit
    end do
    disks%there = [(any(column == number), number=1, size(column_names))]
    disks%table = table(:, :n)
    disks%rows = lines(:n)
    if (problem /= "") call fail(disks%error, exit_usage, path//":"//written(number)//": "//problem)

  contains

    !> Reads a line of the file. The first line may contain the names of the columns. If the first line contains numbers instead,
    !> the columns have the names x y or x y vx vy. Every line of numbers describes a disk, which is added to the table if it
    !> belongs to the requested species.
    subroutine read_line()
      real(real64) :: value(size(column_names))
      integer :: k, its_species

      if (len_trim(line) == longest_line) problem = "the line is too long"
      if (number == 1 .and. (index(line, numpy_mark) == 1 .or. index(line, zip_mark) == 1)) &
        problem = "the file contains arrays of NumPy; write_start of the Python package makes a starting file of them"
      call find_words(line, first, last, n_words)
      if (n_words == 0 .or. problem /= "") return
      if (size(column) == 0) then
        if (are_names()) then
          call read_names()
          return
        end if
        if (n_words == 2 .or. n_words == 4) column = [(k, k=1, n_words)]
      end if
      if (size(column) == 0) then
        problem = counted(int(n_words, int64), "number")//"; allowed: x y, or x y vx vy, " &
          //"or the columns that the first line names: " &
          //joined(known_names, " ")
      else if (n_words /= size(column)) then
        problem = counted(int(n_words, int64), "value")//"; expected: "//joined(known_names(column), " ")
      end if
      value = 0
      its_species = s
      do k = 1, n_words
        if (problem /= "") return
        associate (word => line(first(k):last(k)))
          if (column(k) == species_column) then
            its_species = species_named(word)
            if (its_species == 0) problem = "there is no species "//shown(word)//"; known: 1 to "//written(size(names)) &
              //", "//joined(names, ", ")
          else
            call read_real(word, value(column(k)), problem)
            if (problem /= "") problem = shown(word)//" "//problem
          end if
        end associate
      end do
      if (its_species /= s .or. problem /= "") return
      n = n + 1
      table(:, n) = value
    end subroutine read_line

    !> Whether the line contains names of columns, which is assumed if at least one word is a known name or if no word is a number.
    function are_names() result(yes)
      logical :: yes, some_number
      character(len=:), allocatable :: what
      real(real64) :: value
      integer :: k

      some_number = .false.
      do k = 1, n_words
        yes = place_of(lower_case(line(first(k):last(k))), known_names) > 0
        if (yes) return
        call read_real(line(first(k):last(k)), value, what)
        some_number = some_number .or. what == ""
      end do
      yes = .not. some_number
    end function are_names

    !> Reads the names of the columns.
    subroutine read_names()
      character(len=:), allocatable :: unknown, advice
      integer :: k, place

      unknown = ""
      advice = ""
      do k = 1, n_words
        associate (word => line(first(k):last(k)))
          place = place_of(lower_case(word), known_names)
          if (place > 0) then
            if (any(column == place)) problem = "the column "//trim(known_names(place))//" is named twice"
            column = [column, place]
          else
            advice = suggestion(word, known_names)
            if (unknown /= "") advice = "known: "//joined(known_names, ", ")
            unknown = unknown//", "//shown(word)
          end if
        end associate
      end do
      if (unknown /= "") then
        problem = "no column is called "//unknown(3:)//"; "//advice
      else if (problem == "" .and. .not. (any(column == 1) .and. any(column == 2))) then
        problem = "columns x and y are needed"
      else if (problem == "" .and. (any(column == 3) .neqv. any(column == 4))) then
        problem = "columns vx and vy go together"
      end if
    end subroutine read_names

    !> Index of the species whose name or number is the given word; 0 if no species has this name or number.
    function species_named(word) result(s)
      character(len=*), intent(in) :: word
      integer :: s
      real(real64) :: number
      character(len=:), allocatable :: what

      s = place_of(word, names)
      if (s > 0) return
      call read_real(word, number, what)
      if (what == "" .and. number >= 1 .and. number <= size(names)) then
        if (number <= aint(number)) s = int(number)
      end if
    end function species_named
  end subroutine read_positions

end module position_file
