!> The threads of a run: how many share a loop, and where they wait for each other while one of them does something for all.
!> How they wait is in `team.c`.
module team
  use, intrinsic :: iso_c_binding, only: c_bool, c_int64_t
!$ use omp_lib, only: omp_set_num_threads
  implicit none
  private
  public :: make_team, many
  public :: barrier_t, close_barrier, is_last_at, join, open_barrier, release

  !> Turns of a loop from which it pays to share it: threads that meet at its end cost each other some microseconds, and on
  !> busy cores thousandths of a second.
  integer, parameter :: many = 50000

  !> Not to be copied while threads use it.
  type, bind(C) :: barrier_t
    integer(c_int64_t) :: storage(32)
  end type barrier_t

  interface
    !> Makes a barrier for threads that are still to join.
    subroutine open_barrier(barrier) bind(C, name="barrier_open")
      import :: barrier_t
      type(barrier_t), intent(out) :: barrier
    end subroutine open_barrier

    !> The thread that calls is one of those that wait for each other: each joins once, before any waits.
    subroutine join(barrier) bind(C, name="barrier_join")
      import :: barrier_t
      type(barrier_t), intent(inout) :: barrier
    end subroutine join

    !> Waits until all have come and the last of them has released the others. That one does not wait: it is told, and
    !> does what is to be done for all before it releases them.
    function is_last_at(barrier) result(yes) bind(C, name="barrier_arrive")
      import :: barrier_t, c_bool
      type(barrier_t), intent(inout) :: barrier
      logical(c_bool) :: yes
    end function is_last_at

    !> Lets the others go on, who find what this thread has written.
    subroutine release(barrier) bind(C, name="barrier_release")
      import :: barrier_t
      type(barrier_t), intent(inout) :: barrier
    end subroutine release

    !> Takes the barrier away, when nobody waits any more.
    subroutine close_barrier(barrier) bind(C, name="barrier_close")
      import :: barrier_t
      type(barrier_t), intent(inout) :: barrier
    end subroutine close_barrier
  end interface

contains

  !> From now on n threads share a loop, unless the loop says otherwise. Without OpenMP it is one.
  subroutine make_team(n)
    integer, intent(in) :: n

!$ call omp_set_num_threads(n)
  end subroutine make_team

end module team
