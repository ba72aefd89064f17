!> Hints about memory, to processor and system. They change nothing but the time that a run takes.
module memory_hints
  use, intrinsic :: iso_c_binding, only: c_double, c_int32_t, c_int64_t
  implicit none
  private
  public :: advise_huge_pages, prefetch

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

  !> Asks for huge pages behind an array of so many bytes that begins with `item`: the processor knows by heart where
  !> few pages are, but not hundreds of thousands.
  interface advise_huge_pages
    subroutine advise_huge_pages_from_integer(item, bytes) bind(c, name="advise_huge_pages")
      import :: c_int32_t, c_int64_t
      integer(c_int32_t), intent(in) :: item
      integer(c_int64_t), value :: bytes
    end subroutine advise_huge_pages_from_integer

    subroutine advise_huge_pages_from_real(item, bytes) bind(c, name="advise_huge_pages")
      import :: c_double, c_int64_t
      real(c_double), intent(in) :: item
      integer(c_int64_t), value :: bytes
    end subroutine advise_huge_pages_from_real
  end interface advise_huge_pages

end module memory_hints
