!> The container: four sides, walls or periodic by axis, fixed obstacles, and the acceleration in it.
!> Times of contact are pure functions of a disk's own state, counted from the epoch like its clock.
module box_geometry
  use collisions, only: wall_law_t
  use disks, only: disk_t
  use images, only: images_t, sliding_images
  use kinds, only: int32, never, real64
  use partners, only: axis_of, is_side, n_sides, obstacle_code, obstacle_number, sense_of, side_name, wall_index
  use shapes, only: shape_t
  use side_motion, only: side_motion_t
  implicit none
  private
  public :: box_t, surface_t
  public :: next_obstacle, obstacle_gap, strike_velocity, surface_velocity, wall_law, wall_normal, surface_path, free_area

  !> What a disk bounces off: a side of the box, or an obstacle, which has a name and a shape.
  type :: surface_t
    character(len=:), allocatable :: name
    class(shape_t), allocatable :: shape
    type(wall_law_t) :: law
    type(side_motion_t) :: motion               !! of a side
  end type surface_t

  type :: box_t
    real(real64) :: lower(2) = 0.0_real64       !! [length]
    real(real64) :: upper(2) = 1.0_real64       !! [length]
    logical :: periodic(2) = .false.            !! by axis
    real(real64) :: gravity(2) = 0.0_real64     !! [length/time**2]
    real(real64) :: shear_rate = 0.0_real64     !! of a sheared box [1/time]
    type(surface_t) :: side(n_sides)            !! left, right, bottom, top, where they are walls
    type(surface_t), allocatable :: obstacle(:)
    real(real64) :: epoch = 0.0_real64          !! that of the simulation: the motion of sides needs the time of the run [time]
  contains
    procedure :: edges
    procedure :: periods
    procedure :: images => images_of
    procedure :: falling
    procedure :: is_sheared
    procedure :: slip
    procedure :: stream
    procedure :: n_obstacles
    procedure :: n_surfaces
    procedure :: is_wall
    procedure :: has_lossy_walls
    procedure :: has_rough_walls
    procedure :: highest_temperature
    procedure :: highest_speed
    procedure :: gives_energy
    procedure :: reach
  end type box_t

