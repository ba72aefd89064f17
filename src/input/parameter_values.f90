!> The values of the input variables as a run uses them, by group and name.
!> The output file lists them all from here; `settings` holds them as typed data.
module parameter_values
  use kinds, only: int64, real64
  use parameters, only: name_length, row_of
  use texts, only: written, written_exactly
  implicit none
  private
  public :: parameter_value_t, parameter_group_t, text_length, values_text

  integer, parameter :: text_length = 512      !! longest text value, in bytes

  !> One variable. The array of its kind is allocated; none is if it has no value.
  type :: parameter_value_t
    integer :: row = 0                         !! of the table
    character(len=name_length) :: name = ""
    character(len=8) :: kind = ""              !! 'integer', 'real', 'logical' or 'text'
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
    character(len=8) :: name = ""
    character(len=text_length) :: instance = ""  !! `name` of an obstacle or species; else blank
    integer :: line = 0                        !! of its first line in the file; 0 not there
    type(parameter_value_t), allocatable :: values(:)
  contains
    procedure :: integer_of, real_of, reals_of, text_of, logical_of
    procedure :: given, faulty, line_of
    procedure :: put_integer, put_reals, put_text, unset
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

    value = ""
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

  pure subroutine put_integer(self, name, value)
    class(parameter_group_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    integer(int64), intent(in) :: value

    self%values(row_of(self%name, name))%integers = [value]
  end subroutine put_integer

  pure subroutine put_reals(self, name, values)
    class(parameter_group_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    real(real64), intent(in) :: values(:)

    self%values(row_of(self%name, name))%reals = values
  end subroutine put_reals

  pure subroutine put_text(self, name, value)
    class(parameter_group_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    character(len=*), intent(in) :: value
    character(len=text_length) :: padded

    padded = value
    self%values(row_of(self%name, name))%texts = [padded]
  end subroutine put_text

  pure subroutine unset(self, name)
    class(parameter_group_t), intent(inout) :: self
    character(len=*), intent(in) :: name

    associate (slot => self%values(row_of(self%name, name)))
      if (allocated(slot%integers)) deallocate (slot%integers)
      if (allocated(slot%reals)) deallocate (slot%reals)
      if (allocated(slot%texts)) deallocate (slot%texts)
    end associate
  end subroutine unset

  !> Every value as it is used, one variable to a line: `species.bed.radius = 0.005`.
  pure function values_text(groups) result(text)
    type(parameter_group_t), intent(in) :: groups(:)
    character(len=:), allocatable :: text
    character(len=:), allocatable :: prefix, values
    integer :: g, v

    text = ""
    do g = 1, size(groups)
      prefix = trim(groups(g)%name)//"."
      if (groups(g)%instance /= "") prefix = prefix//trim(groups(g)%instance)//"."
      do v = 1, size(groups(g)%values)
        values = value_text(groups(g)%values(v))
        if (values /= "") text = text//prefix//trim(groups(g)%values(v)%name)//" = "//values//new_line("a")
      end do
    end do
  end function values_text

  !> The values of a variable as one would write them in a file; empty if it has none.
  pure function value_text(value) result(text)
    type(parameter_value_t), intent(in) :: value
    character(len=:), allocatable :: text
    integer, parameter :: most = 100               !! longer lists are cut
    integer :: k, n

    n = 0
    text = ""
    if (allocated(value%integers)) n = size(value%integers)
    if (allocated(value%reals)) n = size(value%reals)
    if (allocated(value%logicals)) n = size(value%logicals)
    if (allocated(value%texts)) n = size(value%texts)
    do k = 1, min(n, most)
      if (k > 1) text = text//", "
      if (allocated(value%integers)) text = text//written(value%integers(k))
      if (allocated(value%reals)) text = text//written_exactly(value%reals(k))
      if (allocated(value%logicals)) text = text//trim(merge(".true. ", ".false.", value%logicals(k)))
      if (allocated(value%texts)) text = text//quoted(trim(value%texts(k)))
    end do
    if (n > most) text = text//", ... ! "//written(n)//" values"
  end function value_text

  !> In quotes, with quotes inside doubled.
  pure function quoted(text)
    character(len=*), intent(in) :: text
    character(len=:), allocatable :: quoted
    integer :: i

    quoted = "'"
    do i = 1, len(text)
      quoted = quoted//text(i:i)
      if (text(i:i) == "'") quoted = quoted//"'"
    end do
    quoted = quoted//"'"
  end function quoted

end module parameter_values
