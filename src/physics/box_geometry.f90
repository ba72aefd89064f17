!> The box as specified by the input: four sides (walls or periodic boundaries), fixed obstacles,
!> and gravity. Its state during a run is in `box_state`. The time when a disk touches an obstacle
!> depends only on the state of that disk. All times, including the clocks of disks, are relative to
!> the time origin `epoch` of the state of the box.
module box_geometry
  use box_side, only: side_t
  use wall_law, only: wall_law_t
  use disks, only: disk_t
  use images, only: images_t, moving_images
  use kinds, only: int32, never, real64
  use partners, only: axis_of, is_side, n_sides, obstacle_number, sense_of, side_name
  use shapes, only: shape_t, spare
  implicit none
  private
  public :: box_t, obstacle_t, surface_t
  public :: find_image_contact, free_area, next_obstacle, obstacle_gap, spans, stays_clear
  public :: tangential_surface_velocity, wall_normal

  !> A side of the box, or a group of obstacles with a common contact law and common sums over
  !> collisions.
  type :: surface_t
    character(len=:), allocatable :: name
    type(wall_law_t) :: law
  end type surface_t

  type :: obstacle_t
    class(shape_t), allocatable :: shape
    integer(int32) :: surface = 0               !! index of the surface of the obstacle's group
  end type obstacle_t

  type :: box_t
    real(real64) :: lower(2) = 0.0_real64       !! [length]
    real(real64) :: upper(2) = 1.0_real64       !! [length]
    logical :: periodic(2) = .false.            !! whether each axis is periodic
    real(real64) :: gravity(2) = 0.0_real64     !! [length/time**2]
    real(real64) :: shear_rate = 0.0_real64     !! shear rate (Lees-Edwards boundary conditions) [1/time]
    !> The sides (left, right, bottom, top), followed by the groups of obstacles. Elements of
    !> periodic sides are unused.
    type(surface_t), allocatable :: surface(:)
    logical, dimension(n_sides) :: open = .false.  !! whether disks leave the box through each side
    type(obstacle_t), allocatable :: obstacle(:)   !! obstacles of a group are consecutive
    type(side_t) :: side(n_sides)               !! motions of the left, right, bottom and top side
  contains
    procedure :: edges
    procedure :: periods
    procedure :: images => images_of
    procedure :: has_gravity
    procedure :: is_sheared
    procedure :: shear_velocity
    procedure :: shear_profile
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
    procedure :: side_excursion
  end type box_t

  interface box_t
    module procedure new_box
  end interface box_t

