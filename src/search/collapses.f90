!> Detects inelastic collapses, in which an unbounded number of collisions occurs in a finite time.
!> Counts simultaneous collisions, which occur at exactly the same time.
!>
!> A collision may be part of a collapse if the gap between the two disks was negligible even before
!> they approached each other. The simulation alone cannot decide this. Near a limit of collapse,
!> rounding errors of the positions, or of a common velocity, dominate the motion before time stops
!> advancing. The disks that almost touch are therefore copied to a cluster, whose collisions are
!> followed without such errors (see `clusters`). The decision depends only on the state at the
!> collision. It does not depend on the search, the number of threads or the pauses of the run.
module collapses
  use kinds, only: int32, int64, never, real64
  use box_geometry, only: tangential_surface_velocity, wall_normal
  use box_state, only: bounds
  use clusters, only: cluster_t, contact_t, most_disks
  use disks, only: disk_t, advance_disk
  use encounters, only: are_in_contact, relative_motion
  use partners, only: axis_of, n_sides, obstacle_code, sense_of
  use shapes, only: magnitude
  use simulation_state, only: simulation_t
  implicit none
  private
  public :: still, watch

  !> A collision is examined if the two disks have hardly moved relative to each other since the
  !> later of their previous events. The first number is the maximum relative displacement, and the
  !> second number is the maximum decrease of the gap. Both are in units of the sum of the radii.
  real(real64), parameter :: still = 2.0_real64**(-14), negligible = 2.0_real64**(-33)
  !> A decrease of a gap, or a sliding velocity, is larger than the rounding errors if it exceeds
  !> this number of spacings of the floating-point coordinates or velocities.
  real(real64), parameter :: resolved = 4.0_real64
  !> Maximum gap between neighbouring disks of a cluster, and maximum gap between a disk of the
  !> cluster and the colliding disks, in units of the sum of the radii.
  real(real64), parameter :: reach = 0.125_real64, farthest = 16.0_real64

