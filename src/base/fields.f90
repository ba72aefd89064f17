!> Settings that a type reads itself: in one sequence of calls the type names the variables of its
!> input group, each with the component that receives the value.
module fields
  use kinds, only: int64, real64
  implicit none
  private
  public :: fields_t

  !> The variables of one group of the input.
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

    !> Stores the value of a variable. If the variable has no value, the component keeps its
    !> default.
    subroutine read_real(self, name, value)
      import :: fields_t, real64
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(real64), intent(inout) :: value
    end subroutine read_real

    !> Stores the values of a variable, as `read_real`.
    subroutine read_reals(self, name, values)
      import :: fields_t, real64
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(real64), intent(inout) :: values(:)
    end subroutine read_reals

    !> Stores a list x1, y1, x2, y2, ... of any length; the shape is (2,0) if the variable has no
    !> value.
    subroutine read_pairs(self, name, pairs)
      import :: fields_t, real64
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      real(real64), allocatable, intent(out) :: pairs(:, :)      !! (2,n)
    end subroutine read_pairs

    !> Stores an integer, as `read_real`.
    subroutine read_integer(self, name, value)
      import :: fields_t, int64
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer(int64), intent(inout) :: value
    end subroutine read_integer

    !> Stores several integers, as `read_real`.
    subroutine read_integers(self, name, values)
      import :: fields_t
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      integer, intent(inout) :: values(:)
    end subroutine read_integers

    !> Stores a logical value, as `read_real`.
    subroutine read_logical(self, name, value)
      import :: fields_t
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      logical, intent(inout) :: value
    end subroutine read_logical

    !> Whether the user has set a variable to a valid value.
    function is_sound(self, name) result(yes)
      import :: fields_t
      class(fields_t), intent(in) :: self
      character(len=*), intent(in) :: name
      logical :: yes
    end function is_sound

    !> Reports a problem of a variable.
    subroutine complain(self, name, what)
      import :: fields_t
      class(fields_t), intent(inout) :: self
      character(len=*), intent(in) :: name
      character(len=*), intent(in) :: what        !! the problem and the allowed values
    end subroutine complain
  end interface

end module fields
