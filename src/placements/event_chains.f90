!> Equilibration of a dense packing by event-chain Monte Carlo (Bernard, Krauth and Wilson, 2009,
!> doi:10.1103/PhysRevE.80.056704). In an event chain, a disk moves along an axis until it touches a
!> second disk. The second disk then moves in the same direction until it touches a third disk, and
!> so on. The chain ends when the sum of all displacements equals its length. Chains along x and
!> along y alternate.
!>
!> Along a periodic axis, all chains move to the right or upwards. The state of a chain consists of
!> the positions of all disks and the index of the moving disk. Each state has exactly one
!> predecessor, and the motion preserves the volume in the space of states. Therefore the uniform
!> distribution of all packings is stationary (global balance), although no chain moves backwards.
!> Two conditions are required for this. The first disk of each chain is drawn uniformly from all
!> disks, and the length of the chain is independent of the positions.
!>
!> Along an axis with walls, a disk that reaches a side reverses its direction and continues
!> (straight event chains in a box with walls, Li et al., 2022, doi:10.1063/5.0126437). The state of
!> a chain then includes the direction. Each state still has exactly one predecessor, because a disk
!> that touches a side and moves away from it must have been reflected just before. The initial
!> direction is drawn at random, because the uniform distribution is stationary only if both
!> directions are equally probable. A chain between two sides, reversed at its end, leads back to
!> its start. Such chains therefore also satisfy detailed balance.
!>
!> If the radii differ, a swap is attempted after each chain (Grigera and Parisi, 2001,
!> doi:10.1103/PhysRevE.63.045102). Two disks, drawn uniformly from all disks, exchange their
!> positions unless the larger one would overlap another disk or a side. Swaps satisfy detailed
!> balance, because the two disks are drawn independently of the positions.
module event_chains
  use kinds, only: int32, int64, pi, real64
  use box_geometry, only: box_t
  use box_state, only: box_state_t
  use packing, only: packing_t
  use random_stream, only: random_stream_t
  use status_line, only: status_line_t
  use texts, only: written
  implicit none
  private
  public :: relax, shuffle

  !> Packing fraction of the triangular lattice.
  real(real64), parameter :: closest_packing = pi/sqrt(12.0_real64)
  integer, parameter :: stream_number = 8         !! key of the random streams of this module
  integer, parameter :: chains_per_look = 1024    !! number of chains between two updates of the status line
  !> Minimum fraction of the length of a chain that `usual_steps` successive moves must cover. A
  !> chain that covers less is jammed and ends.
  real(real64), parameter :: jammed = 1.0e-3_real64

