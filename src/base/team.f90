!> Threads of a run: their number, and the barriers at which they wait during serial steps. The
!> barriers are implemented in `team.c`.
module team
  use, intrinsic :: iso_c_binding, only: c_bool, c_int64_t
!$ use omp_lib, only: omp_set_num_threads
  implicit none
  private
  public :: make_team, many
  public :: barrier_t, close_barrier, is_last_at, join, open_barrier, release

  !> Minimum number of iterations of a loop that is divided among threads. The barrier at the end of
  !> such a loop costs microseconds. It costs milliseconds if other programs use the cores.
  integer, parameter :: many = 50000

  !> Thread barrier. A barrier in use must not be copied.
  type, bind(C) :: barrier_t
    integer(c_int64_t) :: storage(32)
  end type barrier_t

  interface
    !> Initialises a barrier without threads.
    subroutine open_barrier(barrier) bind(C, name="barrier_open")
      import :: barrier_t
      type(barrier_t), intent(out) :: barrier
    end subroutine open_barrier

    !> Registers the calling thread with the barrier. Each thread joins once, before any thread
    !> waits at the barrier.
    subroutine join(barrier) bind(C, name="barrier_join")
      import :: barrier_t
      type(barrier_t), intent(inout) :: barrier
    end subroutine join

    !> Registers the arrival of the calling thread at the barrier. The last thread to arrive returns
    !> with .true. and does not wait. It performs the serial step and then calls `release`. Until
    !> then the other threads wait in `arrive`.
    function is_last_at(barrier) result(yes) bind(C, name="barrier_arrive")
      import :: barrier_t, c_bool
      type(barrier_t), intent(inout) :: barrier
      logical(c_bool) :: yes
    end function is_last_at

    !> Releases the waiting threads. All data written by the calling thread are visible to them.
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

  !> Sets the number of threads of all parallel loops without a clause `num_threads`. In a build
  !> without OpenMP the number is always 1.
  subroutine make_team(n)
    integer, intent(in) :: n

!$ call omp_set_num_threads(n)
  end subroutine make_team

end module team
