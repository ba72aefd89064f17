!> Finds a place for every disk.
!>
!> First come those that are fixed ('explicit', 'file', 'grid', 'lattice') in the order of the
!> input; then 'random', the species with the largest disks first; then 'dense' and 'grown', where species
!> with the same region grow together around the disks that are there already.
module placement
  use kinds, only: int32, int64, pi, real64
  use bounds, only: first_outside
  use box_geometry, only: box_t, obstacle_t
  use circles, only: new_circle
  use dense_growth, only: grow_disks
  use disks, only: disk_t, species_t
  use errors, only: error_t, exit_usage, fail
  use h5md_layout, only: position, value_of, velocity
  use known_places, only: add_known, misfit_t, misfit_text, offset
  use last_frame, only: is_run, read_last_frame
  use packing, only: packing_t
  use parameters, only: largest
  use position_file, only: read_positions
  use random_insertion, only: insert_at_random
  use random_stream, only: random_stream_t
  use regular_places, only: centre_range, grid_positions, lattice_positions, spans
  use settings, only: species_settings_t
  use status_line, only: status_line_t
  use texts, only: written
  implicit none
  private
  public :: place_disks

  integer, parameter :: purpose = 1                         !! of this module's random streams
  integer(int32), parameter :: many_trials = 500000         !! disks placed in all trials of 'random'
  integer(int32), parameter :: few = 5                      !! disks, the same where there are few of them
  real(real64), parameter :: nearly = 1.25_real64           !! so many times more may fit at another trial
  real(real64), parameter :: denser = 1.5_real64            !! 'dense' packs so much more than 'random'