contains

  !> Equilibrates a packing of disks that do not overlap. The random numbers of a sweep depend only
  !> on the seed of the run and the number of the sweep.
  subroutine relax(box, radius, seed, sweeps, line, x)
    type(box_t), intent(in) :: box                !! box without obstacles; gravity and shear are ignored
    real(real64), intent(in) :: radius(:)         !! shape (n) [length]
    integer(int64), intent(in) :: seed            !! seed of the run
    integer(int64), intent(in) :: sweeps          !! number of sweeps of n chains each
    class(status_line_t), intent(inout) :: line   !! status line for the progress
    real(real64), intent(inout) :: x(:, :)        !! positions; shape (2, n) [length]
    type(packing_t) :: packing
    type(random_stream_t) :: stream
    real(real64) :: mean_length(2), u
    integer(int64) :: sweep
    integer(int32) :: n, k, first, other
    integer(int64) :: swapped(2)                  ! numbers of attempted and accepted swaps
    integer :: axis, sense, usual_steps
    logical :: swaps

    n = size(x, 2, kind=int32)
    call fill(packing, box, radius, x)
    usual_steps = ceiling(sqrt(real(n, real64))) + 10
    mean_length = min(sqrt(real(n, real64))*mean_step(box, radius), 0.5_real64*box%edges())
    swaps = minval(radius) < maxval(radius)
    swapped = 0
    do sweep = 1, sweeps
      call stream%seed(seed, [0, stream_number, int(ibits(sweep, 0, 31)), int(ibits(sweep, 31, 31))])
      do k = 1, n
        axis = 1 + modulo(k, 2)
        call stream%draw_index(n, first)
        sense = 1
        if (.not. box%periodic(axis)) then
          call stream%draw_uniform(u)
          if (u < 0.5_real64) sense = -1
        end if
        call stream%draw_uniform(u)
        call move_chain(packing, first, axis, sense, 2*u*mean_length(axis), usual_steps)
        if (swaps) then
          call stream%draw_index(n, first)
          call stream%draw_index(n, other)
          call try_swap(packing, first, other, swapped)
        end if
        if (modulo(k, chains_per_look) == 0 .or. k == n) call line%show_share("relaxing the packing", &
          (sweep - 1 + real(k, real64)/n)/sweeps)
      end do
    end do
    do k = 1, n
      x(:, k) = packing%disk(k)%x
    end do
    call line%tell(report(sweeps, swapped))
  end subroutine relax

  !> Report about the equilibration. The fraction of accepted swaps shows how well disks of
  !> different radii are mixed.
  pure function report(sweeps, swapped) result(text)
    integer(int64), intent(in) :: sweeps, swapped(2)
    character(len=:), allocatable :: text

    text = "the packing was relaxed: "//written(sweeps)//" sweeps"
    if (swapped(1) > 0) text = text//", "//written(swapped(2))//" of "//written(swapped(1))//" swaps of different radii accepted"
  end function report

  !> Adds the disks to a packing with layers. Within a layer, the radii differ by less than a factor
  !> of two.
  subroutine fill(packing, box, radius, x)
    type(packing_t), intent(out) :: packing
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: radius(:), x(:, :)
    integer(int32) :: layer(size(radius)), k
    real(real64) :: limit

    layer = 1
    limit = 0.5_real64*maxval(radius)
    do while (any(radius <= limit))
      where (radius <= limit) layer = layer + 1
      limit = 0.5_real64*limit
    end do
    packing = packing_t(box_state_t(box), size(radius), int(maxval(layer)))
    do k = 1, maxval(layer)
      if (any(layer == k)) call packing%open_species(k, maxval(radius, mask=layer == k), count(layer == k), box%lower, box%upper)
    end do
    do k = 1, size(radius, kind=int32)
      call packing%add(k, layer(k), x(:, k), radius(k))
    end do
  end subroutine fill

  !> Estimates the mean displacement of a disk in a chain. In equilibrium, this displacement is pi/4
  !> diameters divided by Z - 1 (Michel, Kapfer and Krauth, 2014, doi:10.1063/1.4863991). Here pi/4
  !> diameters is the mean distance between successive disks of a chain along its direction, and Z
  !> is the compressibility factor. Z - 1 is estimated from scaled particle theory and from the free
  !> volume of a crystal, and the larger estimate is used.
  pure function mean_step(box, radius) result(step)
    type(box_t), intent(in) :: box
    real(real64), intent(in) :: radius(:)
    real(real64) :: step                          !! [length]
    real(real64) :: packing, excess

    packing = min(pi*sum(radius**2)/product(box%edges()), closest_packing*(1 - 1.0e-6_real64))
    excess = max(packing*(2 - packing)/(1 - packing)**2, 2*packing/(closest_packing - packing))
    step = pi/4*2*sum(radius)/size(radius)/excess
  end function mean_step

  !> Moves the disks of one chain.
  pure subroutine move_chain(packing, first, axis, first_sense, length, usual_steps)
    type(packing_t), intent(inout) :: packing
    integer(int32), intent(in) :: first           !! first disk of the chain
    integer, intent(in) :: axis                   !! 1 for x, 2 for y
    !> 1 to start to the right or upwards, -1 to start in the opposite direction.
    integer, intent(in) :: first_sense
    real(real64), intent(in) :: length            !! sum of all displacements [length]
    !> Number of moves between two tests for jamming. Without these tests a chain would never end at
    !> closest packing, where no disk can move.
    integer, intent(in) :: usual_steps
    real(real64) :: left, left_before, distance   ! [length]
    integer(int32) :: k, partner
    integer :: sense, step, bounces               ! bounces: number of successive reflections of the same disk

    k = first
    sense = first_sense
    left = length
    left_before = left
    bounces = 0
    step = 0
    do
      distance = left
      if (.not. packing%box%periodic(axis)) distance = min(left, room(packing, k, axis, sense))
      call packing%find_contact(k, axis, sense, distance, partner)
      call packing%shift(k, axis, sense*distance)
      left = left - distance
      if (.not. left > 0) return
      if (partner > 0) then
        k = partner
        bounces = 0
      else
        sense = -sense
        bounces = bounces + 1
        ! A disk that moves back and forth between two sides without touching another disk repeats
        ! its motion. Whole periods of this motion are skipped.
        if (bounces == 2) left = modulo(left, max(2*room(packing, k, axis, sense), tiny(left)))
      end if
      step = step + 1
      if (modulo(step, usual_steps) > 0) cycle
      if (left_before - left < jammed*length) return
      left_before = left
    end do
  end subroutine move_chain

  !> Distance by which disk k can move along a walled axis before it touches a side.
  pure function room(packing, k, axis, sense) result(distance)
    type(packing_t), intent(in) :: packing
    integer(int32), intent(in) :: k
    integer, intent(in) :: axis, sense
    real(real64) :: distance                      !! [length]

    associate (me => packing%disk(k), box => packing%box)
      if (sense > 0) then
        distance = box%upper(axis) - me%radius - me%x(axis)
      else
        distance = me%x(axis) - me%radius - box%lower(axis)
      end if
      ! a rounding error may have moved the disk slightly beyond the side
      distance = max(distance, 0.0_real64)
    end associate
  end function room

  !> Exchanges the positions of two disks of different radii, unless the larger one would then
  !> overlap another disk or a side. The smaller one always fits at the position of the larger one.
  pure subroutine try_swap(packing, i, j, swapped)
    type(packing_t), intent(inout) :: packing
    integer(int32), intent(in) :: i, j
    integer(int64), intent(inout) :: swapped(2)   !! numbers of attempted and accepted swaps
    real(real64) :: place(2, 2)                   ! positions of the smaller and of the larger disk [length]
    integer(int32) :: small, large, blocker

    if (.not. abs(packing%disk(i)%radius - packing%disk(j)%radius) > 0) return
    swapped(1) = swapped(1) + 1
    small = i
    large = j
    if (packing%disk(i)%radius > packing%disk(j)%radius) then
      small = j
      large = i
    end if
    associate (disk => packing%disk, box => packing%box)
      place(:, 1) = disk(small)%x
      place(:, 2) = disk(large)%x
      if (any(.not. box%periodic .and. (place(:, 1) < box%lower + disk(large)%radius &
        .or. place(:, 1) > box%upper - disk(large)%radius))) return
      call packing%remove(small)
      call packing%remove(large)
      call packing%find_blocker(place(:, 1), [0.0_real64, 0.0_real64], disk(large)%radius, blocker)
      if (blocker == 0) then
        place = place(:, [2, 1])
        swapped(2) = swapped(2) + 1
      end if
      call packing%add(small, disk(small)%species, place(:, 1), disk(small)%radius)
      call packing%add(large, disk(large)%species, place(:, 2), disk(large)%radius)
    end associate
  end subroutine try_swap

  !> Permutes the positions at random, to mix disks of different species.
  subroutine shuffle(seed, x)
    integer(int64), intent(in) :: seed            !! seed of the run
    real(real64), intent(inout) :: x(:, :)        !! shape (2, n) [length]
    type(random_stream_t) :: stream
    integer(int32) :: k, other

    call stream%seed(seed, [0, stream_number])
    do k = size(x, 2, kind=int32), 2, -1
      call stream%draw_index(k, other)
      x(:, [k, other]) = x(:, [other, k])
    end do
  end subroutine shuffle

end module event_chains
