!> Checks the geometry of the system. The obstacles and regions must lie inside the box, and the
!> disks must fit into their regions. Each problem is reported with the responsible line of the
!> input file.
module input_fit
  use kinds, only: int32, int64, never, pi, real64
  use box_geometry, only: box_t, spans
  use box_state, only: bounds, box_state_t
  use drives, only: counting_drives, drive_counters
  use entries, only: check_source
  use errors, only: exit_files
  use group_fields, only: group_fields_t
  use input_groups, only: group_t, range_of
  use input_problems, only: most_problems, problem_list_t
  use input_surfaces, only: has_many
  use memory, only: check_memory
  use obstacle_file, only: origin_of_row
  use partners, only: n_sides, side_name
  use position_file, only: angle_row, radius_row, spin_row
  use radii, only: drawn_radii
  use sample_values, only: all_columns, frame_column_t, has_columns
  use settings, only: settings_t, species_settings_t
  use starting_disks, only: read_disks, resolution
  use texts, only: place_of, written
  use variables, only: most_disks, obstacle_groups
  implicit none
  private
  public :: check_fit, report_file_problem, complete_settings

  !> Relative tolerance for touching disks.
  real(real64), parameter, public :: touching_tolerance = 1.0e-12_real64
  !> Packing fraction of the triangular lattice.
  real(real64), parameter :: closest_packing = pi/sqrt(12.0_real64)
  !> Ratio of the smallest to the largest radius above which the densest packing of unequal disks is
  !> no denser than the densest packing of equal disks (Blind, 1969, see `densest_packing`).
  real(real64), parameter :: nearly_equal = 0.743_real64

  !> Total area and range of radii of the disks of a species.
  type :: extent_t
    real(real64) :: area = 0.0_real64                         !! total area [length**2]
    real(real64) :: smallest = 0.0_real64, largest = 0.0_real64   !! radii [length]
  end type extent_t

