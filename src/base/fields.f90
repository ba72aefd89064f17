!> Self-describing settings: a type lists the variables of its input group in a sequence of calls.
!> Each call names a variable and the component that stores its value.
module fields
  use kinds, only: int64, real64
  implicit none
  private
  public :: fields_t

  !> Variables of one input group.
  type, abstract :: fields_t
  contains
    generic :: read => read_real, read_reals, read_pairs, read_integer, read_integers, read_logical
    procedure(read_real), deferred :: read_real
    procedure(read_reals), deferred :: read_reals
    procedure(read_pairs), deferred :: read_pairs
    procedure(read_integer), deferred :: read_integer
    procedure(read_integers), deferred :: read_integers
    procedure(read_logical), deferred :: read_logical
    procedure(is_sound), deferred :: is_sound
    procedure(complain), deferred :: complain
  end type fields_t

  abstract interface

    !> Stores the value of a variable; an unset variable leaves the default in the component.
    subroutine read_real(self, name, value)
      import :: fields_t, real64
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(real64), intent(inout) :: value
    end subroutine read_real

    !> Array version of `read_real`.
    subroutine read_reals(self, name, values)
      import :: fields_t, real64
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(real64), intent(inout) :: values(:)
    end subroutine read_reals

    !> Stores a list x1, y1, x2, y2, ... of any length. An unset variable gives an array of shape
    !> (2,0).
    subroutine read_pairs(self, name, pairs)
      import :: fields_t, real64
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(real64), allocatable, intent(out) :: pairs(:, :)      !! (2,n)
    end subroutine read_pairs

    !> Integer version of `read_real`.
    subroutine read_integer(self, name, value)
      import :: fields_t, int64
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(int64), intent(inout) :: value
    end subroutine read_integer

    !> Integer-array version of `read_real`.
    subroutine read_integers(self, name, values)
      import :: fields_t
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(inout) :: values(:)
    end subroutine read_integers

    !> Logical version of `read_real`.
    subroutine read_logical(self, name, value)
      import :: fields_t
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      logical, intent(inout) :: value
    end subroutine read_logical

    !> True if the user has set the variable and its value is valid.
    function is_sound(self, name) result(yes)
      import :: fields_t
      class(fields_t), intent(in) :: self
      character(len=*), intent(in) :: name
      logical :: yes
    end function is_sound

    !> Reports an invalid value of a variable.
    subroutine complain(self, name, what)
      import :: fields_t
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      character(len=*), intent(in) :: what        !! the problem, and the allowed values
    end subroutine complain
  end interface

end module fields