contains

  !> Writes positions into the disks; with them come the velocities that a file holds.
  subroutine place_disks(species, box, seed, line, disk, error)
    type(species_settings_t), intent(in) :: species(:)
    type(box_t), intent(in) :: box
    integer(int64), intent(in) :: seed
    class(status_line_t), intent(inout) :: line             !! shows how far it is
    type(disk_t), intent(inout) :: disk(:)                  !! (n) in the order of the input
    type(error_t), allocatable, intent(out) :: error
    type(packing_t) :: packing
    logical, dimension(size(species)) :: random, dense, together
    integer :: s, k

    packing = packing_t(box, size(disk), size(species))
    random = [(species(k)%placement == "random", k=1, size(species))]
    dense = [(species(k)%placement == "dense" .or. species(k)%placement == "grown", k=1, size(species))]
    do s = 1, size(species)
      if (.not. (random(s) .or. dense(s))) call place_fixed(packing, species, s, disk, error)
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
      call place_densely(packing, species, pack([(k, k=1, size(species))], together), seed, line, disk, error)
      if (allocated(error)) return
      dense = dense .and. .not. together
    end do
    do k = 1, size(disk)
      disk(k)%x = packing%disk(k)%x
    end do
  end subroutine place_disks

  !> Places a species whose positions are given, directly or by a rule.
  subroutine place_fixed(packing, species, s, disk, error)
    type(packing_t), intent(inout) :: packing
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s
    type(disk_t), intent(inout) :: disk(:)
    type(error_t), allocatable, intent(out) :: error
    real(real64), allocatable :: x(:, :)
    integer, allocatable :: rows(:)

    allocate (rows(0))
    select case (species(s)%placement)
    case ("explicit")
      x = species(s)%position
    case ("grid")
      call grid_positions(species(s), x, error)
    case ("lattice")
      call lattice_positions(species(s), packing%box, x, error)
    case default                                            ! 'file'
      call read_disks(species(s), packing%box, x, rows, disk(offset(species, s) + 1:), error)
      if (allocated(error)) return
    end select
    if (.not. allocated(error)) call add_checked(packing, species, s, x, rows, error)
  end subroutine place_fixed

  !> Reads the disks of a species from its file. Velocities go into the disks if they are wanted.
  subroutine read_disks(species, box, x, rows, disk, error)
    type(species_settings_t), intent(in) :: species
    type(box_t), intent(in) :: box
    real(real64), allocatable, intent(out) :: x(:, :)       !! (2,count), or more rows [length]
    integer, allocatable, intent(out) :: rows(:)            !! as in `origin`
    type(disk_t), intent(inout) :: disk(:)                  !! (count), or more
    type(error_t), allocatable, intent(out) :: error
    integer :: k

    associate (s => species)
      allocate (x(merge(4, 2, s%velocities == "file"), s%count))
      if (.not. is_run(s%file) .and. s%scale_positions) then
        call fail(error, exit_usage, "species."//s%name//".scale_positions: "//s%file//" is not the file of a run " &
          //"(.h5), which says how large its box was")
      else if (.not. is_run(s%file)) then
        call read_positions(s%file, s%count, x, rows, error)
      else if (s%scale_positions) then
        call read_last_frame(s%file, s%name, s%count, x, rows, error, box)
      else
        call read_last_frame(s%file, s%name, s%count, x, rows, error)
      end if
      if (.not. allocated(error)) call check_numbers(s, x, rows, error)
      if (allocated(error)) return
      do k = 1, merge(s%count, 0, size(x, 1) == 4)
        disk(k)%v = x(3:4, k)
      end do
    end associate
  end subroutine read_disks

  !> Where the values of a disk come from, for messages: a line of a text file, a row of a dataset, or a rule.
  pure function origin(species, rows, k, column) result(text)
    type(species_settings_t), intent(in) :: species
    integer, intent(in) :: rows(:)                          !! of the disks in the file; none: there is no file
    integer, intent(in) :: k                                !! number of the disk in its species
    integer, intent(in) :: column                           !! of x, y, vx, vy
    character(len=:), allocatable :: text

    if (size(rows) == 0) then
      text = "species."//species%name//".placement"
    else if (is_run(species%file)) then
      text = position
      if (column > 2) text = velocity
      text = species%file//": "//text//value_of//": row "//written(rows(k))//" of the last frame"
    else
      text = species%file//":"//written(rows(k))
    end if
  end function origin

  !> Refuses numbers that no text could have brought: NaN, infinite, or larger than the input may have.
  subroutine check_numbers(species, x, rows, error)
    type(species_settings_t), intent(in) :: species
    real(real64), intent(in) :: x(:, :)                     !! (2,count), or more rows
    integer, intent(in) :: rows(:)                          !! as in `origin`
    type(error_t), allocatable, intent(out) :: error
    integer :: k, column

    do k = 1, size(x, 2)
      column = first_outside(x(:, k), [-largest, largest])
      if (column == 0) cycle
      call fail(error, exit_usage, origin(species, rows, k, column)//": "//written(x(column, k)) &
        //" is out of range (sizes up to 1e100)")
      return
    end do
  end subroutine check_numbers

  !> Refuses centres that are not in the region: disks that are to grow have no radius yet.
  subroutine check_region(species, packing, x, rows, error)
    type(species_settings_t), intent(in) :: species
    type(packing_t), intent(in) :: packing
    real(real64), intent(in) :: x(:, :)                     !! (2,count), or more rows [length]
    integer, intent(in) :: rows(:)                          !! as in `origin`
    type(error_t), allocatable, intent(out) :: error
    real(real64) :: lower(2), upper(2)
    integer :: k

    call centre_range(species%region, packing%box, 0.0_real64, lower, upper)
    do k = 1, size(x, 2)
      if (all(x(1:2, k) >= lower .and. x(1:2, k) <= upper)) cycle
      call fail(error, exit_usage, origin(species, rows, k, 1)//": disk "//written(k)//" at "//written(x(1, k))//", " &
        //written(x(2, k))//" is not in its region")
      return
    end do
  end subroutine check_region

  !> Adds a species at known places, if they are free and in its region.
  subroutine add_checked(packing, species, s, x, rows, error)
    type(packing_t), intent(inout) :: packing
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: s
    real(real64), intent(in) :: x(:, :)                     !! (2,count), or more rows [length]
    integer, intent(in) :: rows(:)                          !! as in `origin`
    type(error_t), allocatable, intent(out) :: error
    type(misfit_t), allocatable :: misfits(:)
    character(len=:), allocatable :: text
    integer :: k

    call add_known(packing, species, s, x, misfits)
    if (size(misfits) == 0) return
    text = ""
    do k = 1, size(misfits)
      if (k > 1) text = text//new_line("a")
      text = text//origin(species(s), rows, int(misfits(k)%disk), 1)//": "//misfit_text(packing, species, x, misfits(k))
    end do
    call fail(error, exit_usage, text)
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
        call insert_at_random(packing, int(s, int32), 1 + offset(species, s), stream, line, placed)
        if (placed == me%count) return
        if (me%count > nearly*placed + few) exit
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
  subroutine place_densely(packing, species, group, seed, line, disk, error)
    type(packing_t), intent(inout) :: packing
    type(species_settings_t), intent(in) :: species(:)
    integer, intent(in) :: group(:)                         !! their numbers
    integer(int64), intent(in) :: seed
    class(status_line_t), intent(inout) :: line
    type(disk_t), intent(inout) :: disk(:)                  !! gets the velocities of a file
    type(error_t), allocatable, intent(out) :: error
    type(random_stream_t) :: stream
    real(real64), allocatable :: x(:, :), from_file(:, :)
    integer, allocatable :: rows(:)
    type(species_t) :: member(size(group))
    integer :: k, first

    allocate (x(2, 0))
    do k = 1, size(group)
      member(k)%name = species(group(k))%name
      member(k)%count = species(group(k))%count
      member(k)%radius = species(group(k))%radius
      if (species(group(k))%placement /= "grown") cycle
      call read_disks(species(group(k)), packing%box, from_file, rows, disk(offset(species, group(k)) + 1:), error)
      if (.not. allocated(error)) call check_region(species(group(k)), packing, from_file, rows, error)
      if (allocated(error)) return
      x = reshape([x, from_file(1:2, :)], [2, size(x, 2) + size(from_file, 2)])
    end do
    call stream%seed(seed, [group(1), purpose])
    call grow_disks(growth_box(packing, species(group(1))%region), member, stream, line, x, error)
    first = 1
    do k = 1, size(group)
      if (allocated(error)) return
      associate (n => species(group(k))%count)
        call add_checked(packing, species, group(k), x(:, first:first + n - 1), [integer ::], error)
        first = first + n
      end associate
    end do
  end subroutine place_densely

  !> The region as a box, in which the disks that reach into it are obstacles, as are their images.
  pure function growth_box(packing, region) result(box)
    type(packing_t), intent(in) :: packing
    real(real64), intent(in) :: region(4)
    type(box_t) :: box
    type(obstacle_t), allocatable :: obstacle(:)
    real(real64) :: centre(2), radius
    integer :: k, i, j, n, pass, images(2)

    box%lower = region([1, 3])
    box%upper = region([2, 4])
    box%periodic = spans(region, packing%box)
    images = merge(1, 0, packing%box%periodic)
    do pass = 1, 2                                          ! count, then fill
      n = packing%box%n_obstacles()
      do k = 1, size(packing%disk)
        if (packing%disk(k)%species == 0) cycle
        radius = packing%layer(packing%disk(k)%species)%radius
        do j = -images(2), images(2)
          do i = -images(1), images(1)
            centre = packing%disk(k)%x + [i, j]*packing%box%edges()
            if (any(centre < box%lower - radius .or. centre > box%upper + radius)) cycle
            n = n + 1
            if (pass == 1) cycle
            obstacle(n)%name = "a disk"
            allocate (obstacle(n)%shape, source=new_circle(centre, radius, encloses=.false.))
          end do
        end do
      end do
      if (pass == 1) allocate (obstacle(n))
    end do
    do k = 1, packing%box%n_obstacles()
      obstacle(k) = packing%box%obstacle(k)
    end do
    call move_alloc(obstacle, box%obstacle)
  end function growth_box

end module placement
