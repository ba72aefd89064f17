!> Checks the geometry of the system that an input describes: obstacles and regions must lie inside the box, and the disks must fit
!> into their regions. Each problem is reported with the number of the line of the input file that causes the problem.
module input_fit
  use kinds, only: int32, int64, pi, real64
  use box_geometry, only: box_t
  use box_sides, only: bounds, spans
  use errors, only: exit_files
  use input_groups, only: group_t, range_of
  use input_problems, only: most_problems, problem_list_t
  use input_surfaces, only: has_many
  use memory, only: check_memory
  use obstacle_file, only: origin_of_row
  use partners, only: n_sides, side_name
  use position_file, only: angle_row, radius_row, spin_row
  use radii, only: drawn_radii
  use settings, only: settings_t, species_settings_t
  use side_motion, only: piston, constant_velocity
  use starting_disks, only: read_disks, resolution
  use texts, only: place_of, written
  use variables, only: most_disks, obstacle_groups
  implicit none
  private
  public :: check_fit, report_file_problem, complete_settings

  real(real64), parameter, public :: rounding = 1.0e-12_real64        !! relative tolerance for disks that touch
  real(real64), parameter :: random_limit = 0.547_real64      !! packing fraction at which random sequential insertion saturates
  real(real64), parameter :: closest_packing = pi/sqrt(12.0_real64)     !! packing fraction of the triangular lattice
  !> Ratio of the smallest to the largest radius above which disks of different sizes cannot be packed more densely than disks of
  !> equal size (Blind, 1969, see `densest_packing`)
  real(real64), parameter :: nearly_equal = 0.743_real64

  !> Area and range of radii of the disks of a species.
  type :: extent_t
    real(real64) :: area = 0.0_real64                         !! sum over all disks [length**2]
    real(real64) :: smallest = 0.0_real64, largest = 0.0_real64   !! radii [length]
  end type extent_t

