!> A group of the input for tests, which records the variables that are read.
module recorded_fields
  use fields, only: fields_t
  use kinds, only: int64, real64
  implicit none
  private
  public :: recorded_fields_t

  type, extends(fields_t) :: recorded_fields_t
    character(len=400) :: names = ""
  contains
    procedure :: has_read
    procedure :: note
    procedure :: read_real
    procedure :: read_reals
    procedure :: read_pairs
    procedure :: read_integer
    procedure :: read_integers
    procedure :: read_logical
    procedure :: is_sound
    procedure :: complain
  end type recorded_fields_t

contains

  !> Whether a variable has been read.
  pure function has_read(self, name) result(yes)
    class(recorded_fields_t), intent(in) :: self
    character(len=*), intent(in) :: name
    logical :: yes

    yes = index(self%names, " "//trim(name)//" ") > 0
  end function has_read

  !> Notes that a variable is read.
  pure subroutine note(self, name)
    class(recorded_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name

    self%names = trim(self%names)//" "//name
  end subroutine note

  !> See `fields`; the value stays the default.
  subroutine read_real(self, name, value)
    class(recorded_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(inout) :: value

    call self%note(name)
  end subroutine read_real

  !> See `read_real`.
  subroutine read_reals(self, name, values)
    class(recorded_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(inout) :: values(:)

    call self%note(name)
  end subroutine read_reals

  !> See `read_real`.
  subroutine read_pairs(self, name, pairs)
    class(recorded_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), allocatable, intent(out) :: pairs(:, :)

    allocate (pairs(2, 0))
    call self%note(name)
  end subroutine read_pairs

  !> See `read_real`.
  subroutine read_integer(self, name, value)
    class(recorded_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(inout) :: value

    call self%note(name)
  end subroutine read_integer

  !> See `read_real`.
  subroutine read_integers(self, name, values)
    class(recorded_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(inout) :: values(:)

    call self%note(name)
  end subroutine read_integers

  !> See `read_real`.
  subroutine read_logical(self, name, value)
    class(recorded_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    logical, intent(inout) :: value

    call self%note(name)
  end subroutine read_logical

  !> All variables are set to valid values.
  function is_sound(self, name) result(yes)
    class(recorded_fields_t), intent(in) :: self
    character(len=*), intent(in) :: name
    logical :: yes

    yes = .true.
  end function is_sound

  !> Problems are not recorded.
  subroutine complain(self, name, what)
    class(recorded_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name, what
  end subroutine complain

end module recorded_fields
