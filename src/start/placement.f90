!> Finds a place for every disk.
!>
!> First come those that are fixed ('explicit', 'file', 'grid', 'lattice') in the order of the
!> input; then 'random', the species with the largest disks first; then 'dense' and 'grown', where species
!> with the same region grow together around the disks that are there already.
module placement
  use images, only: images_t
  use kinds, only: int32, int64, pi, real64
  use box_geometry, only: box_t
  use box_sides, only: bounds
  use collisions, only: wall_law_t
  use circles, only: new_circle
  use dense_growth, only: grow_disks, smallest_scale
  use disks, only: angle_column, disks_before, mass_column, species_t, spin_column
  use errors, only: error_t, exit_usage, fail
  use known_places, only: add_known, misfit_t, misfit_text
  use packing, only: packing_t
  use partners, only: n_sides
  use position_file, only: angle_row, column_names, mass_row, radius_row, spin_row
  use random_insertion, only: insert_at_random
  use random_stream, only: random_stream_t
  use regular_places, only: centre_range, grid_positions, lattice_positions, spans
  use settings, only: species_settings_t
  use simulation_state, only: simulation_t
  use starting_disks, only: origin, read_disks
  use status_line, only: status_line_t
  use texts, only: legible, written
  implicit none
  private
  public :: place_disks

  integer, parameter :: purpose = 1                         !! of this module's random streams
  integer(int32), parameter :: many_trials = 500000         !! disks placed in all trials of 'random'
  integer(int32), parameter :: few = 5                      !! disks, the same where there are few of them
  real(real64), parameter :: nearly = 1.25_real64           !! so many times more may fit at another trial
  real(real64), parameter :: denser = 1.5_real64            !! 'dense' packs so much more than 'random'

