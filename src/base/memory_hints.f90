!> Hints about memory that Fortran cannot express: they change nothing but the time that a run takes. The C file
!> beside this one holds what depends on the compiler and the system; without it a prefetch does nothing.
module memory_hints
  use, intrinsic :: iso_c_binding, only: c_double, c_int32_t
  implicit none
  private
  public :: prefetch

  !> Starts to load the cache line of a variable without waiting for it, as a read would.
  interface prefetch
    subroutine prefetch_integer(item) bind(C)
      import :: c_int32_t
      integer(c_int32_t), intent(in) :: item
    end subroutine prefetch_integer

    subroutine prefetch_real(item) bind(C)
      import :: c_double
      real(c_double), intent(in) :: item
    end subroutine prefetch_real
  end interface prefetch

end module memory_hints