contains

  !> Completes the settings with values from starting files and with the drawn radii, and determines the features of the run.
  subroutine complete_settings(settings, groups, problems, complete)
    type(settings_t), intent(inout) :: settings
    type(group_t), intent(inout) :: groups(:)
    !> Problems of the input. The procedure adds a problem for each starting file that cannot be read, and a problem if the memory
    !> is too small.
    type(problem_list_t), intent(inout) :: problems
    logical, intent(out) :: complete                          !! .false. if the number of disks is too large or the box is invalid
    integer :: s(2), k, before

    complete = .false.
    if (any(settings%box%lower >= settings%box%upper)) return
    s = range_of(groups, ["species"])
    do k = 1, size(settings%species)
      call read_missing_values(settings%species, k, settings%box, groups(s(1) + k - 1), problems)
    end do
    call settings%choose_features()
    call check_columns(settings, groups(place_of("output", groups%name)), problems)
    if (settings%n_disks() > most_disks) return               ! another procedure reports an excessive number of disks
    before = problems%count
    call check_memory(settings, problems)
    if (problems%count > before) return
    do k = 1, size(settings%species)
      call measure_radii(settings%species(k), k, settings%run%seed, groups(s(1) + k - 1))
    end do
    complete = .true.
  end subroutine complete_settings

  !> Reports requested columns of the frames that the run does not have, such as orientations of disks that do not rotate. The
  !> columns are checked after the starting files have been read, because a starting file can determine whether the disks rotate.
  subroutine check_columns(settings, group, problems)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: group                        !! the group `output`
    type(problem_list_t), intent(inout) :: problems

    if (.not. allocated(settings%output%frame_columns)) return
    call need("image", any(settings%box%periodic), "a periodic axis (box.boundary)")
    call need("angular_velocity", settings%features%rotation, "disks that rotate, for example by contact.tangential_restitution")
    call need("orientation", settings%features%orientation, &
      "disks that rotate, active disks, or a starting file with orientations")
    call need("recycled", settings%drive%moves_disks(), "drive.kind = 'recycle'")

  contains

    !> Reports a problem if a requested column of the frames requires a property that the run does not have.
    subroutine need(column, there, what)
      character(len=*), intent(in) :: column, what
      logical, intent(in) :: there                            !! .true. if the run has the property that the column requires

      if (.not. there .and. any(settings%output%frame_columns == column)) &
        call group%complain("frame_columns", "'"//column//"' needs "//what, problems)
    end subroutine need
  end subroutine check_columns

  !> Checks completed settings: whether the obstacles fit into the box, and whether the disks of each species fit into their region.
  !> Species for which the number or the size of the disks is invalid are skipped, because these errors have already been reported.
  subroutine check_fit(settings, groups, problems)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: groups(:)
    type(problem_list_t), intent(inout) :: problems
    character(len=:), allocatable :: misfit                   ! name of the variable, a colon, and the problem
    real(real64) :: beyond(2, 2)
    type(extent_t) :: extent(size(settings%species))
    integer :: o(2), s(2), k

    o = range_of(groups, obstacle_groups)
    s = range_of(groups, ["species"])
    associate (box => settings%box, species => settings%species)
      beyond = box%side_excursion()                           ! distance by which moving sides extend beyond the box
      do k = 1, box%n_obstacles()                             ! the function `misfit` of a shape checks the position of an obstacle
        misfit = box%obstacle(k)%shape%misfit(box%lower - beyond(:, 1), box%upper + beyond(:, 2), box%periodic)
        if (misfit /= "") call report_obstacle_problem(box, k, groups(o(1) + box%obstacle(k)%surface - n_sides - 1), misfit, &
          problems)
        if (problems%count >= most_problems) exit
      end do
      do k = 1, size(species)
        call check_species(groups(s(1) + k - 1), species(k), box, settings%n_disks() == 1, problems)
      end do
      if (settings%drive%moves_disks()) call check_recycling(settings, groups(place_of("drive", groups%name)), problems)
      if (problems%count > 0) return
      extent = [(extent_of(species(k), k, settings%run%seed), k=1, size(species))]
      call check_packing(species, extent, groups(s(1):s(2)), problems)
      call check_containers(box, sum(extent%area), groups(s(1)), problems)
      if (problems%count == 0) call check_strokes(box, sum(extent%area), groups, problems)
    end associate
  end subroutine check_fit

  !> Checks the two regions of recycling. Both regions must lie in the box, and they must not overlap each other. The region to
  !> which disks move must be wide enough for a disk and must not overlap an obstacle.
  subroutine check_recycling(settings, group, problems)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: group                        !! the group `drive`
    type(problem_list_t), intent(inout) :: problems
    real(real64), parameter :: nearly = 1 - 1.0e-4_real64     ! factor below 1, because a region may touch an obstacle
    real(real64) :: beyond(2, 2), radius, middle(2), half(2)
    integer :: before, k

    before = problems%count
    beyond = settings%box%side_excursion()
    call check_region("from_region", settings%drive%from_region)
    call check_region("to_region", settings%drive%to_region)
    if (problems%count > before .or. .not. (group%given("from_region") .and. group%given("to_region"))) return
    associate (box => settings%box, from => settings%drive%from_region, to => settings%drive%to_region)
      if (all(from([1, 3]) < to([2, 4]) .and. to([1, 3]) < from([2, 4]))) then
        call group%complain("to_region", "it overlaps drive.from_region, so that disks would be recycled again and again", problems)
        return
      end if
      radius = maxval(settings%species%radius, mask=settings%drive%acts_on([(k, k=1, size(settings%species))]))
      half = 0.5_real64*(to([2, 4]) - to([1, 3]))
      middle = 0.5_real64*(to([1, 3]) + to([2, 4]))
      if (any(half <= radius .and. .not. spans(to, box))) call group%complain("to_region", &
        "a disk of diameter "//written(2*radius)//" needs more room; the region is "//written(2*half(1))//" x " &
        //written(2*half(2)), problems)
      half = max(half - merge(0.0_real64, radius, spans(to, box)), 0.0_real64)       ! the rectangle for the centres of disks
      do k = 1, box%n_obstacles()
        if (.not. is_in_the_way(box, k, middle, nearly*half, nearly*radius)) cycle
        call group%complain("to_region", 'it overlaps obstacle "'//box%surface(box%obstacle(k)%surface)%name//'"', problems)
        exit
      end do
    end associate

  contains

    !> Reports a region that is empty or extends beyond the box.
    subroutine check_region(name, region)
      character(len=*), intent(in) :: name
      real(real64), intent(in) :: region(4)                   !! xlo, xhi, ylo, yhi [length]

      if (.not. group%given(name) .or. group%faulty(name)) return
      if (any(region([1, 3]) >= region([2, 4]))) then
        call group%complain(name, "its lower ends must be below its upper ends; give xlo, xhi, ylo, yhi", problems)
      else if (any(region([1, 3]) < settings%box%lower - beyond(:, 1) .or. region([2, 4]) > settings%box%upper + beyond(:, 2))) then
        call group%complain(name, "it extends beyond the box", problems)
      end if
    end subroutine check_region
  end subroutine check_recycling

  !> Whether a disk whose centre is in a rectangle can touch an obstacle, or the obstacle excludes disks from the whole rectangle.
  pure function is_in_the_way(box, m, middle, half, radius) result(yes)
    type(box_t), intent(in) :: box
    integer, intent(in) :: m                                  !! index of the obstacle
    real(real64), intent(in) :: middle(2), half(2)            !! centre and half edges of the rectangle [length]
    real(real64), intent(in) :: radius                        !! [length]
    logical :: yes
    real(real64) :: d(2)
    integer :: last(2), kx, ky

    yes = .false.
    associate (shape => box%obstacle(m)%shape)
      last = merge(1, 0, box%periodic .and. .not. shape%encloses)
      do ky = -last(2), last(2)
        do kx = -last(1), last(1)
          d = middle + [kx, ky]*box%edges() - shape%middle
          yes = shape%reaches(d, half, radius) .or. shape%covers(d, half, radius)
          if (yes) return
        end do
      end do
    end associate
  end function is_in_the_way

  !> Area and range of radii of the disks of the k-th species.
  pure function extent_of(species, k, seed) result(extent)
    type(species_settings_t), intent(in) :: species
    integer, intent(in) :: k
    integer(int64), intent(in) :: seed                        !! seed of the run
    type(extent_t) :: extent
    real(real64), allocatable :: radius(:)                    ! [length]

    extent = extent_t(species%count*pi*species%radius**2, species%radius, species%radius)
    if (species%radius_in_file) then
      radius = species%in_file%table(radius_row, :)
    else if (species%polydispersity > 0) then
      radius = drawn_radii(species, k, seed)
    end if
    if (allocated(radius)) extent = extent_t(pi*sum(radius**2), minval(radius), maxval(radius))
  end function extent_of

  !> Reports a region whose packing fraction would exceed a proven upper bound. No method could place the disks, and some would try
  !> for a long time. The packing fraction of a region includes the disks of all species that are placed within the region. Given
  !> positions are not bound to a region.
  pure subroutine check_packing(species, extent, groups, problems)
    type(species_settings_t), intent(in) :: species(:)
    type(extent_t), intent(in) :: extent(:)                   !! areas and radii of the disks of each species
    type(group_t), intent(in) :: groups(:)                    !! groups of the species
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: packing, smallest, largest, most
    logical :: within(size(species))
    integer :: k, j

    do k = 1, size(species)
      associate (region => species(k)%region)
        within = [(all(species(j)%region([1, 3]) >= region([1, 3])) .and. all(species(j)%region([2, 4]) <= region([2, 4])) &
          .and. all(species(j)%placement /= [character(len=8) :: "explicit", "file"]), j=1, size(species))]
        packing = sum(extent%area, mask=within)/product(region([2, 4]) - region([1, 3]))
      end associate
      if (.not. within(k)) cycle
      smallest = minval(extent%smallest, mask=within)
      largest = maxval(extent%largest, mask=within)
      most = densest_packing(smallest/largest)
      if (packing <= most*(1 + rounding)) cycle
      call groups(k)%complain("placement", "the disks in this region would fill "//written(packing)//" of it; disks with radii " &
        //"from "//written(smallest)//" to "//written(largest)//" fill at most "//written(most), problems)
      return
    end do
  end subroutine check_packing

  !> Reports a container whose area is smaller than that of all disks.
  pure subroutine check_containers(box, area, group, problems)
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: area                          !! total area of the disks [length**2]
    type(group_t), intent(in) :: group                        !! group of the first species
    type(problem_list_t), intent(inout) :: problems
    integer(int32) :: k

    do k = 1, box%n_obstacles()
      associate (obstacle => box%obstacle(k))
        if (.not. obstacle%shape%encloses .or. area <= obstacle%shape%area) cycle
        call group%complain("count", "all disks have the area "//written(area)//', and obstacle "' &
          //box%surface(obstacle%surface)%name//'" contains '//written(obstacle%shape%area), problems)
        return
      end associate
    end do
  end subroutine check_containers

  !> Upper bound of the packing fraction of disks in the plane. The bound also holds for a rectangle with sides and for a periodic
  !> box, because copies of a rectangle fill the plane. For disks of nearly equal radii the bound is the packing fraction of the
  !> triangular lattice (Blind, Journal für die reine und angewandte Mathematik 236, 145, 1969). For other radii the bound is the
  !> packing fraction inside the triangle whose corners are the centres of one largest disk and two smallest disks that touch each
  !> other (Florian, Rendiconti del Circolo Matematico di Palermo 9, 300, 1960). Fernique (2021, arXiv:2107.14079) reviews the
  !> bounds of Blind and Florian.
  pure function densest_packing(ratio) result(most)
    real(real64), intent(in) :: ratio                         !! smallest radius divided by largest radius
    real(real64) :: most

    most = closest_packing
    if (ratio < nearly_equal) most = (pi*ratio**2 + 2*(1 - ratio**2)*asin(ratio/(1 + ratio)))/(2*ratio*sqrt(1 + 2*ratio))
  end function densest_packing

  !> Reports an invalid position of an obstacle, with the line of the obstacle in its file or the number of the point in its
  !> polyline.
  subroutine report_obstacle_problem(box, m, group, misfit, problems)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: m                           !! index of the obstacle
    type(group_t), intent(in) :: group
    character(len=*), intent(in) :: misfit                    !! name of the variable, a colon, and the problem
    type(problem_list_t), intent(inout) :: problems
    integer :: colon, number

    colon = index(misfit, ": ")
    number = count(box%obstacle(:m)%surface == box%obstacle(m)%surface)          ! index of the obstacle in its group
    if (has_many(group) .and. .not. any(group%values%name == "points" .and. group%values%given)) then
      call group%complain("file", origin_of_row(group%text_of("file"), number)//": "//misfit, problems)
    else if (has_many(group)) then
      call group%complain("points", "point "//written(number + merge(1, 0, misfit(:colon - 1) == "to"))//" "//misfit(colon + 2:), &
        problems)
    else
      call group%complain(misfit(:colon - 1), misfit(colon + 2:), problems)
    end if
  end subroutine report_obstacle_problem

  !> Reports sides that would crush the disks, because the box would be smaller at the end of the motion than the total area of the
  !> disks. A box with a piston is not checked, because the disks can push the piston outwards.
  subroutine check_strokes(box, disks, groups, problems)
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: disks                         !! total area of the disks [length**2]
    type(group_t), intent(in) :: groups(:)
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: low(2), high(2), last
    integer :: o(2), k, side, axis

    if (any(box%surface(:n_sides)%motion%kind == piston)) return
    o = range_of(groups, ["side"])
    do k = o(1), o(2)
      side = place_of(trim(groups(k)%instance), side_name)
      axis = (side + 1)/2
      associate (motion => box%surface(side)%motion)
        if (motion%kind /= constant_velocity .or. motion%prescribed_velocity < 0) cycle
        call bounds(box, motion%end_time, low, high)
        if (product(high - low) > disks) cycle
        if (.not. motion%prescribed_velocity > 0) then
          call groups(k)%complain("position", "leaves the disks less than their own area, "//written(disks), problems)
          cycle
        end if
        last = motion%end_time - (disks/(high(3 - axis) - low(3 - axis)) - (high(axis) - low(axis)))/motion%prescribed_velocity
        call groups(k)%complain("end_time", "the side would crush the disks, which need at least their own area, "// &
          written(disks)//"; allowed: a time before "//written(last), problems)
      end associate
    end do
  end subroutine check_strokes

  !> Reads from a starting file the number and the radii of the disks of a species, unless the input contains these values, and
  !> determines whether the disks rotate. If the input determines the number and the radii of the disks, an unreadable file is
  !> reported only when the disks are placed, because a resumed run places no disks and does not need the file.
  subroutine read_missing_values(species, k, box, group, problems)
    type(species_settings_t), intent(inout) :: species(:)
    integer, intent(in) :: k                                  !! index of the species
    type(box_t), intent(in) :: box
    type(group_t), intent(inout) :: group
    type(problem_list_t), intent(inout) :: problems
    logical :: decides

    associate (s => species(k))
      if (s%file == "" .or. group%faulty("file")) return
      decides = s%radius_in_file .or. (s%count == 0 .and. .not. (group%given("count") .or. group%given("packing_fraction")))
      if (.not. decides .and. (s%count == 0 .or. s%radius <= 0)) return
      call read_disks(species, k, box)
      if (allocated(s%in_file%error)) then
        s%spin_in_file = .false.
        if (decides) call report_file_problem(s, group, problems)
        return
      end if
      if (size(s%in_file%rows) == 0) call group%complain("file", s%file//" contains no disks of species """//s%name//'"', problems)
      if (size(s%in_file%rows) == 0) return
      s%spin_in_file = s%spin_in_file .and. s%in_file%there(spin_row)
      s%angle_in_file = s%in_file%there(angle_row)
      if (.not. decides) return
      associate (radius => s%in_file%table(radius_row, :))
        s%count = size(radius)
        call group%put_text("count", written(s%count))
        if (s%radius_in_file) s%radius = maxval(radius)
        if (all(s%region([1, 3]) < s%region([2, 4]))) call group%put_reals("packing_fraction", &
          [pi*sum(radius**2)/product(s%region([2, 4]) - s%region([1, 3]))])
      end associate
    end associate
  end subroutine read_missing_values

  !> Determines the largest of the radii that the run will draw, and the packing fraction of disks with the drawn radii.
  subroutine measure_radii(s, k, seed, group)
    type(species_settings_t), intent(inout) :: s
    integer, intent(in) :: k                                  !! index of the species
    integer(int64), intent(in) :: seed                        !! seed of the run
    type(group_t), intent(inout) :: group
    real(real64), allocatable :: radius(:)                    ! [length]

    if (.not. (s%polydispersity > 0 .and. s%count > 0)) return
    radius = drawn_radii(s, k, seed)
    s%radius = maxval(radius)
    if (all(s%region([1, 3]) < s%region([2, 4])) .and. .not. group%given("packing_fraction")) &
      call group%put_reals("packing_fraction", [pi*sum(radius**2)/product(s%region([2, 4]) - s%region([1, 3]))])
  end subroutine measure_radii

  !> Reports why the disks in a starting file cannot be used.
  subroutine report_file_problem(s, group, problems)
    type(species_settings_t), intent(in) :: s
    type(group_t), intent(in) :: group
    type(problem_list_t), intent(inout) :: problems

    call group%complain("file", s%in_file%error%message, problems)
    if (s%in_file%error%code == exit_files) problems%unreadable = problems%unreadable + 1
  end subroutine report_file_problem

  !> Checks that a disk of a species fits into its region, into each period of the box, and into every obstacle that encloses the
  !> disks.
  subroutine check_species(group, s, box, alone, problems)
    type(group_t), intent(in) :: group
    type(species_settings_t), intent(in) :: s
    type(box_t), intent(in) :: box
    !> .true. if the run has only one disk, which belongs to this species
    logical, intent(in) :: alone
    type(problem_list_t), intent(inout) :: problems
    logical :: sound
    integer :: axis, k

    if (s%radius <= 0 .or. s%count < 1 .or. group%faulty("region")) return
    do axis = 1, 2
      call check_axis()
      if (.not. sound) return
    end do
    if (.not. (s%radius_in_file .or. s%polydispersity > 0)) call check_fraction()
    do k = 1, box%n_obstacles()
      associate (shape => box%obstacle(k)%shape)
        if (shape%encloses .and. any(shape%extent <= s%radius)) call group%complain("radius", "a disk of radius "// &
          written(s%radius)//" does not fit in obstacle """//box%surface(box%obstacle(k)%surface)%name//'"', problems)
      end associate
    end do

  contains

    !> Checks one axis. The region must lie in the box and be wide enough for a disk. A period must exceed two diameters, so that no
    !> disk can touch two images of another disk at the same time.
    subroutine check_axis()
      logical :: endless(2)
      real(real64) :: lower, upper, room, farthest, least, low(2), high(2)

      call bounds(box, 0.0_real64, low, high)
      sound = .false.
      endless = spans(s%region, box)
      lower = s%region(2*axis - 1)
      upper = s%region(2*axis)
      room = min(upper, high(axis)) - max(lower, low(axis))   ! width of the region between the displaced sides
      farthest = max(abs(box%lower(axis)), abs(box%upper(axis)))
      least = merge(2*s%radius, 4*s%radius + rounding*farthest, alone)
      if (lower >= upper) then
        call complain("region", "its lower end "//written(lower)//" is not below its upper end "//written(upper))
      else if (lower < min(box%lower(axis), low(axis)) .or. upper > max(box%upper(axis), high(axis))) then
        call complain("region", "it extends beyond the box, "//written(box%lower(axis))//" to "//written(box%upper(axis)))
      else if (.not. endless(axis) .and. 2*s%radius > room*(1 + rounding)) then
        call complain("radius", "a disk of diameter "//written(2*s%radius)//" does not fit in its region of width "//written(room))
      else if (box%periodic(axis) .and. least > box%upper(axis) - box%lower(axis)) then
        call complain("radius", "a periodic box must be "//trim(merge("at least one diameter wide", "wider than two diameters  ", &
          alone))//", "//written(merge(2, 4, alone)*s%radius)//"; it is "//written(box%upper(axis) - box%lower(axis)))
      else if (s%radius < resolution*farthest) then
        call complain("radius", written(s%radius)//" is too small to be resolved at coordinates of "//written(farthest))
      else
        sound = .true.
      end if
    end subroutine check_axis

    !> Reports a problem together with the name of the axis.
    subroutine complain(variable, what)
      character(len=*), intent(in) :: variable, what

      call group%complain(variable, what//", along "//merge("x", "y", axis == 1), problems)
    end subroutine complain

    !> Checks that the packing fraction does not exceed the packing fraction of the densest possible packing.
    subroutine check_fraction()
      real(real64) :: packing
      character(len=:), allocatable :: variable, filled

      packing = s%count*pi*s%radius**2/product(s%region([2, 4]) - s%region([1, 3]))
      variable = "radius"
      if (group%given("packing_fraction")) variable = "packing_fraction"
      filled = "the disks would fill "//written(packing)//" of their region; "
      if (packing > closest_packing*(1 + rounding)) then
        call group%complain(variable, filled//"the closest packing is "//written(closest_packing), problems)
      else if (packing > random_limit .and. s%placement == "random") then
        call group%complain(variable, filled//"random placement reaches "//written(random_limit)// &
          ", placement = 'dense' more", problems)
      end if
    end subroutine check_fraction
  end subroutine check_species

end module input_fit
