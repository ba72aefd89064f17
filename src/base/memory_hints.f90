!> Prefetch hints, which Fortran cannot express. They affect only the speed of a run, never its
!> results. The code that depends on the compiler and the operating system is in `memory_hints.c`;
!> without the macro `MEMORY_HINTS`, a prefetch has no effect.
module memory_hints
  use, intrinsic :: iso_c_binding, only: c_double, c_int32_t
  implicit none
  private
  public :: prefetch

  !> Starts to load the cache line of a variable for a later read, and returns without waiting for the data.
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
