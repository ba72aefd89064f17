!> The values of the input variables as a run uses them, by group and name.
!> The output file lists them all from here; `settings` holds them as typed data.
module parameter_values
  use kinds, only: int64, real64
  use parameters, only: name_length, row_of
  implicit none
  private
  public :: parameter_value_t, parameter_group_t, text_length

  integer, parameter :: text_length = 512      !! longest text value, in bytes

  !> One variable. The array of its kind is allocated; none is if it has no value.
  type :: parameter_value_t
    integer :: row = 0                         !! of the table
    character(len=name_length) :: name = ''
    character(len=8) :: kind = ''              !! 'integer', 'real', 'logical' or 'text'
    logical :: given = .false.                 !! by the user
    logical :: faulty = .false.                !! given, but nonsense that has been reported
    integer :: line = 0                        !! where: line of the file, or -k: override k
    integer :: elements = 0                    !! bit i: element i is given (name(i) = value)
    integer(int64), allocatable :: integers(:)
    real(real64), allocatable :: reals(:)
    logical, allocatable :: logicals(:)
    character(len=text_length), allocatable :: texts(:)
  contains
    procedure :: is_set
  end type parameter_value_t

  !> One group of the input, of the repeated ones one instance. The functions give the value of a
  !> variable, or what `otherwise` says if it has none.
  type :: parameter_group_t
    character(len=8) :: name = ''
    character(len=text_length) :: instance = ''  !! `name` of an obstacle or species; else blank
    integer :: line = 0                        !! of its first line in the file; 0 not there
    type(parameter_value_t), allocatable :: values(:)
  contains
    procedure :: integer_of, real_of, reals_of, text_of, logical_of
    procedure :: given, faulty, line_of
    procedure :: set_integer, set_reals, set_text, unset
  end type parameter_group_t

contains

  pure function is_set(self)
    class(parameter_value_t), intent(in) :: self
    logical :: is_set
    is_set = allocated(self%integers) .or. allocated(self%reals) .or. allocated(self%logicals) &
      .or. allocated(self%texts)
  end function is_set

  pure function integer_of(self, name, otherwise) result(value)
    class(parameter_group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(in) :: otherwise
    integer(int64) :: value
    value = otherwise
    associate (slot => self%values(row_of(self%name, name)))
      if (allocated(slot%integers)) value = slot%integers(1)
    end associate
  end function integer_of

  pure function real_of(self, name, otherwise) result(value)
    class(parameter_group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: otherwise
    real(real64) :: value
    value = otherwise
    associate (slot => self%values(row_of(self%name, name)))
      if (allocated(slot%reals)) value = slot%reals(1)
    end associate
  end function real_of

  pure function reals_of(self, name, otherwise) result(values)
    class(parameter_group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: otherwise(:)
    real(real64), allocatable :: values(:)
    associate (slot => self%values(row_of(self%name, name)))
      if (allocated(slot%reals)) then
        values = slot%reals
      else
        values = otherwise
      end if
    end associate
  end function reals_of

  !> Empty if it has no value.
  pure function text_of(self, name) result(value)
    class(parameter_group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: value
    value = ''
    associate (slot => self%values(row_of(self%name, name)))
      if (allocated(slot%texts)) value = trim(slot%texts(1))
    end associate
  end function text_of

  pure function logical_of(self, name) result(value)
    class(parameter_group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    logical :: value
    value = .false.
    associate (slot => self%values(row_of(self%name, name)))
      if (allocated(slot%logicals)) value = slot%logicals(1)
    end associate
  end function logical_of

  pure function given(self, name)
    class(parameter_group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    logical :: given
    given = self%values(row_of(self%name, name))%given
  end function given

  pure function faulty(self, name)
    class(parameter_group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    logical :: faulty
    faulty = self%values(row_of(self%name, name))%faulty
  end function faulty

  !> Where a variable is given; if it is not, where its group begins.
  pure function line_of(self, name) result(line)
    class(parameter_group_t), intent(in) :: self
    character(len=*), intent(in) :: name
    integer :: line
    line = self%values(row_of(self%name, name))%line
    if (line == 0) line = self%line
  end function line_of

  pure subroutine set_integer(self, name, value)
    class(parameter_group_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(in) :: value
    self%values(row_of(self%name, name))%integers = [value]
  end subroutine set_integer

  pure subroutine set_reals(self, name, values)
    class(parameter_group_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: values(:)
    self%values(row_of(self%name, name))%reals = values
  end subroutine set_reals

  pure subroutine set_text(self, name, value)
    class(parameter_group_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    character(len=*), intent(in) :: value
    character(len=text_length) :: padded
    padded = value
    self%values(row_of(self%name, name))%texts = [padded]
  end subroutine set_text

  pure subroutine unset(self, name)
    class(parameter_group_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    associate (slot => self%values(row_of(self%name, name)))
      if (allocated(slot%integers)) deallocate (slot%integers)
      if (allocated(slot%reals)) deallocate (slot%reals)
      if (allocated(slot%texts)) deallocate (slot%texts)
    end associate
  end subroutine unset

end module parameter_values
