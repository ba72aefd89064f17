!> The threads of a run: the number of threads, and the barriers at which threads wait while one thread performs a serial step. The
!> barriers are implemented in `team.c`.
module team
  use, intrinsic :: iso_c_binding, only: c_bool, c_int64_t
!$ use omp_lib, only: omp_set_num_threads
  implicit none
  private
  public :: make_team, many
  public :: barrier_t, close_barrier, is_last_at, join, open_barrier, release

  !> Smallest number of iterations for which a loop is divided among threads. The barrier at the end of the loop costs microseconds,
  !> or milliseconds if other programs use the cores.
  integer, parameter :: many = 50000

  !> A barrier for threads. A barrier must not be copied while threads use the barrier.
  type, bind(C) :: barrier_t
    integer(c_int64_t) :: storage(32)
  end type barrier_t

  interface
    !> Initialises a barrier, with which no threads are registered at first.
    subroutine open_barrier(barrier) bind(C, name="barrier_open")
      import :: barrier_t
      type(barrier_t), intent(out) :: barrier
    end subroutine open_barrier

    !> Registers the calling thread with the barrier. Each thread is registered once, before any thread waits at the barrier.
    subroutine join(barrier) bind(C, name="barrier_join")
      import :: barrier_t
      type(barrier_t), intent(inout) :: barrier
    end subroutine join

    !> Registers the arrival of the calling thread at the barrier. The result is .true. for the last thread that arrives. The last
    !> thread does not wait, performs the serial step, and then calls `release`. All other threads wait in `arrive` until the last
    !> thread has called `release`.
    function is_last_at(barrier) result(yes) bind(C, name="barrier_arrive")
      import :: barrier_t, c_bool
      type(barrier_t), intent(inout) :: barrier
      logical(c_bool) :: yes
    end function is_last_at

    !> Releases the threads that wait at the barrier. The released threads can read all data that the calling thread has written
    !> before the call.
    subroutine release(barrier) bind(C, name="barrier_release")
      import :: barrier_t
      type(barrier_t), intent(inout) :: barrier
    end subroutine release

    !> Destroys a barrier at which no thread is waiting.
    subroutine close_barrier(barrier) bind(C, name="barrier_close")
      import :: barrier_t
      type(barrier_t), intent(inout) :: barrier
    end subroutine close_barrier
  end interface

contains

  !> Sets the number of threads for parallel loops that do not specify a number of threads. In a build without OpenMP the number of
  !> threads is always 1.
  subroutine make_team(n)
    integer, intent(in) :: n

!$ call omp_set_num_threads(n)
  end subroutine make_team

end module team
