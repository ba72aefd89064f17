!> The container: its surfaces, which are four sides, walls or periodic by axis, and fixed obstacles; and the acceleration
!> in it.
!> Times of contact are pure functions of a disk's own state, counted from the epoch like its clock.
module box_geometry
  use collisions, only: wall_law_t
  use disks, only: disk_t
  use images, only: images_t, sliding_images
  use kinds, only: int32, never, real64
  use partners, only: axis_of, is_side, n_sides, obstacle_number, sense_of, side_name
  use shapes, only: shape_t, spare
  use side_motion, only: piston, side_motion_t, side_state_t, still
  implicit none
  private
  public :: box_t, surface_t
  public :: meet_image, next_obstacle, obstacle_gap, strike_velocity, surface_velocity, wall_normal, free_area

  !> A side of the box, or a group of obstacles: its law holds for all of them, and its sums are over all of them.
  type :: surface_t
    character(len=:), allocatable :: name
    type(wall_law_t) :: law
    type(side_motion_t) :: motion               !! of a side
  end type surface_t

  type :: obstacle_t
    class(shape_t), allocatable :: shape
    integer(int32) :: surface = 0               !! number of that of its group
  end type obstacle_t

  type :: box_t
    real(real64) :: lower(2) = 0.0_real64       !! [length]
    real(real64) :: upper(2) = 1.0_real64       !! [length]
    logical :: periodic(2) = .false.            !! by axis
    real(real64) :: gravity(2) = 0.0_real64     !! [length/time**2]
    real(real64) :: shear_rate = 0.0_real64     !! of a sheared box [1/time]
    !> Left, right, bottom, top, which count where they are walls; then the groups of obstacles.
    type(surface_t), allocatable :: surface(:)
    type(obstacle_t), allocatable :: obstacle(:)   !! those of one group side by side: see `partners` for their codes
    ! State, beside that of the disks. The input gives the state of sides at the start.
    real(real64) :: epoch = 0.0_real64          !! the moment from which all clocks count, since the start of the run [time]
    type(side_state_t) :: side(n_sides)
  contains
    procedure :: edges
    procedure :: periods
    procedure :: images => images_of
    procedure :: falling
    procedure :: is_sheared
    procedure :: slip
    procedure :: stream
    procedure :: add_obstacles
    procedure :: has_obstacles
    procedure :: n_obstacles
    procedure :: surface_of
    procedure :: is_wall
    procedure :: has_lossy_walls
    procedure :: has_rough_walls
    procedure :: highest_temperature
    procedure :: highest_speed
    procedure :: does_work
    procedure :: gives_energy
    procedure :: reach
    procedure :: side_position
    procedure :: side_velocity
  end type box_t

  interface box_t
    module procedure new_box
  end interface box_t