contains

  !> Examines the collision of disks i and j at the time t, before the collision is executed.
  subroutine watch(sim, i, j, t, is_part)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    logical, intent(in) :: is_part      !! whether `sim` is a domain, which may lack disks of the cluster
    real(real64) :: s, dx(2), dv(2)
    logical :: is_resolved                           ! whether the decrease of the gap exceeds rounding errors

    associate (p => sim%disk(i), q => sim%disk(j))
      s = t - max(p%clock, q%clock)
      dv = q%v - p%v
      if (s*s*(dv(1)*dv(1) + dv(2)*dv(2)) > (still*(p%radius + q%radius))**2) return
    end associate
    if (are_in_contact(sim, i, j, t)) return
    call relative_motion(sim, i, j, t, dx, dv)
    if (-dot_product(dx, dv)*s > negligible*dot_product(dx, dx)) return
    if (is_part) then
      sim%tally%unexamined = sim%tally%unexamined + 1
      return
    end if
    if (.not. s > 0) call count_collision(sim, i, j, t)
    is_resolved = -dot_product(dx, dv)*s > resolved*spacing(maxval(abs([sim%disk(i)%x, sim%disk(j)%x])))*magnitude(dx)
    if (sim%tally%collapse < never) then
      ! Rounding errors of the positions can stop a collapse before its limit point.
      if (.not. is_resolved) sim%tally%collapse = min(sim%tally%collapse, sim%box%epoch + t)
      return
    end if
    associate (known => sim%series(sim%tag([i, j])%id)%known_until, events => sim%tag([i, j])%collisions)
      if (all(events < known)) return
      if (is_resolved .or. any(events > known)) then
        call judge(sim, i, j, t, is_resolved)
      else
        ! The series is longer than predicted, because rounding errors now determine the gaps.
        sim%series(sim%tag([i, j])%id)%known_until = events + 1
      end if
    end associate
  end subroutine watch

  !> Adds a collision to its series. A series consists of collisions at one and the same time that
  !> are connected by common disks. The first two collisions of a series are added together.
  subroutine count_collision(sim, i, j, t)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    integer(int32) :: first, second      ! in the order of ids, not of memory, for identical checkpoints

    if (.not. min(sim%disk(i)%clock, sim%disk(j)%clock) < t) sim%tally%simultaneous = sim%tally%simultaneous + 1
    first = merge(i, j, sim%tag(i)%id < sim%tag(j)%id)
    second = i + j - first
    call join(first)
    call join(second)
    call unite(sim%tag(first)%id, sim%tag(second)%id)
  contains

    !> Starts a series with disk k, unless the disk already belongs to a series at this time. If
    !> disk k has already collided at this time, the collision with its last partner is added.
    subroutine join(k)
      integer(int32), intent(in) :: k

      associate (tag => sim%tag(k))
        if (.not. sim%series(tag%id)%time < t) return
        call begin(tag%id)
        if (sim%disk(k)%clock < t .or. tag%last_partner <= 0) return
        if (sim%series(tag%last_partner)%time < t) call begin(tag%last_partner)
        call unite(tag%id, tag%last_partner)
      end associate
    end subroutine join

    !> Starts a series with a single disk.
    subroutine begin(id)
      integer(int32), intent(in) :: id

      associate (series => sim%series(id))
        series%time = t
        series%root = id
        series%disks = 1
        series%collisions = 0
      end associate
    end subroutine begin

    !> Merges the series of the disks with the ids a and b, and adds their collision.
    subroutine unite(a, b)
      integer(int32), intent(in) :: a, b
      integer(int32) :: root, other

      root = root_of(a)
      other = root_of(b)
      associate (into => sim%series(root), from => sim%series(other))
        if (root /= other) then
          into%disks = into%disks + from%disks
          into%collisions = into%collisions + from%collisions
          from%root = root
        end if
        into%collisions = into%collisions + 1
        call sim%tally%note_series(into%collisions, into%disks)
      end associate
    end subroutine unite

    !> Id of the disk that represents the series of a given disk.
    function root_of(id) result(root)
      integer(int32), intent(in) :: id
      integer(int32) :: root

      root = id
      do while (sim%series(root)%root /= root)
        sim%series(root)%root = sim%series(sim%series(root)%root)%root     ! shortens later look-ups
        root = sim%series(root)%root
      end do
    end function root_of
  end subroutine count_collision

  !> Decides whether the collisions of disks i and j and of the disks around them are a collapse. If
  !> the number of collisions is finite, the disks are examined again only after they have collided
  !> as often as predicted. If rounding errors determine the gaps, the number of collisions until
  !> the next examination doubles each time.
  subroutine judge(sim, i, j, t, is_resolved)
    type(simulation_t), intent(inout) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    logical, intent(in) :: is_resolved               !! as in `watch`
    type(cluster_t) :: cluster
    integer(int32) :: member(most_disks), k
    integer :: events(most_disks)
    real(real64) :: limit, duration
    logical :: endless

    call find_members(sim, i, j, t, member, cluster%n)
    call list_contacts(sim, t, member(:cluster%n), cluster)
    limit = sim%kick_time(sim%n_kicks + 1) - sim%box%epoch - t   ! a kick ends a series
    call cluster%follow(limit, endless, duration, events)
    if (endless) then
      sim%tally%collapse = sim%box%epoch + t + duration
      return
    end if
    do k = 1, cluster%n
      associate (tag => sim%tag(member(k)))
        associate (series => sim%series(tag%id))
          series%patience = merge(0_int64, 2*series%patience + 1, is_resolved)
          series%known_until = max(series%known_until, tag%collisions + max(int(events(k), int64), series%patience))
        end associate
      end associate
    end do
  end subroutine judge

  !> Lists the disks of the cluster around disks i and j, in the order of their ids. The cluster
  !> contains all disks connected with disk i by gaps of at most `reach`.
  subroutine find_members(sim, i, j, t, member, n)
    type(simulation_t), intent(in) :: sim
    integer(int32), intent(in) :: i, j
    real(real64), intent(in) :: t
    integer(int32), intent(out) :: member(most_disks), n
    integer(int32), allocatable :: near(:)           ! indices of the disks near disk i
    logical, allocatable :: found(:)
    integer(int32) :: k, m, first

    first = merge(i, j, sim%tag(i)%id < sim%tag(j)%id)
    near = pack([(k, k=1, sim%n_disks())], [(sim%is_inside(k) .and. gap(first, k) <= farthest, k=1, sim%n_disks())])
    allocate (found(size(near)))
    found = near == i .or. near == j
    member(:2) = [first, i + j - first]
    n = 2
    m = 0
    do while (m < n .and. n < most_disks)
      m = m + 1
      do k = 1, size(near, kind=int32)
        if (found(k) .or. n == most_disks) cycle
        if (gap(member(m), near(k)) > reach) cycle
        found(k) = .true.
        n = n + 1
        member(n) = near(k)
      end do
    end do
    do k = 2, n                                      ! insertion sort
      do m = k, 2, -1
        if (sim%tag(member(m))%id > sim%tag(member(m - 1))%id) exit
        member([m - 1, m]) = member([m, m - 1])
      end do
    end do
  contains

    !> Gap between two disks, divided by the sum of the radii of disks i and j.
    function gap(a, b)
      integer(int32), intent(in) :: a, b
      real(real64) :: gap, dx(2), dv(2)

      call relative_motion(sim, a, b, t, dx, dv)
      gap = (magnitude(dx) - sim%disk(a)%radius - sim%disk(b)%radius)/(sim%disk(i)%radius + sim%disk(j)%radius)
    end function gap
  end subroutine find_members

  !> Lists all contacts in a cluster, in the order in which simultaneous collisions are executed.
  subroutine list_contacts(sim, t, member, cluster)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: t
    integer(int32), intent(in) :: member(:)
    type(cluster_t), intent(inout) :: cluster
    integer(int32) :: a, b
    type(contact_t) :: contact

    allocate (cluster%contact(0))
    cluster%inertia = sim%law%inertia
    do a = 1, cluster%n
      cluster%mass(a) = sim%mass_of(member(a))
      cluster%contact = [cluster%contact, surface_contacts(sim, t, member(a), a)]
      do b = a + 1, cluster%n
        contact = contact_of(a, b)
        if (contact%gap <= 2*reach*(sim%disk(member(a))%radius + sim%disk(member(b))%radius)) &
          cluster%contact = [cluster%contact, contact]
      end do
    end do
  contains

    !> Contact between two disks of the cluster.
    function contact_of(a, b) result(contact)
      integer(int32), intent(in) :: a, b
      type(contact_t) :: contact
      real(real64) :: dx(2), dv(2), distance, sigma
      real(real64) :: noise                          ! rounding error of the sliding velocity [length/time]

      call relative_motion(sim, member(a), member(b), t, dx, dv)
      distance = magnitude(dx)
      sigma = sim%disk(member(a))%radius + sim%disk(member(b))%radius
      contact%first = a
      contact%second = b
      contact%normal = dx/distance
      contact%gap = max((dot_product(dx, dx) - sigma*sigma)/(distance + sigma), 0.0_real64)
      contact%closing = -dot_product(dv, contact%normal)
      contact%distance = distance
      contact%sliding = contact%normal(2)*dv(1) - contact%normal(1)*dv(2)
      associate (p => sim%disk(member(a)), q => sim%disk(member(b)))
        contact%slip = -contact%sliding - p%radius*sim%spin(member(a)) - q%radius*sim%spin(member(b))
        ! A row of disks may move as a whole or fall. Rounding errors of this common motion must not
        ! end the collapse of the row.
        noise = spacing(maxval(abs([p%v, q%v]))) + magnitude(dv)/distance*spacing(maxval(abs([p%x, q%x])))
        if (abs(contact%sliding) <= resolved*noise) contact%sliding = 0
      end associate
      contact%law = sim%law%between(sim%tag(member(a))%species, sim%tag(member(b))%species)
      contact%tangential = sim%law%tangential
    end function contact_of
  end subroutine list_contacts

  !> Contacts of disk i with sides and obstacles, where `number` is the index of the disk in the
  !> cluster. A curved surface is replaced by its tangent, and a thermal wall by an elastic one.
  function surface_contacts(sim, t, i, number) result(contacts)
    type(simulation_t), intent(in) :: sim
    real(real64), intent(in) :: t
    integer(int32), intent(in) :: i, number
    type(contact_t), allocatable :: contacts(:)
    type(disk_t) :: disk
    real(real64) :: d(2), normal(2), lower(2), upper(2), position   ! [length]
    integer(int32) :: side, k

    allocate (contacts(0))
    disk = sim%disk(i)
    call advance_disk(disk, sim%box%gravity, t)
    call bounds(sim%box, t, lower, upper)
    do k = 1, n_sides
      side = 1 - k
      if (sim%box%periodic(axis_of(side)) .or. sim%box%open(k)) cycle
      normal = -wall_normal(sim%box%box_t, side, disk%x, disk%v)
      position = merge(lower(axis_of(side)), upper(axis_of(side)), sense_of(side) < 0)
      call add(side, sense_of(side)*(position - disk%x(axis_of(side))) - disk%radius, normal, sim%box%side_velocity(k, t))
    end do
    do k = 1, sim%box%n_obstacles()
      associate (shape => sim%box%obstacle(k)%shape)
        d = shape%from_nearest(disk%x, sim%box%images(), heading=-disk%v)
        if (shape%gap(d, disk%radius) > reach*disk%radius) cycle
        call add(obstacle_code(k), shape%gap(d, disk%radius), -shape%normal(d, heading=-disk%v), 0.0_real64)
      end associate
    end do
  contains

    !> Adds a contact if its gap is small enough.
    subroutine add(code, gap, normal, velocity)
      integer(int32), intent(in) :: code             !! see `partners`
      real(real64), intent(in) :: gap, normal(2)     !! gap [length] and unit vector towards the surface
      real(real64), intent(in) :: velocity           !! velocity of the surface towards the disk [length/time]
      type(contact_t) :: contact

      if (gap > reach*disk%radius) return
      contact%first = number
      contact%normal = normal
      contact%gap = max(gap, 0.0_real64)
      contact%closing = dot_product(disk%v, normal) + velocity
      contact%sliding = dot_product(tangential_surface_velocity(sim%box%box_t, code, disk%x, -normal) - disk%v, &
        [normal(2), -normal(1)])
      contact%slip = -contact%sliding - disk%radius*sim%spin(i)
      associate (law => sim%box%surface(sim%box%surface_of(code))%law)
        if (.not. law%temperature > 0) contact%law = law%normal_law_t
        contact%tangential = law%tangential
      end associate
      contacts = [contacts, contact]
    end subroutine add
  end function surface_contacts

end module collapses