contains

  !> Gives the disks their positions and sizes; with them come the velocities that a file holds.
  subroutine place_disks(species, seed, line, sim, error)
    type(species_settings_t), intent(in) :: species(:)
    integer(int64), intent(in) :: seed
    class(status_line_t), intent(inout) :: line             !! shows how far it is
    type(simulation_t), intent(inout) :: sim                !! with its box, and disks in the order of the input
    type(error_t), allocatable, intent(out) :: error
    type(packing_t) :: packing
    logical, dimension(size(species)) :: random, dense, together
    integer :: s, k

    packing = packing_t(sim%box, size(sim%disk), size(species))
    random = [(species(k)%placement == "random", k=1, size(species))]
    dense = [(species(k)%placement == "dense" .or. species(k)%placement == "grown", k=1, size(species))]
    do s = 1, size(species)
      if (.not. (random(s) .or. dense(s))) call place_fixed(packing, species, s, sim, error)
      if (allocated(error)) return
    end do
    do while (any(random))
      s = maxloc(species%radius, dim=1, mask=random)
      call place_at_random(packing, species, s, seed, line, error)
      if (allocated(error)) return
      random(s) = .false.
    end do
    do s = 1, size(species)
      if (.not. dense(s)) cycle
      together = dense .and. [(all(species(k)%region <= species(s)%region .and. &
        species(k)%region >= species(s)%region .and. species(k)%placement == species(s)%placement), k=1, size(species))]
      call place_densely(packing, species, pack([(k, k=1, size(species))], together), seed, line, sim, error)
      if (allocated(error)) return
      dense = dense .and. .not. together
    end do
    do k = 1, size(sim%disk)
      sim%disk(k)%x = packing%disk(k)%x
      sim%disk(k)%radius = packing%disk(k)%radius
    end do
    if (sim%own_sizes) call sim%settle_masses()
  end subroutine place_disks

  !> Places a species whose positions are given, directly or by a rule.
  subroutine place_fixed(packing, species, s, sim, error)
    type(packing_t), intent(inout) :: packing
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s
    type(simulation_t), intent(inout) :: sim
    type(error_t), allocatable, intent(out) :: error
    real(real64), allocatable :: x(:, :), radius(:)
    integer, allocatable :: rows(:)

    allocate (rows(0))
    allocate (radius(species(s)%count), source=species(s)%radius)
    select case (species(s)%placement)
    case ("explicit")
      x = species(s)%position
    case ("grid")
      call grid_positions(species(s), x, error)
    case ("lattice")
      call lattice_positions(species(s), packing%box, x, error)
    case default                                            ! 'file'
      call take_disks(species, s, sim, x, radius, rows, error)
    end select
    if (.not. allocated(error)) call add_checked(packing, species, s, x, radius, rows, error)
  end subroutine place_fixed

  !> Reads the disks of a species from its file. Masses, orientations, and velocities if they are wanted, go into the
  !> simulation.
  subroutine take_disks(species, s, sim, x, radius, rows, error)
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s
    type(simulation_t), intent(inout) :: sim
    real(real64), allocatable, intent(out) :: x(:, :)       !! (2,count) [length]
    real(real64), allocatable, intent(out) :: radius(:)     !! (count) [length]
    integer, allocatable, intent(out) :: rows(:)            !! as in `origin`
    type(error_t), allocatable, intent(out) :: error
    real(real64), allocatable :: table(:, :)
    logical :: there(size(column_names))
    integer :: k

    call read_disks(species, s, sim%box, table, there, rows, error)
    if (allocated(error)) return
    x = table(1:2, :)
    radius = table(radius_row, :)
    do k = 1, size(rows)
      if (species(s)%velocities == "file") sim%disk(disks_before(species, s) + k)%v = table(3:4, k)
    end do
    if (sim%own_sizes) call take(mass_column, mass_row)
    if (species(s)%spin_in_file) call take(spin_column, spin_row)
    if (species(s)%angle_in_file) call take(angle_column, angle_row)
  contains
    !> Takes an optional column of the disks from a row of the table.
    subroutine take(column, row)
      integer, intent(in) :: column, row

      sim%extra(sim%extra_row(column), disks_before(species, s) + 1:disks_before(species, s) + size(rows)) = table(row, :)
    end subroutine take
  end subroutine take_disks

  !> Adds a species at known places, if they are free and in its region.
  subroutine add_checked(packing, species, s, x, radius, rows, error)
    type(packing_t), intent(inout) :: packing
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s
    real(real64), intent(in) :: x(:, :)                     !! (2,count) [length]
    real(real64), intent(in) :: radius(:)                   !! (count) [length]
    integer, intent(in) :: rows(:)                          !! as in `origin`
    type(error_t), allocatable, intent(out) :: error
    type(misfit_t), allocatable :: misfits(:)
    character(len=:), allocatable :: text
    integer :: k

    call add_known(packing, species, s, x, radius, misfits)
    if (size(misfits) == 0) return
    allocate (error)                                        ! not by `fail`: there is a line for each
    text = ""
    do k = 1, size(misfits)
      if (k > 1) text = text//new_line("a")
      text = text//legible(origin(species(s), rows, int(misfits(k)%disk), 1)//": "//misfit_text(packing, species, x, misfits(k)))
    end do
    error%message = text
    error%code = exit_usage
  end subroutine add_checked

  !> Places a species by random sequential insertion.
  subroutine place_at_random(packing, species, s, seed, line, error)
    type(packing_t), intent(inout) :: packing
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s
    integer(int64), intent(in) :: seed
    class(status_line_t), intent(inout) :: line
    type(error_t), allocatable, intent(out) :: error
    type(random_stream_t) :: stream
    real(real64) :: lower(2), upper(2), disk_packing
    character(len=:), allocatable :: advice
    integer(int32) :: placed, trial

    associate (me => species(s))
      call stream%seed(seed, [s, purpose])
      call centre_range(me%region, packing%box, me%radius, lower, upper)
      ! The fewer the disks, the more the number that fits varies from trial to trial.
      do trial = 1, max(1, many_trials/me%count)
        call packing%open_species(int(s, int32), me%radius, me%count, lower, upper)
        call insert_at_random(packing, int(s, int32), 1 + disks_before(species, s), stream, line, placed)
        if (placed == me%count) return
        if (placed == 0 .or. me%count > nearly*placed + few) exit    ! without room for one, no trial has any
      end do
      disk_packing = pi*me%radius**2/product(me%region([2, 4]) - me%region([1, 3]))
      advice = "use fewer or smaller disks"
      if (me%count < denser*placed) advice = "use placement = 'dense'"
      call fail(error, exit_usage, "species."//me%name//".placement: no more room after "// &
        written(placed)//" of "//written(me%count)//" random disks: reached "// &
        written(placed*disk_packing)//" of the wanted packing "//written(me%count*disk_packing)//"; "//advice)
    end associate
  end subroutine place_at_random

  !> Grows species that share a region, in a box of its shape; 'grown' ones from where a file has them.
  subroutine place_densely(packing, species, group, seed, line, sim, error)
    type(packing_t), intent(inout) :: packing
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: group(:)                         !! their numbers
    integer(int64), intent(in) :: seed
    class(status_line_t), intent(inout) :: line
    type(simulation_t), intent(inout) :: sim                !! gets masses and motion of a file
    type(error_t), allocatable, intent(out) :: error
    type(packing_t) :: small                                ! the same with the disks as they begin to grow
    type(species_t) :: member(size(group))
    type(random_stream_t) :: stream
    real(real64), allocatable :: x(:, :), radius(:), its_x(:, :), its_radius(:)
    integer, allocatable :: rows(:)
    integer :: k, first, last
    logical :: grown

    grown = species(group(1))%placement == "grown"
    if (grown) small = packing
    allocate (radius(sum(species(group)%count)))
    allocate (x(2, merge(size(radius), 0, grown)))
    last = 0
    do k = 1, size(group)
      associate (me => species(group(k)))
        first = last + 1
        last = last + me%count
        member(k) = me%species_t
        radius(first:last) = me%radius
        if (.not. grown) cycle
        call take_disks(species, group(k), sim, its_x, its_radius, rows, error)
        if (.not. allocated(error)) call add_checked(small, species, group(k), its_x, smallest_scale*its_radius, rows, error)
        if (allocated(error)) return
        x(:, first:last) = its_x
        radius(first:last) = its_radius
      end associate
    end do
    call stream%seed(seed, [group(1), purpose])
    call grow_disks(growth_box(packing, species(group(1))%region), member, radius, stream, line, x, error)
    last = 0
    do k = 1, size(group)
      if (allocated(error)) return
      first = last + 1
      last = last + species(group(k))%count
      call add_checked(packing, species, group(k), x(:, first:last), radius(first:last), [integer ::], error)
    end do
  end subroutine place_densely

  !> The region, as far as sides leave it, as a box, in which the disks that reach into it are obstacles, as are their images.
  function growth_box(packing, region) result(box)
    type(packing_t), intent(in) :: packing
    real(real64), intent(in) :: region(4)
    type(box_t) :: box
    real(real64) :: centre(2), radius
    type(images_t) :: images
    integer :: k, i, n, pass

    box = box_t()
    call bounds(packing%box, 0.0_real64, box%lower, box%upper)
    box%lower = max(region([1, 3]), box%lower)
    box%upper = min(region([2, 4]), box%upper)
    box%periodic = spans(region, packing%box)
    images = packing%box%images()
    do pass = 1, 2                                          ! count, then fill
      n = size(packing%box%surface)
      do k = 1, size(packing%disk)
        if (packing%disk(k)%species == 0) cycle
        radius = packing%disk(k)%radius
        do i = 1, images%count()
          centre = packing%disk(k)%x + images%shift(images%around(i))
          if (any(centre < box%lower - radius .or. centre > box%upper + radius)) cycle
          n = n + 1
          if (pass == 1) cycle
          box%surface(n)%name = "a disk"
          allocate (box%surface(n)%shape, source=new_circle(centre, radius, encloses=.false.))
        end do
      end do
      if (pass == 1) call box%add_obstacles(n - n_sides)
    end do
    do k = n_sides + 1, size(packing%box%surface)
      box%surface(k) = packing%box%surface(k)
      box%surface(k)%law = wall_law_t()                     ! elastic
    end do
  end function growth_box

end module placement
