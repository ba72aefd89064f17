!> Access to the variables of one input group, for types that read their own settings.
module group_fields
  use kinds, only: int64, real64
  use fields, only: fields_t
  use input_groups, only: group_t
  use input_problems, only: problem_list_t
  use texts, only: counted
  use variables, only: row_of
  implicit none
  private
  public :: group_fields_t

  type, extends(fields_t) :: group_fields_t
    type(group_t) :: group
    type(problem_list_t) :: problems           !! problems of the entire input
  contains
    procedure :: read_real
    procedure :: read_reals
    procedure :: read_pairs
    procedure :: read_integer
    procedure :: read_integers
    procedure :: read_logical
    procedure :: is_sound
    procedure :: complain
  end type group_fields_t

contains

  !> Stores the value of a real variable; an unset variable leaves the default unchanged.
  subroutine read_real(self, name, value)
    class(group_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(inout) :: value

    value = self%group%real_of(name, value)
  end subroutine read_real

  !> Stores the values of a real variable; an unset variable leaves the defaults unchanged.
  subroutine read_reals(self, name, values)
    class(group_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(inout) :: values(:)

    associate (given => self%group%reals_of(name))
      if (size(given) == size(values)) values = given
    end associate
  end subroutine read_reals

  !> Stores the values of a real variable as pairs. An odd number of values is reported as a
  !> problem.
  subroutine read_pairs(self, name, pairs)
    class(group_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), allocatable, intent(out) :: pairs(:, :)

    associate (values => self%group%reals_of(name))
      if (modulo(size(values), 2) == 1) call self%complain(name, counted(size(values, kind=int64), "value")// &
        "; each disk has two, x and y")
      pairs = reshape(values, [2, size(values)/2])
    end associate
  end subroutine read_pairs

  !> Stores the value of an integer variable; an unset variable leaves the default unchanged.
  subroutine read_integer(self, name, value)
    class(group_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(inout) :: value

    value = self%group%integer_of(name, value)
  end subroutine read_integer

  !> Stores the values of an integer variable; an unset variable leaves the defaults unchanged.
  subroutine read_integers(self, name, values)
    class(group_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer, intent(inout) :: values(:)

    associate (slot => self%group%values(row_of(self%group%name, name)))
      if (slot%is_set()) values = int(slot%integers())
    end associate
  end subroutine read_integers

  !> Stores the value of a logical variable; an unset variable leaves the default unchanged.
  subroutine read_logical(self, name, value)
    class(group_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    logical, intent(inout) :: value

    if (self%group%text_of(name) /= "") value = self%group%text_of(name) == ".true."
  end subroutine read_logical

  !> True if the user has set the variable and its value is valid.
  function is_sound(self, name) result(yes)
    class(group_fields_t), intent(in) :: self
    character(len=*), intent(in) :: name
    logical :: yes

    yes = self%group%given(name) .and. .not. self%group%faulty(name)
  end function is_sound

  !> Reports an invalid value of a variable.
  subroutine complain(self, name, what)
    class(group_fields_t), intent(inout) :: self
    character(len=*), intent(in) :: name, what

    call self%group%complain(name, what, self%problems)
  end subroutine complain

end module group_fields