contains

  !> Completes the settings by reading initial-configuration files and drawing random radii, and
  !> determines the features of the run.
  subroutine complete_settings(settings, groups, problems, complete)
    type(settings_t), intent(inout) :: settings
    type(group_t), intent(inout) :: groups(:)
    !> Problems of the input. Unreadable files and insufficient memory are added to the list.
    type(problem_list_t), intent(inout) :: problems
    !> .false. if the box is invalid or the number of disks is too large.
    logical, intent(out) :: complete
    integer :: s(2), k, before

    complete = .false.
    if (any(settings%box%lower >= settings%box%upper)) return
    s = range_of(groups, ["species"])
    do k = 1, size(settings%species)
      call read_missing_values(settings%species, k, settings%box, groups(s(1) + k - 1), problems)
    end do
    call settings%choose_features()
    call check_columns(settings, groups(place_of("output", groups%name)), problems)
    if (settings%n_disks() > most_disks) return               ! reported elsewhere
    before = problems%count
    call check_memory(settings, problems)
    if (problems%count > before) return
    do k = 1, size(settings%species)
      call measure_radii(settings%species(k), k, settings%run%seed, groups(s(1) + k - 1))
    end do
    complete = .true.
  end subroutine complete_settings

  !> Reports requested frame columns that do not exist in this run, such as orientations of disks
  !> that do not rotate. Initial-configuration files must have been read before, because their
  !> contents can determine whether disks rotate.
  subroutine check_columns(settings, group, problems)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: group                        !! the group `output`
    type(problem_list_t), intent(inout) :: problems

    type(frame_column_t) :: column
    integer :: k

    if (.not. allocated(settings%output%frame_columns)) return
    associate (lacking => .not. has_columns(settings, settings%box%periodic))
      do k = 1, size(all_columns)
        column = all_columns(k)
        if (column%name == "") then
          column%name = drive_counters
          column%needs = "drive.kind = '"//counting_drives//"'"
        end if
        if (lacking(k) .and. any(settings%output%frame_columns == column%name)) call group%complain("frame_columns", &
          "'"//trim(column%name)//"' needs "//trim(column%needs), problems)
      end do
    end associate
  end subroutine check_columns

  !> Checks that the obstacles fit into the box, and the disks of each species into their region.
  !> Species with an invalid number or size of disks are skipped, because this problem has already
  !> been reported.
  subroutine check_fit(settings, groups, problems, running)
    type(settings_t), intent(in) :: settings
    type(group_t), intent(in) :: groups(:)
    type(problem_list_t), intent(inout) :: problems
    !> .true. if the disks are already moving; their initial state is then not checked.
    logical, intent(in) :: running
    character(len=:), allocatable :: misfit                   ! "variable: problem"
    type(box_state_t) :: box                                  ! box at the start
    real(real64) :: beyond(2, 2)
    type(extent_t) :: extent(size(settings%species))
    type(group_fields_t) :: fields
    integer :: o(2), s(2), k

    o = range_of(groups, obstacle_groups)
    s = range_of(groups, ["species"])
    box = box_state_t(settings%box)
    associate (species => settings%species)
      beyond = box%side_excursion()      ! distance that moving sides extend beyond the box
      do k = 1, box%n_obstacles()                             ! each shape checks its position by `misfit`
        misfit = box%obstacle(k)%shape%misfit(box%lower - beyond(:, 1), box%upper + beyond(:, 2), box%periodic)
        if (misfit /= "") call report_obstacle_problem(box%box_t, k, groups(o(1) + box%obstacle(k)%surface - n_sides - 1), &
          misfit, problems)
        if (problems%count >= most_problems) exit
      end do
      do k = 1, merge(0, size(species), running)
        call check_species(groups(s(1) + k - 1), species(k), box, settings%n_disks() == 1, problems)
      end do
      if (allocated(settings%drive)) then
        fields = group_fields_t(groups(place_of("drive", groups%name)), problems)
        call settings%drive%check(fields, box%box_t, species%count, species%radius)
        problems = fields%problems
      end if
      o = range_of(groups, ["source"])
      do k = 1, o(2) - o(1) + 1
        fields = group_fields_t(groups(o(1) + k - 1), problems)
        call check_source(settings%source(k), fields, box%box_t, species(settings%source(k)%species)%radius)
        problems = fields%problems
      end do
      if (problems%count > 0) return
      extent = [(extent_of(species(k), k, settings%run%seed), k=1, size(species))]
      if (.not. running) call check_packing(species, extent, groups(s(1):s(2)), problems)
      if (.not. running) call check_containers(box%box_t, sum(extent%area), groups(s(1)), problems)
      if (problems%count == 0) call check_strokes(box, sum(extent%area), groups, problems)
    end associate
  end subroutine check_fit

  !> Total area and range of radii of the disks of species k that are in the box at the start.
  pure function extent_of(species, k, seed) result(extent)
    type(species_settings_t), intent(in) :: species
    integer, intent(in) :: k
    integer(int64), intent(in) :: seed                        !! seed of the run
    type(extent_t) :: extent
    real(real64), allocatable :: radius(:)                    ! [length]

    extent = extent_t((species%count - species%waiting)*pi*species%radius**2, species%radius, species%radius)
    if (species%radius_in_file) then
      radius = species%in_file%table(radius_row, :)
    else if (species%polydispersity > 0) then
      radius = drawn_radii(species, k, seed)
      radius = radius(:size(radius) - species%waiting)
    end if
    if (species%waiting == species%count) return
    if (allocated(radius)) extent = extent_t(pi*sum(radius**2), minval(radius), maxval(radius))
  end function extent_of

  !> Reports a region with a packing fraction above a proven upper bound. The packing fraction
  !> includes all species placed in the region. No method could place these disks, and some methods
  !> would try for a long time. Given positions are not bound to a region.
  pure subroutine check_packing(species, extent, groups, problems)
    type(species_settings_t), intent(in) :: species(:)
    type(extent_t), intent(in) :: extent(:)                   !! extent of each species
    type(group_t), intent(in) :: groups(:)                    !! groups of the species
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: packing, smallest, largest, most
    logical :: within(size(species))
    integer :: k, j

    do k = 1, size(species)
      associate (region => species(k)%region)
        within = [(all(species(j)%region([1, 3]) >= region([1, 3])) .and. all(species(j)%region([2, 4]) <= region([2, 4])) &
          .and. species(j)%placement%is_bound(), j=1, size(species))]
        packing = sum(extent%area, mask=within)/product(region([2, 4]) - region([1, 3]))
      end associate
      if (.not. within(k)) cycle
      smallest = minval(extent%smallest, mask=within)
      largest = maxval(extent%largest, mask=within)
      most = densest_packing(smallest/largest)
      if (packing <= most*(1 + touching_tolerance)) cycle
      call groups(k)%complain("placement", "the disks in this region would fill "//written(packing)//" of it; disks with radii " &
        //"from "//written(smallest)//" to "//written(largest)//" fill at most "//written(most), problems)
      return
    end do
  end subroutine check_packing

  !> Reports a container whose area is smaller than the total area of the disks.
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

  !> Upper bound of the packing fraction of disks in the plane. The bound also holds for a
  !> rectangular box, walled or periodic, because copies of the box fill the plane at the same
  !> packing fraction. For nearly equal radii it is the packing fraction of the triangular lattice
  !> (Blind, Journal für die reine und angewandte Mathematik 236, 145, 1969). For other radii,
  !> consider a disk of the largest radius and two disks of the smallest radius that all touch each
  !> other. The bound is the packing fraction in the triangle of their centres (Florian, Rendiconti
  !> del Circolo Matematico di Palermo 9, 300, 1960). Both results are reviewed by Fernique (2021,
  !> arXiv:2107.14079).
  pure function densest_packing(ratio) result(most)
    real(real64), intent(in) :: ratio                         !! smallest radius divided by the largest
    real(real64) :: most

    most = closest_packing
    if (ratio < nearly_equal) most = (pi*ratio**2 + 2*(1 - ratio**2)*asin(ratio/(1 + ratio)))/(2*ratio*sqrt(1 + 2*ratio))
  end function densest_packing

  !> Reports an invalid position of an obstacle, with its line in a file or its point number in a
  !> polyline.
  subroutine report_obstacle_problem(box, m, group, misfit, problems)
    type(box_t), intent(in) :: box
    integer(int32), intent(in) :: m                           !! index of the obstacle
    type(group_t), intent(in) :: group
    character(len=*), intent(in) :: misfit                    !! "variable: problem"
    type(problem_list_t), intent(inout) :: problems
    integer :: colon, number

    colon = index(misfit, ": ")
    number = count(box%obstacle(:m)%surface == box%obstacle(m)%surface)   ! index of the obstacle in its group
    if (has_many(group) .and. .not. any(group%values%name == "points" .and. group%values%given)) then
      call group%complain("file", origin_of_row(group%text_of("file"), number)//": "//misfit, problems)
    else if (has_many(group)) then
      call group%complain("points", "point "//written(number + merge(1, 0, misfit(:colon - 1) == "to"))//" "//misfit(colon + 2:), &
        problems)
    else
      call group%complain(misfit(:colon - 1), misfit(colon + 2:), problems)
    end if
  end subroutine report_obstacle_problem

  !> Reports sides that would crush the disks, because their motion makes the box smaller than the
  !> total area of the disks. Boxes with a piston are not checked, because the disks can push it
  !> outwards.
  subroutine check_strokes(box, disks, groups, problems)
    type(box_state_t), intent(in) :: box
    real(real64), intent(in) :: disks                         !! total area of the disks [length**2]
    type(group_t), intent(in) :: groups(:)
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: low(2), high(2), last
    integer :: o(2), k, side, axis

    if (any(box%side%is_piston())) return
    o = range_of(groups, ["side"])
    do k = o(1), o(2)
      side = place_of(trim(groups(k)%instance), side_name)
      axis = (side + 1)/2
      if (.not. allocated(box%side(side)%motion)) cycle
      associate (motion => box%side(side)%motion, end_time => box%side(side)%motion%final_time())
        if (.not. end_time < never .or. motion%final_velocity() < 0) cycle
        call bounds(box, end_time, low, high)
        if (product(high - low) > disks) cycle
        if (motion%stands()) then
          call groups(k)%complain("position", "leaves the disks less than their own area, "//written(disks), problems)
          cycle
        end if
        last = end_time - (disks/(high(3 - axis) - low(3 - axis)) - (high(axis) - low(axis)))/motion%final_velocity()
        call groups(k)%complain("end_time", "the side would crush the disks, which need at least their own area, "// &
          written(disks)//"; allowed: a time before "//written(last), problems)
      end associate
    end do
  end subroutine check_strokes

  !> Determines whether the disks of a species rotate. Reads the number and radii of the disks from
  !> an initial-configuration file, unless the input contains both. If the input contains both, an
  !> unreadable file is reported only when the disks are placed. A resumed run places no disks and
  !> does not need the file.
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
        s%count = size(radius) + s%waiting
        call group%put_text("count", written(s%count))
        if (s%radius_in_file) s%radius = maxval(radius)
        if (all(s%region([1, 3]) < s%region([2, 4]))) call group%put_reals("packing_fraction", &
          [pi*sum(radius**2)/product(s%region([2, 4]) - s%region([1, 3]))])
      end associate
    end associate
  end subroutine read_missing_values

  !> Determines the maximum of the random radii of the run, and the packing fraction of disks with
  !> these radii.
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

  !> Reports why the disks in an initial-configuration file cannot be used.
  subroutine report_file_problem(s, group, problems)
    type(species_settings_t), intent(in) :: s
    type(group_t), intent(in) :: group
    type(problem_list_t), intent(inout) :: problems

    call group%complain("file", s%in_file%error%message, problems)
    if (s%in_file%error%code == exit_files) problems%unreadable = problems%unreadable + 1
  end subroutine report_file_problem

  !> Checks that a disk of a species fits into its region, into each period of the box, and into
  !> every obstacle that encloses the disks.
  subroutine check_species(group, s, box, alone, problems)
    type(group_t), intent(in) :: group
    type(species_settings_t), intent(in) :: s
    type(box_state_t), intent(in) :: box                      !! box at the start
    !> .true. if this species consists of the only disk of the run.
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

    !> Checks one axis. The region must lie in the box and be wide enough for a disk. A period must
    !> exceed two diameters, so that a disk cannot touch two images of another disk simultaneously.
    subroutine check_axis()
      logical :: endless(2)
      real(real64) :: lower, upper, room, farthest, least, low(2), high(2)

      call bounds(box, 0.0_real64, low, high)
      sound = .false.
      endless = spans(s%region, box%box_t)
      lower = s%region(2*axis - 1)
      upper = s%region(2*axis)
      room = min(upper, high(axis)) - max(lower, low(axis))  ! width of the region between the displaced sides
      farthest = max(abs(box%lower(axis)), abs(box%upper(axis)))
      least = merge(2*s%radius, 4*s%radius + touching_tolerance*farthest, alone)
      if (lower >= upper) then
        call complain("region", "its lower end "//written(lower)//" is not below its upper end "//written(upper))
      else if (lower < min(box%lower(axis), low(axis)) .or. upper > max(box%upper(axis), high(axis))) then
        call complain("region", "it extends beyond the box, "//written(box%lower(axis))//" to "//written(box%upper(axis)))
      else if (.not. endless(axis) .and. 2*s%radius > room*(1 + touching_tolerance)) then
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

    !> Checks that the packing fraction does not exceed the packing fraction of the densest possible
    !> packing.
    subroutine check_fraction()
      real(real64) :: packing
      character(len=:), allocatable :: variable, filled, shortfall

      packing = (s%count - s%waiting)*pi*s%radius**2/product(s%region([2, 4]) - s%region([1, 3]))
      variable = "radius"
      if (group%given("packing_fraction")) variable = "packing_fraction"
      filled = "the disks would fill "//written(packing)//" of their region; "
      if (packing > closest_packing*(1 + touching_tolerance)) then
        call group%complain(variable, filled//"the closest packing is "//written(closest_packing), problems)
      else
        shortfall = s%placement%shortfall(packing)
        if (shortfall /= "") call group%complain(variable, filled//shortfall, problems)
      end if
    end subroutine check_fraction
  end subroutine check_species

end module input_fit
