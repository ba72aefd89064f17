!> Recycling: at regular intervals, each disk with its centre in one region is moved to a random
!> position in another region. A discharging hopper, or a gas escaping through an opening, thereby
!> reaches a steady state. The random numbers depend only on the seed, the id of the disk and the
!> number of the kick.
module recycle
  use kinds, only: int32, int64, never, real64
  use box_geometry, only: box_t
  use fields, only: fields_t
  use free_positions, only: check_obstacles, check_region, check_room, find_position, present_packing
  use disks, only: list_by_id
  use kicks, only: change_spin, change_velocity, interrupt_disk
  use packing, only: packing_t
  use random_stream, only: key_of_draws, random_stream_t, recycled_disks
  use simulation_state, only: drive_t, simulation_t
  use tally, only: drive_energy
  use variable_rows, only: choice_t, in_motion, variable_t
  implicit none
  private
  public :: recycle_t, choices, count_choice, count_word, rows, word

  character(len=*), parameter :: word = "recycle", count_word = "recycled"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("kind", word, "Recycling, as in a hopper that is refilled: each disk in from_region moves to a random free position " &
      //"in to_region, with a new velocity. Displacements are not defined in a run with recycling.")]
  type(choice_t), parameter :: count_choice = &
    choice_t("frame_columns", count_word, "Number of times that each disk has been recycled (drive.kind = 'recycle').")
  type(variable_t), parameter :: rows(*) = [ &
    variable_t("drive", "velocity", "real", 2, "required", "0, -1", &
      "Velocity (x, y) of recycled disks, which then do not rotate. Either velocity or temperature must be given.", &
      unit="length/time", goes_with="kind "//word, excludes="temperature", may_change=in_motion, &
      otherwise="none; velocity or temperature must be given where it applies"), &
    variable_t("drive", "from_region", "real", 4, "required", "0, 1, 0, 0.1", &
      "Region (xlo, xhi, ylo, yhi) from which disks are recycled. At all multiples of the time interval, each disk with its " &
      //"centre in this region moves to a random free position in to_region, in the order of the ids. If none of 100 random " &
      //"positions is free for a disk, the disk stays where it is until the next multiple.", &
      unit="length", goes_with="kind "//word, may_change=in_motion), &
    variable_t("drive", "to_region", "real", 4, "required", "0, 1, 0.9, 1", &
      "Region (xlo, xhi, ylo, yhi) to which recycled disks move. Recycled disks lie completely inside this region. Only along a " &
      //"periodic axis that the region spans may recycled disks overlap its edges. The region must not overlap from_region, an " &
      //"obstacle or a straight wall.", &
      unit="length", goes_with="kind "//word, may_change=in_motion)]

  type, extends(drive_t) :: recycle_t
    !> Disks are taken from this region: xlo, xhi, ylo, yhi [length].
    real(real64) :: from_region(4) = 0.0_real64
    !> Disks are moved to this region: xlo, xhi, ylo, yhi [length].
    real(real64) :: to_region(4) = 0.0_real64
    !> Velocity of recycled disks if `temperature` is 0 [length/time].
    real(real64) :: velocity(2) = 0.0_real64
    !> kT of the Maxwell distribution from which the velocities of recycled disks are drawn; 0 for a
    !> fixed velocity [energy].
    real(real64) :: temperature = 0.0_real64
  contains
    procedure :: read => read_regions
    procedure :: check
    procedure :: conflict
    procedure :: kick => recycle_disks
    procedure :: speed2
    procedure :: acts_on_all
    procedure :: moves_disks
    procedure :: can_act
    procedure :: counter
  end type recycle_t

contains

  !> Reads the variables of recycling.
  subroutine read_regions(self, fields)
    class(recycle_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields

    call fields%read("temperature", self%temperature)
    call fields%read("velocity", self%velocity)
    call fields%read("from_region", self%from_region)
    call fields%read("to_region", self%to_region)
  end subroutine read_regions

  !> Checks the two regions, which must lie in the box and must not overlap. The region to which
  !> disks are moved must be free of obstacles and wide enough for a disk.
  subroutine check(self, fields, box, count, radius)
    class(recycle_t), intent(in) :: self
    class(fields_t), intent(inout) :: fields
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: count(:)
    real(real64), intent(in) :: radius(:)
    real(real64) :: largest                                  ! largest radius of the recycled disks [length]
    logical :: sound(2)
    integer :: k

    if (fields%is_sound("temperature") .and. .not. self%temperature > 0) &
      call fields%complain("temperature", "0 needs kind = 'active'; allowed: a number > 0, or velocity")
    call check_region(fields, "from_region", self%from_region, box, sound(1))
    call check_region(fields, "to_region", self%to_region, box, sound(2))
    if (.not. all(sound)) return
    associate (from => self%from_region, to => self%to_region)
      if (all(from([1, 3]) < to([2, 4]) .and. to([1, 3]) < from([2, 4]))) then
        call fields%complain("to_region", "it overlaps drive.from_region, so that disks would be recycled again and again")
        return
      end if
      largest = maxval(radius, mask=self%acts_on([(k, k=1, size(radius))]))
      call check_room(fields, "to_region", to, box, largest)
      call check_obstacles(fields, "to_region", to, box, largest)
    end associate
  end subroutine check

  !> Recycled disks jump, so that their displacements are undefined.
  pure function conflict(self, setting) result(reason)
    class(recycle_t), intent(in) :: self
    character(len=*), intent(in) :: setting
    character(len=:), allocatable :: reason

    reason = ""
    if (setting == "box.shear_rate" .or. setting == "source") reason = "drive.kind = 'recycle'"
    if (setting == "output.helfand") reason = "drive.kind = 'recycle': recycled disks jump"
  end function conflict

  !> Mean square of the velocity of recycled disks.
  pure function speed2(self, mass)
    class(recycle_t), intent(in) :: self
    real(real64), intent(in) :: mass                         !! [mass]
    real(real64) :: speed2                                   !! [(length/time)**2]

    speed2 = 2*self%temperature/mass + sum(self%velocity**2)
  end function speed2

  !> Recycling changes only the velocities of the disks that it moves.
  pure function acts_on_all(self) result(yes)
    class(recycle_t), intent(in) :: self
    logical :: yes

    yes = .false.
  end function acts_on_all

  !> Recycling moves disks.
  pure function moves_disks(self) result(yes)
    class(recycle_t), intent(in) :: self
    logical :: yes

    yes = .true.
  end function moves_disks

  !> True if the centre of any disk is in `from_region`. The region stays empty if no further event
  !> can occur, because no other disk then enters it.
  pure function can_act(self, sim) result(yes)
    class(recycle_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    logical :: yes
    integer(int32) :: i

    yes = .false.
    do i = 1, sim%n_disks()
      yes = is_due(self, sim, i)
      if (yes) return
    end do
  end function can_act

  !> Name of the counter that stores how often each disk has been recycled.
  pure function counter(self) result(name)
    class(recycle_t), intent(in) :: self
    character(len=:), allocatable :: name

    name = count_word
  end function counter

  !> Moves each disk with its centre in `from_region` to a free position in `to_region`, in the
  !> order of the ids, and returns the list of moved disks. At a free position the disk overlaps no
  !> other disk, no obstacle and no side. If there is none, the disk is not moved. The old positions
  !> of moved disks count as occupied until the procedure returns.
  subroutine recycle_disks(self, sim, kicked)
    class(recycle_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), allocatable, intent(out) :: kicked(:)    !! indices of the moved disks
    type(packing_t), allocatable :: packing
    type(random_stream_t) :: stream
    integer(int32), allocatable :: due(:)
    real(real64) :: x(2)                                     ! new position [length]
    integer(int64) :: key
    integer(int32) :: k, n, n_moved
    logical :: free

    n = sim%n_disks()
    call list_by_id(sim%tag, [(is_due(self, sim, k), k=1, n)], due)
    allocate (kicked(size(due)))
    n_moved = 0
    if (size(due) > 0) packing = present_packing(sim, self%to_region, size(due))
    key = key_of_draws(sim%seed, recycled_disks)
    do k = 1, size(due, kind=int32)
      associate (i => due(k))
        call stream%seed_disk(key, sim%tag(i)%id, sim%n_kicks)
        call find_position(self%to_region, sim, packing, sim%disk(i)%radius, stream, x, free)
        if (.not. free) cycle
        call move_disk(self, sim, i, x, stream)
        sim%drive_count(sim%tag(i)%id) = sim%drive_count(sim%tag(i)%id) + 1
        n_moved = n_moved + 1
        kicked(n_moved) = i
        call packing%add(n + n_moved, int(sim%tag(i)%species, int32), x, sim%disk(i)%radius)
      end associate
    end do
    kicked = kicked(:n_moved)
  end subroutine recycle_disks

  !> True if the centre of disk i is in `from_region`.
  pure function is_due(self, sim, i) result(yes)
    class(recycle_t), intent(in) :: self
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i
    logical :: yes
    real(real64) :: x(2)

    yes = self%acts_on(sim%tag(i)%species) .and. sim%is_inside(i)
    if (.not. yes) return
    x = sim%position(i)
    associate (region => self%from_region)
      yes = all(x >= region([1, 3]) .and. x <= region([2, 4]))
    end associate
  end function is_due

  !> Moves disk i to a new position. The trajectory of the disk begins anew: the last collision
  !> partner, the time of the last contact and the image counters are reset. The disk receives the
  !> given velocity without rotation, or a velocity and rotation from the Maxwell distribution. The
  !> change of its total energy (kinetic, rotational and potential) is added to `drive_energy`.
  subroutine move_disk(self, sim, i, x, stream)
    class(recycle_t), intent(in) :: self
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i
    real(real64), intent(in) :: x(2)                         !! [length]
    type(random_stream_t), intent(inout) :: stream
    real(real64) :: v(2), spin(2)

    call interrupt_disk(sim, i)
    call sim%tally%sum(drive_energy)%add(-sim%mass_of(i)*dot_product(sim%box%gravity, x - sim%disk(i)%x))
    sim%disk(i)%x = x
    if (allocated(sim%extra)) then
      sim%extra(i)%last_contact = -never
      sim%extra(i)%image = 0
    end if
    v = self%velocity
    spin = 0
    if (self%temperature > 0) then
      call stream%draw_normals(v)
      v = sqrt(self%temperature/sim%mass_of(i))*v
      if (sim%features%rotation) call stream%draw_normals(spin)
    end if
    call change_velocity(sim, i, v)
    if (sim%features%rotation) call change_spin(sim, i, sqrt(self%temperature/sim%inertia_of(i))*spin(1))
  end subroutine move_disk

end module recycle
