!> Disks at places that are known before: whether each of them fits.
module known_places
  use disks, only: disks_before
  use input_groups, only: group_t
  use input_problems, only: problem_list_t
  use kinds, only: int32, real64
  use packing, only: packing_t
  use regular_places, only: centre_range
  use settings, only: species_settings_t
  use starting_disks, only: origin
  use texts, only: written
  implicit none
  private
  public :: add_known

  integer, parameter :: most_reports = 5                    !! of a kind, for one species
  real(real64), parameter, public :: rounding = 1.0e-12_real64      !! relative, of disks that touch

contains

  !> Adds a species at known places. Disks that overlap others, and those that are not wholly in their region, are problems.
  subroutine add_known(packing, species, s, x, radius, group, problems)
    type(packing_t), intent(inout) :: packing
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s
    real(real64), intent(in) :: x(:, :)                     !! (2,count) [length]
    real(real64), intent(in) :: radius(:)                   !! (count) [length]
    type(group_t), intent(in) :: group                      !! of the species
    type(problem_list_t), intent(inout) :: problems
    real(real64) :: lower(2), upper(2), slack, largest
    integer(int32) :: k, blocker, before
    integer :: outside, overlapping                         ! disks
    character(len=:), allocatable :: taken

    outside = 0
    overlapping = 0
    taken = ""
    if (any(packing%box%surface%motion%travels())) taken = ", less what a side that moves takes of it at the start"
    largest = maxval(species%radius)
    before = disks_before(species, s)
    call centre_range(species(s)%region, packing%box, 0.0_real64, lower, upper)
    call packing%open_species(int(s, int32), maxval(radius), size(radius), &
      min(max(minval(x, dim=2), lower), upper), max(min(maxval(x, dim=2), upper), lower))
    do k = 1, species(s)%count
      if (min(outside, overlapping) == most_reports) return
      slack = rounding*(radius(k) + largest)
      call centre_range(species(s)%region, packing%box, radius(k), lower, upper)
      if (any(x(:, k) < lower - slack .or. x(:, k) > upper + slack)) then
        call report(outside, "is not wholly in its region"//taken)
        cycle
      end if
      call packing%find_blocker(x(:, k), [0.0_real64, 0.0_real64], radius(k) - slack, blocker)
      call packing%add(before + k, int(s, int32), x(:, k), radius(k))
      if (blocker > 0) then
        associate (other => packing%disk(blocker)%species)
          call report(overlapping, "overlaps disk "//written(blocker - disks_before(species, other))//" of """ &
            //species(other)%name//'"')
        end associate
      else if (blocker < 0) then
        associate (obstacle => packing%box%surface(1 - blocker))
          call report(overlapping, trim(merge("is not wholly inside", "overlaps            ", obstacle%shape%encloses)) &
            //" obstacle """//obstacle%name//'"')
        end associate
      end if
    end do

  contains

    !> Reports disk k.
    subroutine report(count, what)
      integer, intent(inout) :: count                       !! of such reports
      character(len=*), intent(in) :: what

      character(len=:), allocatable :: variable, from

      if (count == most_reports) return
      count = count + 1
      variable = "placement"
      from = ""
      if (species(s)%placement == "explicit") variable = "position"
      if (species(s)%file /= "") variable = "file"
      if (species(s)%file /= "") from = origin(species(s), int(k), 1)//": "
      call group%complain(variable, from//"disk "//written(k)//" at "//written(x(1, k))//", "//written(x(2, k))//" "//what, &
        problems)
    end subroutine report
  end subroutine add_known

end module known_places