contains

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

  !> Number of obstacles.
  pure function n_obstacles(self) result(n)
    class(box_t), intent(in) :: self
    integer(int32) :: n

    n = 0
    if (allocated(self%obstacle)) n = size(self%obstacle, kind=int32)
  end function n_obstacles

  !> Number of sides and obstacles.
  pure function n_surfaces(self) result(n)
    class(box_t), intent(in) :: self
    integer(int32) :: n

    n = n_sides + self%n_obstacles()
  end function n_surfaces

  !> Whether disks bounce off the k-th side or obstacle.
  pure function is_wall(self, k) result(yes)
    class(box_t), intent(in) :: self
    integer, intent(in) :: k                    !! as in `partners: wall_index`
    logical :: yes

    yes = k > n_sides
    if (.not. yes) yes = .not. self%periodic((k + 1)/2)
  end function is_wall

  !> Whether any wall takes energy.
  pure function has_lossy_walls(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes
    type(wall_law_t) :: law
    integer :: k

    yes = .false.
    do k = 1, self%n_surfaces()
      if (.not. self%is_wall(k)) cycle
      law = wall_law(self, 1 - k)
      yes = yes .or. law%restitution < 1 .or. law%grip%is_rough()
    end do
  end function has_lossy_walls

  !> Whether any wall can make disks turn.
  pure function has_rough_walls(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes
    type(wall_law_t) :: law
    integer :: k

    yes = .false.
    do k = 1, self%n_surfaces()
      if (.not. self%is_wall(k)) cycle
      law = wall_law(self, 1 - k)
      yes = yes .or. law%grip%is_rough()
    end do
  end function has_rough_walls

  !> The highest temperature of a wall.
  pure function highest_temperature(self) result(highest)
    class(box_t), intent(in) :: self
    real(real64) :: highest                     !! [energy]
    integer :: m

    highest = maxval(self%side%law%temperature)
    do m = 1, self%n_obstacles()
      highest = max(highest, self%obstacle(m)%law%temperature)
    end do
  end function highest_temperature

  !> The highest speed of a surface, along the wall or of a side that moves; or of the image above in a sheared box.
  pure function highest_speed(self) result(highest)
    class(box_t), intent(in) :: self
    real(real64) :: highest                     !! [length/time]
    integer :: m

    highest = max(maxval(abs(self%side%law%speed)), maxval(self%side%motion%top_speed()), abs(self%slip()))
    do m = 1, self%n_obstacles()
      highest = max(highest, abs(self%obstacle(m)%law%speed))
    end do
  end function highest_speed

  !> Whether disks can get energy from a wall, or from shear.
  pure function gives_energy(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = self%highest_temperature() > 0 .or. self%highest_speed() > 0
  end function gives_energy

  !> How far sides may be from their places, and disks beyond: left and bottom, right and top.
  pure function reach(self) result(length)
    class(box_t), intent(in) :: self
    real(real64) :: length(2, 2)                !! (axis, lower or upper) [length]

    length = transpose(reshape(self%side%motion%amplitude, [2, 2]))
  end function reach

  !> The earlier of a known event and the contacts with the obstacles listed. A disk stays in the box until it
  !> passes a periodic side, so the images of an obstacle one period away are enough; what encloses the disks has none.
  !> What is met from outside is convex: a disk that leaves it on a straight line does not return, whatever rounding says.
  pure subroutine next_obstacle(box, disk, last, list, t, code)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: last          !! code of the obstacle that it left last, if nothing has happened since
    integer(int32), intent(in) :: list(:)       !! numbers of the obstacles in question, ascending
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    type(images_t) :: images
    real(real64) :: t_m, d(2), left(2)
    integer :: k, image

    do k = 1, size(list)
      associate (shape => box%obstacle(list(k))%shape)
        images = merge(images_t(), box%images(), shape%encloses)
        t_m = never
        left = never                            ! the image that it leaves
        if (last == obstacle_code(list(k)) .and. .not. (shape%encloses .or. box%falling())) &
          left = shape%from_nearest(disk%x, images, heading=disk%v)
        do image = 1, images%count()
          d = disk%x - (shape%middle + images%shift(images%around(image)))
          if (all(abs(d - left) < 0.5_real64*box%edges())) cycle
          t_m = min(t_m, disk%clock + shape%contact_time(d, disk%v, box%gravity, disk%radius))
        end do
      end associate
      if (t_m < t) then
        t = t_m
        code = obstacle_code(list(k))
      end if
    end do
  end subroutine next_obstacle

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

  !> What happens at a side or obstacle.
  pure function wall_law(box, code) result(law)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    type(wall_law_t) :: law

    if (is_side(code)) then
      law = box%side(wall_index(code))%law
    else
      law = box%obstacle(obstacle_number(code))%law
    end if
  end function wall_law

  !> Velocity of the surface of a side or obstacle where the normal is this one.
  pure function surface_velocity(box, code, normal) result(u)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: normal(2)       !! from the surface to a disk
    real(real64) :: u(2)                        !! [length/time]

    u = 0
    if (is_side(code)) then
      u(3 - axis_of(code)) = box%side(wall_index(code))%law%speed
    else
      associate (obstacle => box%obstacle(obstacle_number(code)))
        if (abs(obstacle%law%speed) > 0) u = obstacle%law%speed*obstacle%shape%direction(normal)
      end associate
    end if
  end function surface_velocity

  !> Velocity of a side, or of an obstacle, which stays where it is, along its normal.
  pure function strike_velocity(box, code, normal, t) result(u)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: normal(2)       !! from the surface to a disk
    real(real64), intent(in) :: t               !! since the epoch [time]
    real(real64) :: u(2)                        !! [length/time]

    u = 0
    if (.not. is_side(code)) return
    associate (motion => box%side(wall_index(code))%motion)
      if (motion%is_on()) u = motion%velocity(motion%moment(box%epoch, t))*normal
    end associate
  end function strike_velocity

  !> Unit vector from a side or obstacle to a disk at x that hits it with the velocity v.
  pure function wall_normal(box, code, x, v) result(normal)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: x(2)            !! [length]
    real(real64), intent(in) :: v(2)            !! [length/time]
    real(real64) :: normal(2)

    if (is_side(code)) then
      normal = 0
      normal(axis_of(code)) = -sense_of(code)
    else
      associate (shape => box%obstacle(obstacle_number(code))%shape)
        normal = shape%normal(shape%from_nearest(x, box%images(), heading=-v))
      end associate
    end if
  end function wall_normal

  !> The name of the k-th side or obstacle below /observables.
  pure function surface_path(box, k) result(path)
    type(box_t), intent(in) :: box
    integer, intent(in) :: k                    !! as in `partners: wall_index`
    character(len=:), allocatable :: path

    if (k <= n_sides) then
      path = "sides/"//trim(side_name(k))
    else
      path = "walls/"//box%obstacle(k - n_sides)%name
    end if
  end function surface_path

  !> Where disks can be: the box less the obstacles, or the smallest outline that encloses them.
  pure function free_area(box) result(area)
    type(box_t), intent(in) :: box
    real(real64) :: area                        !! [length**2]
    integer :: m

    area = product(box%edges())
    do m = 1, box%n_obstacles()
      if (box%obstacle(m)%shape%encloses) area = min(area, box%obstacle(m)%shape%area())
    end do
    do m = 1, box%n_obstacles()
      if (.not. box%obstacle(m)%shape%encloses) area = area - box%obstacle(m)%shape%area()
    end do
  end function free_area

end module box_geometry
