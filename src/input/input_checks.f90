!> Whether the disks of the input fit: into regions, the box, between obstacles and each other.
module input_checks
  use kinds, only: pi, real64
  use input_problems, only: problem_list_t
  use parameter_values, only: parameter_group_t
  use settings, only: box_settings_t, obstacle_settings_t, settings_t, species_settings_t
  use texts, only: written
  implicit none
  private
  public :: check_geometry

  real(real64), parameter :: rounding = 1.0e-12_real64        !! relative, of touching disks
  real(real64), parameter :: resolution = 1.0e-10_real64      !! of a radius in its box, in double
  real(real64), parameter :: random_limit = 0.547_real64      !! random sequential addition jams
  real(real64), parameter :: closest_packing = 0.9068_real64  !! pi/sqrt(12), triangular lattice
  integer, parameter :: most_reports = 5                      !! of a kind, for one list of disks

  character(len=*), parameter :: axes = "xy"

contains

  !> Checks every species that is known well enough; the rest has its problems already.
  subroutine check_geometry(obstacle_groups, species_groups, settings, problems)
    type(parameter_group_t), intent(in) :: obstacle_groups(:), species_groups(:)
    type(settings_t), intent(in) :: settings
    type(problem_list_t), intent(inout) :: problems
    logical :: sound(size(species_groups))
    integer :: k

    if (any(settings%box%lower >= settings%box%upper)) return
    do k = 1, size(obstacle_groups)
      call check_obstacle(obstacle_groups(k), settings%obstacles(k), settings%box, problems)
    end do
    do k = 1, size(species_groups)
      associate (s => settings%species(k), before => problems%count)
        sound(k) = .false.
        if (s%radius <= 0 .or. s%count < 1 .or. species_groups(k)%faulty("region")) cycle
        sound(k) = .true.
        call check_region(species_groups(k), s, settings%box, problems, sound(k))
        if (.not. sound(k)) cycle
        call check_fraction(species_groups(k), s, problems)
        call check_containers(species_groups(k), s, settings%obstacles, problems)
        sound(k) = s%placement == "explicit" .and. size(s%position, 2) == s%count
        if (sound(k)) call check_positions(species_groups(k), s, settings, problems)
      end associate
    end do
    call check_overlaps(species_groups, settings, sound, problems)
  end subroutine check_geometry

  subroutine check_obstacle(group, obstacle, box, problems)
    type(parameter_group_t), intent(in) :: group
    type(obstacle_settings_t), intent(in) :: obstacle
    type(box_settings_t), intent(in) :: box
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: nearest(2)
    integer :: axis

    if (obstacle%radius <= 0) return
    nearest = min(max(obstacle%centre, box%lower), box%upper)
    if (norm2(nearest - obstacle%centre) >= obstacle%radius) &
      call problems%add(group%line_of("centre"), "obstacle.centre", "the obstacle is outside the box")
    do axis = 1, 2
      if (.not. box%periodic(axis)) cycle
      if (2*obstacle%radius > box%upper(axis) - box%lower(axis)) &
        call problems%add(group%line_of("radius"), "obstacle.radius", "the obstacle is wider than &
        &the box along the periodic axis "//axes(axis:axis))
    end do
  end subroutine check_obstacle

  !> The region must lie in the box and hold a disk; a period must hold two.
  subroutine check_region(group, s, box, problems, sound)
    type(parameter_group_t), intent(in) :: group
    type(species_settings_t), intent(in) :: s
    type(box_settings_t), intent(in) :: box
    type(problem_list_t), intent(inout) :: problems
    logical, intent(out) :: sound
    real(real64) :: lower, upper
    integer :: axis

    sound = .false.
    do axis = 1, 2
      lower = s%region(2*axis - 1)
      upper = s%region(2*axis)
      if (lower >= upper) then
        call complain("region", "its lower end "//written(lower)//" is not below its upper end "//written(upper))
      else if (lower < box%lower(axis) .or. upper > box%upper(axis)) then
        call complain("region", "it reaches beyond the box, "//written(box%lower(axis))//" to "// &
          written(box%upper(axis)))
      else if (.not. spans(s%region, box, axis) .and. 2*s%radius > (upper - lower)*(1 + rounding)) then
        call complain("radius", "a disk of diameter "//written(2*s%radius)// &
          " does not fit into its region of width "//written(upper - lower))
      else if (box%periodic(axis) .and. 4*s%radius > box%upper(axis) - box%lower(axis)) then
        call complain("radius", "a periodic box must be at least two diameters wide: "// &
          written(4*s%radius)//" > "//written(box%upper(axis) - box%lower(axis)))
      else if (s%radius < resolution*max(abs(box%lower(axis)), abs(box%upper(axis)))) then
        call complain("radius", written(s%radius)//" is too small to be resolved at coordinates "// &
          "of "//written(max(abs(box%lower(axis)), abs(box%upper(axis)))))
      else
        cycle
      end if
      return
    end do
    sound = .true.
  contains
    subroutine complain(variable, what)
      character(len=*), intent(in) :: variable, what

      call problems%add(group%line_of(variable), "species."//variable, what//", along "//axes(axis:axis))
    end subroutine complain
  end subroutine check_region

  !> A periodic axis that the region spans has no ends to keep away from.
  pure function spans(region, box, axis)
    real(real64), intent(in) :: region(4)
    type(box_settings_t), intent(in) :: box
    integer, intent(in) :: axis
    logical :: spans

    spans = box%periodic(axis) .and. region(2*axis - 1) <= box%lower(axis) .and. region(2*axis) >= box%upper(axis)
  end function spans

  !> No placement can exceed its densest packing.
  subroutine check_fraction(group, s, problems)
    type(parameter_group_t), intent(in) :: group
    type(species_settings_t), intent(in) :: s
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: packing
    character(len=:), allocatable :: variable

    packing = s%count*pi*s%radius**2/((s%region(2) - s%region(1))*(s%region(4) - s%region(3)))
    variable = "radius"
    if (group%given("packing_fraction")) variable = "packing_fraction"
    if (packing > closest_packing) then
      call problems%add(group%line_of(variable), "species."//variable, "the disks would fill "// &
        written(packing)//" of their region; the closest packing is "//written(closest_packing))
    else if (packing > random_limit .and. s%placement == "random") then
      call problems%add(group%line_of(variable), "species."//variable, "the disks would fill "// &
        written(packing)//" of their region; random placement ends at "//written(random_limit)// &
        ", placement = 'dense' goes on")
    end if
  end subroutine check_fraction

  subroutine check_containers(group, s, obstacles, problems)
    type(parameter_group_t), intent(in) :: group
    type(species_settings_t), intent(in) :: s
    type(obstacle_settings_t), intent(in) :: obstacles(:)
    type(problem_list_t), intent(inout) :: problems
    integer :: k

    do k = 1, size(obstacles)
      if (.not. obstacles(k)%inside .or. obstacles(k)%radius <= 0) cycle
      if (s%radius < obstacles(k)%radius) cycle
      call problems%add(group%line_of("radius"), "species.radius", "a disk of radius "// &
        written(s%radius)//" does not fit into obstacle """//obstacles(k)%name//'"')
    end do
  end subroutine check_containers

  !> Explicit disks lie in their region and on the right side of all obstacles.
  subroutine check_positions(group, s, settings, problems)
    type(parameter_group_t), intent(in) :: group
    type(species_settings_t), intent(in) :: s
    type(settings_t), intent(in) :: settings
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: inset(2), gap
    integer :: i, k, reports

    inset = [(merge(0.0_real64, s%radius*(1 - rounding), spans(s%region, settings%box, k)), k=1, 2)]
    reports = 0
    do i = 1, s%count
      if (reports == most_reports) return
      if (any(s%position(:, i) < s%region([1, 3]) + inset .or. &
        s%position(:, i) > s%region([2, 4]) - inset)) call complain("is not wholly in its region")
      do k = 1, size(settings%obstacles)
        associate (obstacle => settings%obstacles(k))
          gap = distance(s%position(:, i), obstacle%centre, settings%box) - obstacle%radius
          if (obstacle%inside) gap = -gap
          if (gap >= s%radius*(1 - rounding) .or. obstacle%radius <= 0) cycle
          call complain(trim(merge("is not wholly inside", "overlaps            ", &
            obstacle%inside))//" obstacle """//obstacle%name//'"')
        end associate
      end do
    end do
  contains
    subroutine complain(what)
      character(len=*), intent(in) :: what

      reports = reports + 1
      call problems%add(group%line_of("position"), "species.position", "disk "//written(i)// &
        " at "//written(s%position(1, i))//", "//written(s%position(2, i))//" "//what)
    end subroutine complain
  end subroutine check_positions

  !> Explicit disks must not overlap each other. Cells as wide as the largest disk keep it fast.
  subroutine check_overlaps(groups, settings, explicit, problems)
    type(parameter_group_t), intent(in) :: groups(:)
    type(settings_t), intent(in) :: settings
    logical, intent(in) :: explicit(:)                   !! species with sound explicit positions
    type(problem_list_t), intent(inout) :: problems
    integer, allocatable :: owner(:), number(:), next(:), head(:, :), cell(:, :)
    integer :: m(2), i, j, k, n, a, b, reports

    n = sum(settings%species%count, mask=explicit)
    if (n < 2) return
    owner = [((k, i=1, merge(settings%species(k)%count, 0, explicit(k))), k=1, size(explicit))]
    number = [((i, i=1, merge(settings%species(k)%count, 0, explicit(k))), k=1, size(explicit))]
    associate (box => settings%box, species => settings%species)
      m = int(min((box%upper - box%lower)/(2*maxval(species%radius, mask=explicit)), sqrt(real(n, real64)) + 1))
      m = max(m, 1)
      allocate (head(0:m(1) - 1, 0:m(2) - 1), source=0)
      allocate (next(n), cell(2, n))
      reports = 0
      do i = 1, n
        associate (x => species(owner(i))%position(:, number(i)))
          cell(:, i) = int(max(0.0_real64, min(1.0_real64, (x - box%lower)/(box%upper - box%lower)))*m)
        end associate
        cell(:, i) = min(cell(:, i), m - 1)
        do b = -1, 1
          do a = -1, 1
            j = head(modulo(cell(1, i) + a, m(1)), modulo(cell(2, i) + b, m(2)))
            do while (j > 0)
              if (reports < most_reports .and. overlap(i, j)) call report(j, i)
              j = next(j)
            end do
          end do
        end do
        if (reports == most_reports) return
        next(i) = head(cell(1, i), cell(2, i))
        head(cell(1, i), cell(2, i)) = i
      end do
    end associate
  contains
    pure function overlap(i, j)
      integer, intent(in) :: i, j
      logical :: overlap

      associate (a => settings%species(owner(i)), b => settings%species(owner(j)))
        overlap = distance(a%position(:, number(i)), b%position(:, number(j)), settings%box) &
          < (a%radius + b%radius)*(1 - rounding)
      end associate
    end function overlap

    subroutine report(i, j)
      integer, intent(in) :: i, j

      reports = reports + 1
      call problems%add(groups(owner(j))%line_of("position"), "species.position", "disk "// &
        written(number(i))//" of """//settings%species(owner(i))%name//""" and disk "// &
        written(number(j))//" of """//settings%species(owner(j))%name//""" overlap")
    end subroutine report
  end subroutine check_overlaps

  !> Between two points, or the nearest image on periodic axes.
  pure function distance(a, b, box)
    real(real64), intent(in) :: a(2), b(2)
    type(box_settings_t), intent(in) :: box
    real(real64) :: distance
    real(real64) :: d(2), length(2)

    length = box%upper - box%lower
    d = a - b
    where (box%periodic) d = d - length*anint(d/length)
    distance = norm2(d)
  end function distance

end module input_checks