contains

  !> The unit box, without obstacles.
  function new_box() result(box)
    type(box_t) :: box
    integer :: k

    allocate (box%surface(n_sides), box%obstacle(0))
    do k = 1, n_sides
      box%surface(k)%name = trim(side_name(k))
    end do
  end function new_box

  !> Adds groups of obstacles, whose shapes are to follow.
  subroutine add_obstacles(self, name, n)
    class(box_t), intent(inout) :: self
    character(len=*), intent(in) :: name(:)     !! of each group
    integer, intent(in) :: n(:)                 !! of its obstacles
    type(surface_t), allocatable :: surface(:)
    type(obstacle_t), allocatable :: obstacle(:)
    integer :: k, m

    allocate (surface(size(self%surface) + size(n)), obstacle(size(self%obstacle) + sum(n)))
    do k = 1, size(self%surface)
      surface(k) = self%surface(k)
    end do
    do m = 1, size(self%obstacle)
      call move_alloc(self%obstacle(m)%shape, obstacle(m)%shape)
      obstacle(m)%surface = self%obstacle(m)%surface
    end do
    m = size(self%obstacle)
    do k = 1, size(n)
      surface(size(self%surface) + k)%name = trim(name(k))
      obstacle(m + 1:m + n(k))%surface = int(size(self%surface) + k, int32)
      m = m + n(k)
    end do
    call move_alloc(surface, self%surface)
    call move_alloc(obstacle, self%obstacle)
  end subroutine add_obstacles

  !> Lengths of the sides.
  pure function edges(self) result(lengths)
    class(box_t), intent(in) :: self
    real(real64) :: lengths(2)

    lengths = self%upper - self%lower
  end function edges

  !> The same, but `never` where the sides are walls.
  pure function periods(self) result(lengths)
    class(box_t), intent(in) :: self
    real(real64) :: lengths(2)

    lengths = merge(self%upper - self%lower, never, self%periodic)
  end function periods

  !> The images of the box, for clocks that count from `epoch`; without it as they are at the start.
  pure function images_of(self, epoch) result(images)
    class(box_t), intent(in) :: self
    real(real64), intent(in), optional :: epoch    !! [time]
    type(images_t) :: images

    images = images_t(self%periods())
    if (self%is_sheared() .and. present(epoch)) &
      images = sliding_images(self%periods(), self%slip(), epoch)
  end function images_of

  !> Whether disks fly on parabolas.
  pure function falling(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = any(abs(self%gravity) > 0)
  end function falling

  !> Whether the image above moves along x (Lees and Edwards).
  pure function is_sheared(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = abs(self%shear_rate) > 0
  end function is_sheared

  !> The velocity along x of the image above.
  pure function slip(self) result(v)
    class(box_t), intent(in) :: self
    real(real64) :: v                           !! [length/time]

    v = self%shear_rate*(self%upper(2) - self%lower(2))
  end function slip

  !> The velocity profile that the shear imposes, at x: what is relative to it is alike everywhere.
  pure function stream(self, x) result(v)
    class(box_t), intent(in) :: self
    real(real64), intent(in) :: x(2)            !! [length]
    real(real64) :: v(2)                        !! [length/time]

    v = [self%shear_rate*(x(2) - 0.5_real64*(self%lower(2) + self%upper(2))), 0.0_real64]
  end function stream

  !> Whether there is more than the sides.
  pure function has_obstacles(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = self%n_obstacles() > 0
  end function has_obstacles

  !> The number of obstacles.
  pure function n_obstacles(self) result(n)
    class(box_t), intent(in) :: self
    integer(int32) :: n

    n = 0
    if (allocated(self%obstacle)) n = size(self%obstacle, kind=int32)
  end function n_obstacles

  !> The number of the surface of a side or obstacle with this code.
  elemental function surface_of(self, code) result(k)
    class(box_t), intent(in) :: self
    integer(int32), intent(in) :: code
    integer :: k

    k = 1 - code
    if (.not. is_side(code)) k = self%obstacle(obstacle_number(code))%surface
  end function surface_of

  !> Whether disks bounce off surface k.
  pure function is_wall(self, k) result(yes)
    class(box_t), intent(in) :: self
    integer, intent(in) :: k
    logical :: yes

    yes = k > n_sides
    if (.not. yes) yes = .not. self%periodic((k + 1)/2)
  end function is_wall

  !> Whether any wall takes energy.
  pure function has_lossy_walls(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes
    integer :: k

    yes = self%has_rough_walls() .or. &
      any([(self%is_wall(k), k=1, size(self%surface))] .and. self%surface%law%restitution < 1)
  end function has_lossy_walls

  !> Whether any wall can make disks turn.
  pure function has_rough_walls(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes
    integer :: k

    yes = any([(self%is_wall(k), k=1, size(self%surface))] .and. self%surface%law%grip%is_rough())
  end function has_rough_walls

  !> The highest temperature of a wall.
  pure function highest_temperature(self) result(highest)
    class(box_t), intent(in) :: self
    real(real64) :: highest                     !! [energy]

    highest = maxval(self%surface%law%temperature)
  end function highest_temperature

  !> The highest speed of a surface, along the wall or of a side that moves; or of the image above in a sheared box.
  pure function highest_speed(self) result(highest)
    class(box_t), intent(in) :: self
    real(real64) :: highest                     !! [length/time]

    highest = max(maxval(abs(self%surface%law%speed)), maxval(self%surface%motion%top_speed()), abs(self%slip()))
  end function highest_speed

  !> Whether surfaces can do work on disks: they slide or move, disks push them, or the box is sheared.
  pure function does_work(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = self%highest_speed() > 0 .or. any(self%surface%motion%kind == piston)
  end function does_work

  !> Whether disks can get energy from a wall, or from shear.
  pure function gives_energy(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = self%highest_temperature() > 0 .or. self%does_work()
  end function gives_energy

  !> How far sides may be from their places, and disks beyond: left and bottom, right and top.
  pure function reach(self) result(length)
    class(box_t), intent(in) :: self
    real(real64) :: length(2, 2)                !! (axis, lower or upper) [length]

    length = transpose(reshape(self%surface(:n_sides)%motion%amplitude, [2, 2]))
  end function reach

  !> How far side k is inwards of its own place at a time.
  pure function side_position(self, k, t) result(x)
    class(box_t), intent(in) :: self
    integer, intent(in) :: k
    real(real64), intent(in) :: t               !! since the epoch [time]
    real(real64) :: x                           !! [length]

    associate (motion => self%surface(k)%motion, state => self%side(k))
      x = motion%place(motion%moment(self%epoch, t, state), state)
    end associate
  end function side_position

  !> Its velocity inwards then.
  pure function side_velocity(self, k, t) result(v)
    class(box_t), intent(in) :: self
    integer, intent(in) :: k
    real(real64), intent(in) :: t               !! since the epoch [time]
    real(real64) :: v                           !! [length/time]

    associate (motion => self%surface(k)%motion, state => self%side(k))
      v = motion%velocity(motion%moment(self%epoch, t, state), state)
    end associate
  end function side_velocity

  !> The earlier of a known event and the contacts with the obstacles listed. A disk stays in the box until it
  !> passes a periodic side, so the images of an obstacle one period away are enough; an obstacle that encloses the disks
  !> has none.
  pure subroutine next_obstacle(box, disk, last, list, t, code)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: last          !! code of the obstacle that it left last, if nothing has happened since
    integer(int32), intent(in) :: list(:)       !! codes of the obstacles in question, descending
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    type(images_t) :: images
    integer :: k, image

    do k = 1, size(list)
      images = merge(images_t(), box%images(), box%obstacle(obstacle_number(list(k)))%shape%encloses)
      do image = 1, images%count()
        call meet_image(box, disk, last, list(k), images%shift(images%around(image)), t, code)
      end do
    end do
  end subroutine next_obstacle

  !> The earlier of a known event and the contact with one image of an obstacle. An obstacle that disks meet from outside is
  !> convex: a disk that leaves it on a straight line does not return, whatever rounding says.
  pure subroutine meet_image(box, disk, last, obstacle, shift, t, code)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: last          !! code of the obstacle that it left last, if nothing has happened since
    integer(int32), intent(in) :: obstacle      !! its code
    real(real64), intent(in) :: shift(2)        !! from the obstacle to its image [length]
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    real(real64) :: t_image, d(2)

    associate (shape => box%obstacle(obstacle_number(obstacle))%shape)
      d = disk%x - (shape%middle + shift)
      if (last == obstacle .and. .not. (shape%encloses .or. box%falling())) then
        if (all(abs(d - shape%from_nearest(disk%x, box%images(), heading=disk%v)) < 0.5_real64*box%edges())) return
      end if
      if (box%falling()) then
        if (passes_by(d, disk%v, box%gravity, t - disk%clock, shape%extent + disk%radius)) return
      end if
      t_image = disk%clock + shape%contact_time(d, disk%v, box%gravity, disk%radius)
    end associate
    if (.not. t_image < t) return
    t = t_image
    code = obstacle
  end subroutine meet_image

  !> Whether a point that falls for a while remains outside of a rectangle around the origin; no, if in doubt. The rectangle
  !> around the path is a rough bound, but takes few operations; the roots of a quartic are many.
  pure function passes_by(d, v, g, s, half) result(yes)
    real(real64), intent(in) :: d(2)            !! [length]
    real(real64), intent(in) :: v(2)            !! [length/time]
    real(real64), intent(in) :: g(2)            !! [length/time**2]
    real(real64), intent(in) :: s               !! [time]
    real(real64), intent(in) :: half(2)         !! half its sides [length]
    logical :: yes
    real(real64) :: low, high, slack
    integer :: axis

    yes = .false.
    if (s > sqrt(never)) return                 ! the path may be too long for a number
    do axis = 1, 2
      low = s*min(v(axis), v(axis) + g(axis)*s, 0.0_real64)
      high = s*max(v(axis), v(axis) + g(axis)*s, 0.0_real64)
      slack = spare*(abs(d(axis)) + max(-low, high))
      yes = yes .or. d(axis) + high < -(half(axis) + slack) .or. d(axis) + low > half(axis) + slack
    end do
  end function passes_by

  !> Distance between the m-th obstacle and the rim of a disk at x; negative if they overlap.
  pure function obstacle_gap(box, m, x, radius) result(length)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: m
    real(real64), intent(in) :: x(2), radius    !! [length]
    real(real64) :: length

    associate (shape => box%obstacle(m)%shape)
      length = shape%gap(shape%from_nearest(x, box%images()), radius)
    end associate
  end function obstacle_gap

  !> Velocity of a surface along itself where the normal is this one.
  pure function surface_velocity(box, code, normal) result(u)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: normal(2)       !! from the surface to a disk
    real(real64) :: u(2)                        !! [length/time]

    u = 0
    associate (law => box%surface(box%surface_of(code))%law)
      if (is_side(code)) then
        u(3 - axis_of(code)) = law%speed
      else if (abs(law%speed) > 0) then
        u = law%speed*box%obstacle(obstacle_number(code))%shape%direction(normal)
      end if
    end associate
  end function surface_velocity

  !> Velocity of a surface along its normal: only sides move.
  pure function strike_velocity(box, code, normal, t) result(u)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: normal(2)       !! from the surface to a disk
    real(real64), intent(in) :: t               !! since the epoch [time]
    real(real64) :: u(2)                        !! [length/time]

    u = 0
    if (.not. is_side(code)) return
    if (box%surface(1 - code)%motion%kind /= still) u = box%side_velocity(1 - code, t)*normal
  end function strike_velocity

  !> Unit vector from a surface to a disk at x that hits it with the velocity v.
  pure function wall_normal(box, code, x, v) result(normal)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: x(2)            !! [length]
    real(real64), intent(in) :: v(2)            !! [length/time]
    real(real64) :: normal(2), d(2)

    if (is_side(code)) then
      normal = 0
      normal(axis_of(code)) = -sense_of(code)
    else
      associate (shape => box%obstacle(obstacle_number(code))%shape)
        d = shape%from_nearest(x, box%images(), heading=-v)
        normal = shape%normal(d)
      end associate
    end if
  end function wall_normal

  !> Where disks can be: the box less the obstacles, or the smallest outline that encloses them.
  pure function free_area(box) result(area)
    type(box_t), intent(in) :: box
    real(real64) :: area                        !! [length**2]
    integer(int32) :: m

    area = product(box%edges())
    do m = 1, box%n_obstacles()
      if (box%obstacle(m)%shape%encloses) area = min(area, box%obstacle(m)%shape%area)
    end do
    do m = 1, box%n_obstacles()
      if (.not. box%obstacle(m)%shape%encloses) area = area - box%obstacle(m)%shape%area
    end do
  end function free_area

end module box_geometry
