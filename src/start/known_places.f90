!> Disks at places that are known before: whether each of them fits.
module known_places
  use disks, only: disks_before
  use kinds, only: int32, real64
  use packing, only: packing_t
  use regular_places, only: centre_range
  use settings, only: species_settings_t
  use texts, only: written
  implicit none
  private
  public :: add_known, misfit_t, misfit_text

  integer, parameter :: most_reports = 5                    !! of a kind, for one species
  real(real64), parameter, public :: rounding = 1.0e-12_real64      !! relative, of disks that touch

  !> A disk that does not fit.
  type :: misfit_t
    integer(int32) :: disk                                  !! its number in its species
    integer(int32) :: blocker                               !! as in `packing%find_blocker`; 0: its region ends
  end type misfit_t

contains

  !> Adds a species at known places. Disks that overlap others are added all the same and listed, as are
  !> those, not added, that are not wholly in their region.
  subroutine add_known(packing, species, s, x, radius, misfits)
    type(packing_t), intent(inout) :: packing
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s
    real(real64), intent(in) :: x(:, :)                     !! (2,count) [length]
    real(real64), intent(in) :: radius(:)                   !! (count) [length]
    type(misfit_t), allocatable, intent(out) :: misfits(:)
    real(real64) :: lower(2), upper(2), slack, largest
    integer(int32) :: k, blocker, before
    logical :: outside

    allocate (misfits(0))
    largest = maxval(species%radius)
    before = disks_before(species, s)
    call centre_range(species(s)%region, packing%box, 0.0_real64, lower, upper)
    call packing%open_species(int(s, int32), maxval(radius), size(radius), &
      min(max(minval(x, dim=2), lower), upper), max(min(maxval(x, dim=2), upper), lower))
    do k = 1, species(s)%count
      slack = rounding*(radius(k) + largest)
      call centre_range(species(s)%region, packing%box, radius(k), lower, upper)
      blocker = 0
      outside = any(x(:, k) < lower - slack .or. x(:, k) > upper + slack)
      if (.not. outside) then
        call packing%find_blocker(x(:, k), [0.0_real64, 0.0_real64], radius(k) - slack, blocker)
        call packing%add(before + k, int(s, int32), x(:, k), radius(k))
      end if
      if (.not. outside .and. blocker == 0) cycle
      if (count((misfits%blocker > 0) .eqv. (blocker > 0)) == most_reports) cycle
      misfits = [misfits, misfit_t(k, blocker)]
      if (size(misfits) == 2*most_reports) return
    end do
  end subroutine add_known

  !> What is wrong with a disk.
  pure function misfit_text(packing, species, x, misfit) result(text)
    type(packing_t), intent(in) :: packing
    type(species_settings_t), intent(in) :: species(:)
    real(real64), intent(in) :: x(:, :)                     !! of its species [length]
    type(misfit_t), intent(in) :: misfit
    character(len=:), allocatable :: text
    integer :: other

    text = "disk "//written(misfit%disk)//" at "//written(x(1, misfit%disk))//", "//written(x(2, misfit%disk))
    if (misfit%blocker == 0) then
      text = text//" is not wholly in its region"
      if (packing%box%has_moving_sides()) text = text//", less what a side that moves takes of it at the start"
    else if (misfit%blocker < 0) then
      associate (obstacle => packing%box%surface(1 - misfit%blocker))
        text = text//trim(merge(" is not wholly inside", " overlaps            ", obstacle%shape%encloses))// &
          " obstacle """//obstacle%name//'"'
      end associate
    else
      other = packing%disk(misfit%blocker)%species
      text = text//" overlaps disk "//written(misfit%blocker - disks_before(species, other))// &
        " of """//species(other)%name//'"'
    end if
  end function misfit_text

end module known_places
