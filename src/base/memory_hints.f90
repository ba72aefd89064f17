!> Prefetch hints, which Fortran cannot express. Prefetches change the speed of a run but never its
!> results. The C file `memory_hints.c` contains the code that depends on compiler and operating
!> system; if the macro `MEMORY_HINTS` is undefined, a prefetch does nothing.
module memory_hints
  use, intrinsic :: iso_c_binding, only: c_double, c_int32_t
  implicit none
  private
  public :: prefetch

  !> Starts loading the cache line of a variable for a later read, without waiting for the data.
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
