!> Finds names among many, in a time that does not grow with their number.
module name_index
  use kinds, only: int64
  implicit none
  private
  public :: name_index_t

  !> A hash table: names with the same remainder form a chain.
  type :: name_index_t
    private
    character(len=:), allocatable :: names(:)
    integer, allocatable :: first(:)           !! of each chain, as a place in `names`; 0: it has none
    integer, allocatable :: next(:)            !! in the chain of each name
  contains
    procedure :: place_of
  end type name_index_t

  interface name_index_t
    module procedure new_name_index
  end interface name_index_t

contains

  !> The index of a list of names.
  pure function new_name_index(names) result(new)
    character(len=*), intent(in) :: names(:)
    type(name_index_t) :: new
    integer :: k, chain

    allocate (new%names, source=names)
    allocate (new%first(size(names)), source=0)
    allocate (new%next(size(names)))
    do k = size(names), 1, -1                  ! the first of equal names comes first in its chain
      chain = chain_of(names(k), size(names))
      new%next(k) = new%first(chain)
      new%first(chain) = k
    end do
  end function new_name_index

  !> Place of the first of these names in the list; 0 if it is not there.
  pure function place_of(self, name) result(place)
    class(name_index_t), intent(in) :: self
    character(len=*), intent(in) :: name
    integer :: place

    place = 0
    if (size(self%first) > 0) place = self%first(chain_of(name, size(self%first)))
    do while (place > 0)
      if (self%names(place) == name) exit
      place = self%next(place)
    end do
  end function place_of

  !> Number of the chain of a name, from 1 to n.
  pure function chain_of(name, n) result(chain)
    character(len=*), intent(in) :: name
    integer, intent(in) :: n
    integer :: chain, i
    integer(int64) :: sum
    integer(int64), parameter :: prime = 2147483647

    sum = 0
    do i = 1, len_trim(name)
      sum = modulo(131*sum + iachar(name(i:i)), prime)
    end do
    chain = 1 + int(modulo(sum, int(n, int64)))
  end function chain_of

end module name_index
