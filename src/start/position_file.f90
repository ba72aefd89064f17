!> Reads disks from a text file with one line `x y` or `x y vx vy` per disk, or with columns named
!> in the first line, in lower or upper case. Empty lines are ignored, and so is text from a # to
!> the end of its line.
module position_file
  use kinds, only: int64, real64
  use input_words, only: read_real
  use settings, only: disks_in_file_t
  use text_table, only: text_table_t
  use texts, only: counted, joined, lower_case, place_of, shown, suggestion, written
  implicit none
  private
  public :: angle_row, column_names, mass_row, radius_row, read_positions, spin_row

  !> Column names of a file of disks. Row k of the table of disks contains the quantity
  !> `column_names(k)`. Radius and mass are last, so that a single loop can check both.
  character(len=*), parameter :: column_names(*) = [character(len=7) :: "x", "y", "vx", "vy", "omega", "angle", "radius", "mass"]
  integer, parameter :: spin_row = 5, angle_row = 6, radius_row = 7, mass_row = 8
  character(len=*), parameter :: known_names(*) = [character(len=7) :: column_names, "species"]
  integer, parameter :: species_column = size(known_names)
  character(len=*), parameter :: numpy_mark = char(147)//"NUMPY", zip_mark = "PK"//achar(3)//achar(4)

  !> A file of disks being read.
  type, extends(text_table_t) :: positions_t
    !> Index in `known_names` of each column; empty before the first line is read.
    integer, allocatable :: column(:)
  contains
    procedure :: read_disk
    procedure :: has_names
    procedure :: read_names
  end type positions_t

contains

  !> Reads the disks of one species, or all disks if the file has no column for the species.
  subroutine read_positions(path, names, s, disks)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: names(:)                !! names of all species
    integer, intent(in) :: s                                !! index of the species
    type(disks_in_file_t), intent(inout) :: disks
    type(positions_t) :: file
    logical :: there
    integer :: k

    call file%open(path, size(column_names), disks%error)
    if (allocated(disks%error)) return
    allocate (file%column(0))
    if (file%begins_with(numpy_mark) .or. file%begins_with(zip_mark)) then
      file%number = 1
      file%problem = "the file contains arrays of NumPy; write_start of the Python package converts them"
    end if
    do
      call file%advance(there)
      if (.not. there) exit
      if (size(file%column) == 0 .and. file%has_names()) then
        call file%read_names()
      else
        call file%read_disk(names, s)
      end if
    end do
    call file%close(disks%error)
    disks%there = [(any(file%column == k), k=1, size(column_names))]
    call move_alloc(file%rows, disks%table)
    call move_alloc(file%lines, disks%rows)
  end subroutine read_positions

  !> Reads the line of a disk, and stores the disk if it belongs to species s. If the first line
  !> contains numbers, the columns are x y or x y vx vy.
  subroutine read_disk(self, names, s)
    class(positions_t), intent(inout) :: self
    character(len=*), intent(in) :: names(:)                !! names of all species
    integer, intent(in) :: s
    real(real64) :: value(size(column_names))
    integer :: k, its_species

    if (size(self%column) == 0 .and. (self%n_words == 2 .or. self%n_words == 4)) self%column = [(k, k=1, self%n_words)]
    if (size(self%column) == 0) then
      self%problem = counted(int(self%n_words, int64), "number")//"; allowed: x y, or x y vx vy, " &
        //"or the columns that the first line names: "//joined(known_names, " ")
    else
      call self%require(known_names(self%column))
    end if
    value = 0
    its_species = s
    do k = 1, self%n_words
      if (self%problem /= "") return
      if (self%column(k) == species_column) then
        its_species = species_named(self%word(k), names)
        if (its_species == 0) self%problem = "there is no species "//shown(self%word(k))//"; known: 1 to " &
          //written(size(names))//", "//joined(names, ", ")
      else
        call self%read_number(k, value(self%column(k)))
      end if
    end do
    if (self%problem == "" .and. its_species == s) call self%append(value)
  end subroutine read_disk

  !> True if the line contains column names: at least one word is a known name, or no word is a
  !> number.
  function has_names(self) result(yes)
    class(positions_t), intent(in) :: self
    logical :: yes
    character(len=:), allocatable :: what
    real(real64) :: value
    logical :: some_number
    integer :: k

    some_number = .false.
    do k = 1, self%n_words
      yes = place_of(lower_case(self%word(k)), known_names) > 0
      if (yes) return
      call read_real(self%word(k), value, what)
      some_number = some_number .or. what == ""
    end do
    yes = .not. some_number
  end function has_names

  !> Reads the column names.
  subroutine read_names(self)
    class(positions_t), intent(inout) :: self
    character(len=:), allocatable :: word, unknown, advice
    integer :: k, place

    unknown = ""
    advice = ""
    do k = 1, self%n_words
      word = self%word(k)
      place = place_of(lower_case(word), known_names)
      if (place > 0) then
        if (any(self%column == place)) self%problem = "the column "//trim(known_names(place))//" is named twice"
        self%column = [self%column, place]
      else
        advice = suggestion(word, known_names)
        if (unknown /= "") advice = "known: "//joined(known_names, ", ")
        unknown = unknown//", "//shown(word)
      end if
    end do
    if (unknown /= "") then
      self%problem = "no column is called "//unknown(3:)//"; "//advice
    else if (self%problem == "" .and. .not. (any(self%column == 1) .and. any(self%column == 2))) then
      self%problem = "columns x and y are needed"
    else if (self%problem == "" .and. (any(self%column == 3) .neqv. any(self%column == 4))) then
      self%problem = "columns vx and vy go together"
    end if
  end subroutine read_names

  !> Index of the species with the given name or number; 0 if there is none.
  function species_named(word, names) result(s)
    character(len=*), intent(in) :: word, names(:)
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

end module position_file