contains

  !> The unit box without obstacles.
  function new_box() result(box)
    type(box_t) :: box
    integer :: k

    allocate (box%surface(n_sides), box%obstacle(0))
    do k = 1, n_sides
      box%surface(k)%name = trim(side_name(k))
    end do
  end function new_box

  !> Adds groups of obstacles. The caller sets their shapes later.
  subroutine add_obstacles(self, name, n)
    class(box_t), intent(inout) :: self
    character(len=*), intent(in) :: name(:)     !! name of each group
    integer, intent(in) :: n(:)                 !! number of obstacles in each group
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

  !> Edges of the box.
  pure function edges(self) result(lengths)
    class(box_t), intent(in) :: self
    real(real64) :: lengths(2)

    lengths = self%upper - self%lower
  end function edges

  !> Period of the box along each axis; `never`, a very large number, along an axis with walls.
  pure function periods(self) result(lengths)
    class(box_t), intent(in) :: self
    real(real64) :: lengths(2)

    lengths = merge(self%upper - self%lower, never, self%periodic)
  end function periods

  !> Periodic images of the box, for times relative to the time origin `epoch`; by default, the
  !> start of the run.
  pure function images_of(self, epoch) result(images)
    class(box_t), intent(in) :: self
    real(real64), intent(in), optional :: epoch    !! [time]
    type(images_t) :: images

    images = images_t(self%periods())
    if (self%is_sheared() .and. present(epoch)) &
      images = moving_images(self%periods(), self%shear_velocity(), epoch)
  end function images_of

  !> True if gravity acts on the disks, which then move on parabolas.
  pure function has_gravity(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = any(abs(self%gravity) > 0)
  end function has_gravity

  !> True if the box is sheared (Lees and Edwards, Journal of Physics C 5, 1921 (1972)): the
  !> periodic image above the box moves along x.
  pure function is_sheared(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = abs(self%shear_rate) > 0
  end function is_sheared

  !> Velocity along x of the periodic image above the box.
  pure function shear_velocity(self) result(v)
    class(box_t), intent(in) :: self
    real(real64) :: v                           !! [length/time]

    v = self%shear_rate*(self%upper(2) - self%lower(2))
  end function shear_velocity

  !> Velocity of the linear shear profile at the point x. Relative to this profile, the mean
  !> velocity is the same everywhere in the box.
  pure function shear_profile(self, x) result(v)
    class(box_t), intent(in) :: self
    real(real64), intent(in) :: x(2)            !! [length]
    real(real64) :: v(2)                        !! [length/time]

    v = [self%shear_rate*(x(2) - 0.5_real64*(self%lower(2) + self%upper(2))), 0.0_real64]
  end function shear_profile

  !> True if the box contains obstacles.
  pure function has_obstacles(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = self%n_obstacles() > 0
  end function has_obstacles

  !> Number of obstacles.
  pure function n_obstacles(self) result(n)
    class(box_t), intent(in) :: self
    integer(int32) :: n

    n = 0
    if (allocated(self%obstacle)) n = size(self%obstacle, kind=int32)
  end function n_obstacles

  !> Index of the surface with the given boundary id.
  elemental function surface_of(self, code) result(k)
    class(box_t), intent(in) :: self
    integer(int32), intent(in) :: code
    integer :: k

    k = 1 - code
    if (.not. is_side(code)) k = self%obstacle(obstacle_number(code))%surface
  end function surface_of

  !> True if surface k is a wall, from which disks rebound.
  pure function is_wall(self, k) result(yes)
    class(box_t), intent(in) :: self
    integer, intent(in) :: k
    logical :: yes

    yes = k > n_sides
    if (.not. yes) yes = .not. self%periodic((k + 1)/2)
  end function is_wall

  !> True if any wall dissipates energy.
  pure function has_lossy_walls(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes
    integer :: k

    yes = self%has_rough_walls() .or. &
      any([(self%is_wall(k), k=1, size(self%surface))] .and. self%surface%law%is_inelastic())
  end function has_lossy_walls

  !> True if any wall can exert a torque on disks.
  pure function has_rough_walls(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes
    integer :: k

    yes = any([(self%is_wall(k), k=1, size(self%surface))] .and. self%surface%law%tangential%is_rough())
  end function has_rough_walls

  !> Maximum temperature of all thermal walls.
  pure function highest_temperature(self) result(highest)
    class(box_t), intent(in) :: self
    real(real64) :: highest                     !! [energy]

    highest = maxval(self%surface%law%temperature)
  end function highest_temperature

  !> Maximum speed of all boundaries: sliding surfaces, moving sides, and the periodic image above a
  !> sheared box.
  pure function highest_speed(self) result(highest)
    class(box_t), intent(in) :: self
    real(real64) :: highest                     !! [length/time]

    highest = max(maxval(abs(self%surface%law%speed)), maxval(self%side%highest_speed()), abs(self%shear_velocity()))
  end function highest_speed

  !> True if boundaries can do work on disks: by sliding, by moving, by the force on a piston, or by
  !> shear.
  pure function does_work(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = self%highest_speed() > 0 .or. any(self%side%is_piston())
  end function does_work

  !> True if disks can gain energy from a wall or from shear.
  pure function gives_energy(self) result(yes)
    class(box_t), intent(in) :: self
    logical :: yes

    yes = self%highest_temperature() > 0 .or. self%does_work()
  end function gives_energy

  !> Maximum outward displacement of each moving side from its mean position. Disks can be this far
  !> beyond the mean position of an oscillating side.
  pure function side_excursion(self) result(length)
    class(box_t), intent(in) :: self
    real(real64) :: length(2, 2)                !! shape (axis, lower or upper side) [length]

    length = transpose(reshape(self%side%reach(), [2, 2]))
  end function side_excursion

  !> True for each periodic axis along which the region spans the whole period. Along such an axis
  !> disks may overlap the edges of the region.
  pure function spans(region, box) result(yes)
    real(real64), intent(in) :: region(4)           !! xlo, xhi, ylo, yhi [length]
    type(box_t), intent(in) :: box
    logical :: yes(2)

    yes = box%periodic .and. region([1, 3]) <= box%lower .and. region([2, 4]) >= box%upper
  end function spans

  !> Finds the first contact of a disk with any of the given obstacles, if it precedes the earliest
  !> event found so far. Only images shifted by at most one period need to be tested. A disk that
  !> passes a periodic side is shifted back into the box, and its contacts are predicted anew. An
  !> obstacle that encloses the disks has no images.
  pure subroutine next_obstacle(box, disk, last, list, t, code)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    !> Last collision partner of the disk (`last_partner`); may be an obstacle.
    integer(int32), intent(in) :: last
    !> Boundary ids of the obstacles to be tested, in descending order.
    integer(int32), intent(in) :: list(:)
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    type(images_t) :: images
    real(real64) :: shift(2)
    integer :: k, image

    do k = 1, size(list)
      images = merge(images_t(), box%images(), box%obstacle(obstacle_number(list(k)))%shape%encloses)
      do image = 1, images%count()
        shift = images%shift(images%around(image))
        if (stays_clear(box, disk, list(k), shift, t, box%has_gravity())) cycle
        call find_image_contact(box, disk, last, list(k), shift, t, code)
      end do
    end do
  end subroutine next_obstacle

  !> Finds the contact of a disk with one image of an obstacle, if it precedes the earliest event
  !> found so far. Without gravity, a disk that has just left a convex obstacle cannot touch it
  !> again before another collision. Such a contact would be a rounding error and is not predicted.
  pure subroutine find_image_contact(box, disk, last, obstacle, shift, t, code)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    !> Last collision partner of the disk (`last_partner`); may be an obstacle.
    integer(int32), intent(in) :: last
    integer(int32), intent(in) :: obstacle      !! boundary id of the obstacle
    real(real64), intent(in) :: shift(2)        !! shift from the obstacle to its image [length]
    real(real64), intent(inout) :: t
    integer(int32), intent(inout) :: code
    real(real64) :: t_image, d(2)

    associate (shape => box%obstacle(obstacle_number(obstacle))%shape)
      d = disk%x - (shape%middle + shift)
      if (last == obstacle .and. shape%is_convex .and. .not. box%has_gravity()) then
        if (all(abs(d - shape%from_nearest(disk%x, box%images(), heading=disk%v)) < 0.5_real64*box%edges())) return
      end if
      t_image = disk%clock + shape%contact_time(d, disk%v, box%gravity, disk%radius, t - disk%clock)
    end associate
    if (.not. t_image < t) return
    t = t_image
    code = obstacle
  end subroutine find_image_contact

  !> True if a disk certainly misses one image of an obstacle until the time t. If the result is
  !> .false., the disk may touch it. This test costs much less than calculating the contact time.
  pure function stays_clear(box, disk, obstacle, shift, t, falling) result(yes)
    type(box_t), intent(in) :: box
    type(disk_t), intent(in) :: disk
    integer(int32), intent(in) :: obstacle      !! boundary id of the obstacle
    real(real64), intent(in) :: shift(2)        !! shift from the obstacle to its image [length]
    real(real64), intent(in) :: t               !! relative to the time origin `box%epoch` [time]
    logical, intent(in) :: falling              !! whether gravity acts on the disk
    logical :: yes
    real(real64) :: d(2)

    associate (shape => box%obstacle(obstacle_number(obstacle))%shape)
      d = disk%x - (shape%middle + shift)
      if (falling .and. shape%is_round) then
        yes = falls_past(d, disk%v, box%gravity, t - disk%clock, shape%circumradius + disk%radius)
      else if (falling) then
        yes = stays_outside(d, disk%v, box%gravity, t - disk%clock, shape%extent + disk%radius)
      else
        yes = passes_by(d, disk%v, t - disk%clock, shape%circumradius + disk%radius, shape%is_round)
      end if
    end associate
  end function stays_clear

  !> True if a point on a straight path certainly stays outside a circle about the origin for a
  !> given time. The radius is enlarged by a margin that exceeds all rounding errors. A contact
  !> before the time s requires c < -2 b s, as in `event_prediction: earliest_contact`. If the
  !> circle is the obstacle itself, a point moving away from its centre cannot touch it.
  pure function passes_by(d, v, s, rho, is_round) result(yes)
    real(real64), intent(in) :: d(2)            !! initial position [length]
    real(real64), intent(in) :: v(2)            !! [length/time]
    real(real64), intent(in) :: s               !! duration [time]
    real(real64), intent(in) :: rho             !! radius of the circle [length]
    logical, intent(in) :: is_round             !! whether the obstacle itself is the circle
    logical :: yes
    real(real64) :: b, c, sigma2, disc

    c = d(1)*d(1) + d(2)*d(2)
    sigma2 = (1 + spare)*rho*rho + spare**2*c
    c = c - sigma2
    b = d(1)*v(1) + d(2)*v(2)
    disc = sigma2*(v(1)*v(1) + v(2)*v(2)) - (d(1)*v(2) - d(2)*v(1))**2
    yes = (min(disc, -2*b*s - c) < 0 .and. c > 0) .or. (is_round .and. b >= 0)
  end function passes_by

  !> Version of `passes_by` for a falling point. Its parabolic path lies in a triangle. The corners
  !> are the two ends of the path, and the position that would be reached in half the time without
  !> gravity. The circle misses the triangle if all three corners lie behind a line that is parallel
  !> or perpendicular to the chord between the two ends.
  pure function falls_past(d, v, g, s, rho) result(yes)
    real(real64), intent(in) :: d(2), v(2), g(2), s, rho
    logical :: yes
    real(real64) :: middle(2), chord(2), chord2, along(2), across(2), clear, slack

    yes = .false.
    if (s > sqrt(never)) return                 ! the length of the path might overflow
    middle = 0.5_real64*s*v
    chord = s*(v + 0.5_real64*s*g)
    chord2 = chord(1)*chord(1) + chord(2)*chord(2)
    across(1) = d(1)*chord(2) - d(2)*chord(1)
    across(2) = across(1) + (middle(1)*chord(2) - middle(2)*chord(1))
    along(1) = d(1)*chord(1) + d(2)*chord(2)
    along(2) = along(1) + (middle(1)*chord(1) + middle(2)*chord(2))
    clear = max(min(across(1), across(2)), -max(across(1), across(2)), &
      min(along(1), along(2), along(1) + chord2), -max(along(1), along(2), along(1) + chord2))
    slack = spare*(abs(d(1)) + abs(d(2)) + abs(middle(1)) + abs(middle(2)) + rho)*(abs(chord(1)) + abs(chord(2)))
    clear = clear - slack
    yes = clear > 0 .and. clear*clear > rho*rho*chord2
  end function falls_past

  !> True if a falling point certainly stays outside a rectangle about the origin for a given time.
  !> Testing the bounding rectangle of the path costs much less than solving a quartic equation.
  pure function stays_outside(d, v, g, s, half) result(yes)
    real(real64), intent(in) :: d(2)            !! initial position [length]
    real(real64), intent(in) :: v(2)            !! [length/time]
    real(real64), intent(in) :: g(2)            !! [length/time**2]
    real(real64), intent(in) :: s               !! duration [time]
    real(real64), intent(in) :: half(2)         !! half the edges of the rectangle [length]
    logical :: yes
    real(real64) :: low, high, slack
    integer :: axis

    yes = .false.
    if (s > sqrt(never)) return                 ! the length of the path might overflow
    do axis = 1, 2
      low = s*min(v(axis), v(axis) + g(axis)*s, 0.0_real64)
      high = s*max(v(axis), v(axis) + g(axis)*s, 0.0_real64)
      slack = spare*(abs(d(axis)) + max(-low, high))
      yes = yes .or. d(axis) + high < -(half(axis) + slack) .or. d(axis) + low > half(axis) + slack
    end do
  end function stays_outside

  !> Distance between obstacle m and the rim of a disk centred at x; negative if they overlap.
  pure function obstacle_gap(box, m, x, radius) result(length)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: m
    real(real64), intent(in) :: x(2), radius    !! [length]
    real(real64) :: length

    associate (shape => box%obstacle(m)%shape)
      length = shape%gap(shape%from_nearest(x, box%images()), radius)
    end associate
  end function obstacle_gap

  !> Tangential velocity of a surface at the point of contact with a disk.
  pure function tangential_surface_velocity(box, code, x, normal) result(u)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: x(2)            !! centre of the disk [length]
    real(real64), intent(in) :: normal(2)       !! unit vector from the surface to the disk
    real(real64) :: u(2)                        !! [length/time]

    u = 0
    associate (law => box%surface(box%surface_of(code))%law)
      if (is_side(code)) then
        u(3 - axis_of(code)) = law%speed
      else if (abs(law%speed) > 0) then
        associate (shape => box%obstacle(obstacle_number(code))%shape)
          u = law%speed*shape%direction(shape%from_nearest(x, box%images(), heading=normal), normal)
        end associate
      end if
    end associate
  end function tangential_surface_velocity

  !> Unit normal vector of a surface at its contact with a disk, pointing towards the disk.
  pure function wall_normal(box, code, x, v) result(normal)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: code
    real(real64), intent(in) :: x(2)            !! centre of the disk [length]
    real(real64), intent(in) :: v(2)            !! velocity of the disk [length/time]
    real(real64) :: normal(2), d(2)

    if (is_side(code)) then
      normal = 0
      normal(axis_of(code)) = -sense_of(code)
    else
      associate (shape => box%obstacle(obstacle_number(code))%shape)
        d = shape%from_nearest(x, box%images(), heading=-v)
        normal = shape%normal(d, heading=-v)
      end associate
    end if
  end function wall_normal

  !> Accessible area: the area of the box, or of a smaller obstacle that encloses the disks, minus
  !> the area of all obstacles that disks touch from outside.
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
