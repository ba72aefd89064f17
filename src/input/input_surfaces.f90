!> Converts the groups of sides and obstacles to shapes, contact laws and motions.
module input_surfaces
  use arcs, only: new_arc
  use box_geometry, only: box_t
  use box_state, only: box_state_t
  use box_side, only: side_t
  use circles, only: new_circle
  use restitution_law, only: restitution_law_t
  use tangential_law, only: tangential_law_t
  use wall_law, only: normal_rule, wall_law_t, wall_rules
  use errors, only: error_t, exit_files
  use input_problems, only: problem_list_t
  use input_species, only: check_name
  use kinds, only: int64, real64
  use group_fields, only: group_fields_t
  use input_groups, only: group_t
  use motions, only: choose_motion
  use variables, only: either, row_of, table, words_of
  use obstacle_file, only: read_obstacles
  use partners, only: n_sides, side_name
  use segments, only: new_segment
  use texts, only: counted, place_of, written
  implicit none
  private
  public :: check_least, has_many, put_positions, take_grip, take_obstacles, take_wall_laws

contains

  !> Adds the obstacles to the box, unless one of them is incomplete.
  subroutine take_obstacles(groups, box, problems)
    type(group_t), intent(inout) :: groups(:)             !! all groups with a name in `obstacle_groups`
    type(box_t), intent(inout) :: box
    type(problem_list_t), intent(inout) :: problems
    logical :: complete
    integer :: k, m, v, n(size(groups))                   ! n: number of obstacles in each group

    complete = .true.
    do k = 1, size(groups)
      call check_name(groups, k, problems)
      call take_file(groups(k), problems)
      call take_points(groups(k), problems)
      call check_angles(groups(k), problems, complete)
      do v = 1, size(groups(k)%values)
        associate (value => groups(k)%values(v))
          if (table(value%row)%status /= "example") cycle      ! only variables with this status are required
          if (.not. has_many(groups(k))) call groups(k)%demand(trim(value%name), problems)
          complete = complete .and. value%is_set()
        end associate
      end do
    end do
    if (.not. complete) return
    do k = 1, size(groups)
      n(k) = size(groups(k)%reals_of(trim(merge("centre", "to    ", groups(k)%name == "obstacle"))))/2
    end do
    call box%add_obstacles(groups%instance, n)
    do k = 1, size(groups)
      m = sum(n(:k - 1))
      associate (group => groups(k))
        select case (group%name)
        case ("wall")
          call take_walls(group%reals_of("from"), group%reals_of("to"))
        case default                                      ! "obstacle"
          if (has(group, "from_angle")) call take_arcs(group%reals_of("centre"), group%reals_of("radius"), &
            group%real_of("from_angle", 0.0_real64), group%real_of("to_angle", 0.0_real64))
          if (.not. has(group, "from_angle")) call take_circles(group%reals_of("centre"), group%reals_of("radius"), &
            group%text_of("side") == "inside")
        end select
      end associate
    end do

  contains

    !> Straight walls of a group.
    subroutine take_walls(from, to)
      real(real64), intent(in) :: from(:), to(:)      !! x and y of the two end points of each wall [length]
      integer :: i

      do i = 1, size(to)/2
        allocate (box%obstacle(m + i)%shape, source=new_segment(from(2*i - 1:2*i), to(2*i - 1:2*i)))
      end do
    end subroutine take_walls

    !> Arcs of a group. They have a common first angle and a common last angle.
    subroutine take_arcs(centre, radius, from_angle, to_angle)
      !> x and y of the centre of curvature of each arc [length].
      real(real64), intent(in) :: centre(:)
      real(real64), intent(in) :: radius(:)               !! [length]
      real(real64), intent(in) :: from_angle, to_angle    !! [degrees]
      integer :: i

      do i = 1, size(radius)
        allocate (box%obstacle(m + i)%shape, source=new_arc(centre(2*i - 1:2*i), radius(i), from_angle, to_angle))
      end do
    end subroutine take_arcs

    !> Circles of a group.
    subroutine take_circles(centre, radius, encloses)
      real(real64), intent(in) :: centre(:)               !! x and y of the centre of each circle [length]
      real(real64), intent(in) :: radius(:)               !! [length]
      logical, intent(in) :: encloses
      integer :: i

      do i = 1, size(radius)
        allocate (box%obstacle(m + i)%shape, source=new_circle(centre(2*i - 1:2*i), radius(i), encloses))
      end do
    end subroutine take_circles
  end subroutine take_obstacles

  !> True if a group describes several obstacles, by a file or a polyline.
  pure function has_many(group) result(yes)
    type(group_t), intent(in) :: group
    logical :: yes

    yes = has(group, "file") .or. has(group, "points")
  end function has_many

  !> True if the group contains a variable of this name and the user has set it.
  pure function has(group, name) result(yes)
    type(group_t), intent(in) :: group
    character(len=*), intent(in) :: name
    logical :: yes

    yes = any(group%values%name == name .and. group%values%given)
  end function has

  !> Reads the obstacles of a group from its file. The data of the obstacles are stored as lists of
  !> values, in the variables that otherwise describe a single obstacle.
  subroutine take_file(group, problems)
    type(group_t), intent(inout) :: group
    type(problem_list_t), intent(inout) :: problems
    real(real64), allocatable :: rows(:, :)               ! shape (columns, n)
    type(error_t), allocatable :: error

    if (.not. has(group, "file")) return
    if (group%faulty("file")) return
    call read_obstacles(group%text_of("file"), group%name == "wall", rows, error)
    if (allocated(error)) then
      call group%complain("file", error%message, problems)
      if (error%code == exit_files) problems%unreadable = problems%unreadable + 1
    else if (group%name == "wall") then
      call group%put_reals("from", reshape(rows(:2, :), [2*size(rows, 2)]))
      call group%put_reals("to", reshape(rows(3:, :), [2*size(rows, 2)]))
    else
      call group%put_reals("centre", reshape(rows(:2, :), [2*size(rows, 2)]))
      call group%put_reals("radius", rows(3, :))
    end if
  end subroutine take_file

  !> Converts a polyline to straight walls between consecutive points.
  subroutine take_points(group, problems)
    type(group_t), intent(inout) :: group
    type(problem_list_t), intent(inout) :: problems

    if (.not. has(group, "points")) return
    if (group%faulty("points")) return
    associate (points => group%reals_of("points"))
      if (modulo(size(points), 2) > 0 .or. size(points) < 4) then
        call group%complain("points", counted(size(points, kind=int64), "value")//"; allowed: x1, y1, x2, y2, ... of two points " &
          //"or more", problems)
      else
        call group%put_reals("from", points(:size(points) - 2))
        call group%put_reals("to", points(3:))
      end if
    end associate
  end subroutine take_points

  !> Reports an arc with only one angle, and an arc that does not extend counter-clockwise or
  !> extends by more than one turn.
  subroutine check_angles(group, problems, complete)
    type(group_t), intent(in) :: group
    type(problem_list_t), intent(inout) :: problems
    logical, intent(inout) :: complete                    !! set to .false. if the angles are invalid
    real(real64) :: first, last                           ! [degrees]

    if (group%name /= "obstacle") return
    if (.not. (has(group, "from_angle") .or. has(group, "to_angle"))) return
    if (.not. has(group, "to_angle")) then
      call group%complain("from_angle", "is given without to_angle; an arc needs both angles", problems)
    else if (.not. has(group, "from_angle")) then
      call group%complain("to_angle", "is given without from_angle; an arc needs both angles", problems)
    else if (.not. (group%faulty("from_angle") .or. group%faulty("to_angle"))) then
      first = group%real_of("from_angle", 0.0_real64)
      last = group%real_of("to_angle", 0.0_real64)
      if (last > first .and. last <= first + 360) return
      call group%complain("to_angle", written(last)//" is not an angle after from_angle; allowed: a number > "//written(first) &
        //" and <= "//written(first + 360), problems)
    end if
    complete = .false.
  end subroutine check_angles

  !> Reads the contact laws of all sides and obstacles, and the motions of all sides. Values missing
  !> in a group are taken from `&contact`. With `running` and `t`, the input changes a running
  !> simulation. A side with a new motion then starts it at its present position, and an unchanged
  !> motion continues.
  subroutine take_wall_laws(sides, obstacles, otherwise, box, problems, running, t)
    type(group_t), intent(inout) :: sides(:)
    type(group_t), intent(inout) :: obstacles(:)
    type(wall_law_t), intent(in) :: otherwise             !! default contact law
    type(box_t), intent(inout) :: box
    type(problem_list_t), intent(inout) :: problems
    type(box_state_t), intent(in), optional :: running    !! box before the change
    real(real64), intent(in), optional :: t               !! time relative to `running%epoch` [time]
    integer :: k, side, line_of(n_sides)
    integer :: axis
    real(real64) :: width                                 ! width of the box [length]

    box%surface%law = otherwise
    if (otherwise%rule /= normal_rule) box%surface%law%tangential = tangential_law_t()
    line_of = 0
    do k = 1, size(sides)
      side = place_of(trim(sides(k)%instance), side_name)
      if (side == 0) then
        if (.not. sides(k)%faulty("name")) call sides(k)%complain("name", "is missing; give "//either(side_name), problems)
      else if (line_of(side) > 0) then
        call sides(k)%complain("name", "the side """//trim(side_name(side))//""" is already described in line "// &
          written(line_of(side)), problems)
      else if (.not. box%is_wall(side)) then
        call sides(k)%complain("name", "the side """//trim(side_name(side))//""" is periodic (box.boundary), not a wall", &
          problems)
      else
        line_of(side) = sides(k)%line
        call take_law(sides(k), box%surface(side)%law)
        axis = (side + 1)/2
        width = box%upper(axis) - box%lower(axis)
        call take_motion(sides(k), box%side(side))
        box%open(side) = sides(k)%text_of("open") == ".true."
        if (box%open(side) .and. box%side(side)%moves()) call sides(k)%complain("open", "cannot be combined with " &
          //"side.motion = '"//sides(k)%text_of("motion")//"' of the same side", problems)
        if (.not. box%side(side)%moves()) cycle
        ! Opposite sides must never touch, whatever the phases of their motions.
        if (width > 0 .and. sum(box%side(2*axis - 1:2*axis)%innermost_position()) >= width) call sides(k)%complain( &
          box%side(side)%motion%culprit(), "lets the sides meet, which are "//written(width)//" apart (box.upper)", problems)
      end if
    end do
    do k = n_sides + 1, size(box%surface)
      call take_law(obstacles(k - n_sides), box%surface(k)%law)
    end do

  contains

    !> Reads the contact law of one side or obstacle. Values taken from `&contact` are also stored
    !> in the group.
    subroutine take_law(group, law)
      type(group_t), intent(inout) :: group
      type(wall_law_t), intent(out) :: law

      associate (rules => words_of(wall_rules), thermal => group%given("temperature"))
        if (.not. (thermal .or. group%given("rule"))) call group%put_text("rule", trim(rules(otherwise%rule)))
        call group%check_choices(problems)
        law%speed = group%real_of("surface_velocity", 0.0_real64)
        law%temperature = group%real_of("temperature", 0.0_real64)
        if (thermal) return
        law%rule = max(1, place_of(group%text_of("rule"), rules))
      end associate
      law%by_speed = otherwise%by_speed
      call check_least(group, "restitution", law%by_speed, problems)
      law%restitution = group%real_of("restitution", otherwise%restitution)
      call group%put_reals("restitution", [law%restitution])
      if (law%rule == normal_rule) call take_grip(group, "", otherwise%tangential, law%tangential, problems)
      if (law%tangential%is_rough()) call group%put_reals("tangential_restitution", [law%tangential%restitution])
      if (law%tangential%is_rough() .and. law%tangential%friction < huge(law%tangential%friction)) &
        call group%put_reals("friction", [law%tangential%friction])
      if (abs(law%speed) > 0 .and. .not. law%tangential%is_rough()) call group%complain("surface_velocity", &
        "has no effect on disks without temperature or tangential_restitution of the same wall", problems)
    end subroutine take_law

    !> Reads the motion of a side.
    subroutine take_motion(group, place)
      type(group_t), intent(in) :: group
      type(side_t), intent(out) :: place
      type(group_fields_t) :: fields

      if (group%faulty("motion")) return
      call choose_motion(group%text_of("motion"), place%motion)
      fields = group_fields_t(group, problems)
      if (allocated(place%motion)) call place%motion%read(fields, width)
      if (present(running)) then
        call place%follow(running%side(side), running%side_position(side, t), running%epoch + t)
      else
        call place%place(given_offset(group, box, side))
      end if
      if (.not. allocated(place%motion)) return
      call place%motion%check(fields)
      problems = fields%problems
    end subroutine take_motion

  end subroutine take_wall_laws

  !> Inward displacement of a side when its motion starts, according to the variable `position`.
  pure function given_offset(group, box, side) result(x)
    type(group_t), intent(in) :: group
    type(box_t), intent(in) :: box
    integer, intent(in) :: side
    real(real64) :: x                                     !! [length]

    x = 0
    if (.not. group%given("position") .or. group%faulty("position")) return
    associate (position => group%real_of("position", 0.0_real64), axis => (side + 1)/2)
      x = merge(position - box%lower(axis), box%upper(axis) - position, modulo(side, 2) == 1)
    end associate
  end function given_offset

  !> Sets the variable `position` of each side to the position at which its motion started in a
  !> running simulation.
  subroutine put_positions(groups, box)
    type(group_t), intent(inout) :: groups(:)
    type(box_t), intent(in) :: box                        !! box of the running simulation
    real(real64) :: offset(n_sides)                       ! [length]
    integer :: g, side, axis

    offset = box%side%offset()
    do g = 1, size(groups)
      side = place_of(trim(groups(g)%instance), side_name)
      if (groups(g)%name /= "side" .or. side == 0) cycle
      associate (position => groups(g)%values(row_of("side", "position")))
        if (.not. any(words_of(table(position%row)%goes_with) == groups(g)%text_of("motion"))) cycle
        if (.not. abs(given_offset(groups(g), box, side) - offset(side)) > 0) cycle
        axis = (side + 1)/2
        position%given = abs(offset(side)) > 0
        call position%clear()
        if (position%given) position%reals = [merge(box%lower(axis) + offset(side), box%upper(axis) - offset(side), &
          modulo(side, 2) == 1)]
      end associate
    end do
  end subroutine put_positions

  !> Reports coefficients of restitution below the minimum of the viscoelastic law.
  subroutine check_least(group, name, by_speed, problems)
    type(group_t), intent(in) :: group
    character(len=*), intent(in) :: name
    type(restitution_law_t), intent(in) :: by_speed
    type(problem_list_t), intent(inout) :: problems

    if (group%given(name) .and. any(group%reals_of(name) < by_speed%least())) call group%complain(name, "must be at least " &
      //written(by_speed%least())//" with contact.restitution_law = 'viscoelastic': below that value its series has no solution", &
      problems)
  end subroutine check_least

  !> Reads the tangential contact law of disks or walls from the variables
  !> PREFIX`tangential_restitution` and PREFIX`friction`.
  subroutine take_grip(group, prefix, otherwise, grip, problems)
    type(group_t), intent(in) :: group
    character(len=*), intent(in) :: prefix
    type(tangential_law_t), intent(in) :: otherwise
    type(tangential_law_t), intent(out) :: grip
    type(problem_list_t), intent(inout) :: problems

    grip%restitution = group%real_of(prefix//"tangential_restitution", otherwise%restitution)
    grip%friction = group%real_of(prefix//"friction", otherwise%friction)
    if (group%given(prefix//"friction") .and. .not. grip%is_rough()) call group%complain(prefix//"friction", &
      "has no effect without "//prefix//"tangential_restitution, which is -1 (smooth); give that, too", problems)
  end subroutine take_grip

end module input_surfaces
