!> Hints about memory, to processor and system. They change nothing but the time that a run takes.
module memory_hints
  use, intrinsic :: iso_c_binding, only: c_double, c_int32_t
  implicit none
  private
  public :: prefetch

  !> Asks for the cache line of a variable, and does not wait for it, as a read would.
  interface prefetch
    subroutine prefetch_integer(item) bind(c, name="prefetch_line")
      import :: c_int32_t
      integer(c_int32_t), intent(in) :: item
    end subroutine prefetch_integer

    subroutine prefetch_real(item) bind(c, name="prefetch_line")
      import :: c_double
      real(c_double), intent(in) :: item
    end subroutine prefetch_real
  end interface prefetch

end module memory_hints
