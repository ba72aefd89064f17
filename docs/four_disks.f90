!> Simulates four disks, and prints their states and predicted events after each event. The output consists of JSON lines for
!> docs/queue_page.py.
program four_disks
  use, intrinsic :: iso_fortran_env, only: error_unit
  use kinds, only: int32, int64, real64
  use box_geometry, only: box_t
  use cell_grid, only: cell_grid_t
  use errors, only: error_t
  use event_driven, only: event_driven_t
  use evolution, only: limits_t
  use partners, only: is_wall
  use simulation_state, only: simulation_t
  implicit none

  integer, parameter :: n = 4, iterations = 6
  real(real64), parameter :: radius = 0.3_real64     !! [length]
  real(real64), parameter :: x(2, n) = reshape([0.8_real64, 3.1_real64, 2.0_real64, 1.1_real64, &
    2.0_real64, 2.8_real64, 3.4_real64, 2.7_real64], [2, n])
  real(real64), parameter :: v(2, n) = reshape([0.8_real64, -0.9_real64, 0.3_real64, -0.1_real64, &
    -0.3_real64, -0.2_real64, 0.2_real64, 0.3_real64], [2, n])
  type(simulation_t) :: sim
  type(event_driven_t) :: dynamics
  type(error_t), allocatable :: error
  integer :: iteration

  sim = four()
  allocate (cell_grid_t :: dynamics%search)
  call dynamics%start(sim)
  do iteration = 0, iterations
    if (iteration > 0) call dynamics%advance(sim, limits_t(iterations=1_int64), error)
    if (allocated(error)) then
      write (error_unit, "(a)") error%message
      stop 1
    end if
    call show(sim)
  end do

contains

  !> Defines the system: four disks in a box of 4 by 4 with elastic walls.
  function four() result(sim)
    type(simulation_t) :: sim
    integer(int32) :: i

    allocate (sim%species(1))
    sim%box%box_t = box_t()
    call sim%make_room(n)
    sim%law%restitution = reshape([1.0_real64], [1, 1])
    sim%box%upper = 4
    sim%species(1)%count = n
    sim%disk%radius = radius
    do i = 1, n
      sim%disk(i)%x = x(:, i)
      sim%disk(i)%v = v(:, i)
      sim%tag(i)%id = i
    end do
  end function four

  !> Writes the time, and for each disk its motion and its predicted event.
  subroutine show(sim)
    type(simulation_t), intent(in) :: sim
    integer(int32) :: i, code
    character(len=:), allocatable :: kind
    logical :: stale

    write (*, "(a,es24.16e3,a,i0,a)") '{"now": ', sim%now, ', "events": ', sim%tally%events, ', "disks": ['
    do i = 1, n
      code = sim%disk(i)%partner
      kind = "crossing"
      stale = .false.
      if (code > 0) then
        kind = "disk"
        stale = sim%disk(code)%collision_counter /= sim%tag(i)%partner_counter
        code = sim%tag(code)%id
      else if (is_wall(code)) then
        kind = "side"
      end if
      write (*, "(a,i0,3(a,i0),5(a,es24.16e3),3a,l1,a)") '{"id": ', sim%tag(i)%id, ', "partner": ', code, ', "column": ', &
        sim%tag(i)%cell(1), ', "row": ', sim%tag(i)%cell(2), ', "x": ', sim%disk(i)%x(1), ', "y": ', sim%disk(i)%x(2), &
        ', "vx": ', sim%disk(i)%v(1), ', "vy": ', sim%disk(i)%v(2), ', "clock": ', sim%disk(i)%clock, &
        ', "kind": "', kind, '", "stale": "', stale, '"'
      write (*, "(a,es24.16e3,a)") ', "due": ', sim%disk(i)%event_time, trim(merge("},", "} ", i < n))
    end do
    write (*, "(a)") "]}"
  end subroutine show

end program four_disks
