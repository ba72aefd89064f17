!> Placement in equilibrium. The disks of all species are placed together, by compression or on a
!> lattice, and are then equilibrated by event chains (see `event_chains`).
module relaxed_placement
  use box_geometry, only: box_t
  use dense_placement, only: dense_placement_t, growth_box
  use event_chains, only: relax, shuffle
  use fields, only: fields_t
  use kinds, only: int64, pi, real64
  use lattice_placement, only: find_lattice
  use packing, only: packing_t
  use placement, only: batch_t
  use status_line, only: status_line_t
  use variable_rows, only: choice_t, number_of_sweeps, variable_t
  implicit none
  private
  public :: relaxed_placement_t, choices, rows, sweeps, word

  character(len=*), parameter :: word = "relaxed", sweeps = "relaxation_sweeps"
  type(choice_t), parameter :: choices(*) = [ &
    choice_t("placement", word, "Dense equilibrium state: a lattice, or a packing as with 'dense', equilibrated by " &
      //"event-chain Monte Carlo with swaps of disks of different radii. All species must use this placement. The box must " &
      //"have no obstacles, no moving sides and no gravity. The option --check skips this placement.")]
  type(variable_t), parameter :: rows(*) = [ &
    variable_t("species", sweeps, "integer", 1, "fallback", "1000", &
      "Number of sweeps of event-chain Monte Carlo that equilibrate the initial state with placement = 'relaxed'. A sweep of " &
      //"the N disks of the run consists of N event chains, each of which moves about sqrt(N) disks. The value applies to all " &
      //"species and may be given in the group of any of them.", &
      number_of_sweeps, goes_with="placement "//word)]

  !> Packing fraction of freezing, above which the fluid is unstable (Engel et al., 2013,
  !> doi:10.1103/PhysRevE.87.042134). Denser disks of equal radii start on a lattice if it fits into
  !> the box. A compressed fluid would become a polycrystal, which event chains equilibrate only
  !> slowly.
  real(real64), parameter :: freezing = 0.70_real64

  type, extends(dense_placement_t) :: relaxed_placement_t
    integer(int64) :: sweeps = 0
  contains
    procedure :: read => read_sweeps
    procedure :: moves_all_disks
    procedure :: conflict
    procedure :: place
  end type relaxed_placement_t

contains

  !> Reads the number of sweeps.
  subroutine read_sweeps(self, fields)
    class(relaxed_placement_t), intent(inout) :: self
    class(fields_t), intent(inout) :: fields

    call fields%read(sweeps, self%sweeps)
  end subroutine read_sweeps

  !> See `placement`.
  pure function moves_all_disks(self) result(yes)
    class(relaxed_placement_t), intent(in) :: self
    logical :: yes

    yes = .true.
  end function moves_all_disks

  !> See `placement`. Event chains require a box without obstacles and moving sides. Event chains
  !> sample the uniform distribution of positions. Only without gravity, this is the equilibrium
  !> distribution.
  pure function conflict(self, variable) result(reason)
    class(relaxed_placement_t), intent(in) :: self
    character(len=*), intent(in) :: variable
    character(len=:), allocatable :: reason

    select case (variable)
    case ("obstacle", "wall")
      reason = "&"//variable
    case ("side.motion")
      reason = "sides that move (side.motion) or are displaced (side.position)"
    case ("box.gravity")
      reason = "box.gravity: in equilibrium the density would depend on the height"
    case default
      reason = ""
    end select
    if (reason /= "") reason = "'"//word//"' cannot be combined with "//reason
  end function conflict

  !> Compresses the disks or places them on a lattice, and equilibrates them.
  subroutine place(self, batch, packing, line, fields)
    class(relaxed_placement_t), intent(in) :: self
    type(batch_t), intent(inout) :: batch
    type(packing_t), intent(inout) :: packing
    class(status_line_t), intent(inout) :: line
    class(fields_t), intent(inout) :: fields
    type(box_t) :: box

    call place_on_lattice(batch, packing)
    if (size(batch%x, 2) == 0) call self%dense_placement_t%place(batch, packing, line, fields)
    if (size(batch%x, 2) == 0) return          ! reported by `dense_placement`
    box = growth_box(packing, batch%region)
    call relax(box, batch%radius, batch%seed, self%sweeps, line, batch%x)
  end subroutine place

  !> Places the disks on a lattice in random order. The disks must have equal radii and a packing
  !> fraction above freezing, and the lattice must fit into the box. Otherwise no positions are
  !> returned.
  subroutine place_on_lattice(batch, packing)
    type(batch_t), intent(inout) :: batch
    type(packing_t), intent(in) :: packing
    real(real64), allocatable :: x(:, :)
    character(len=:), allocatable :: misfit

    associate (radius => batch%radius)
      if (minval(radius) < maxval(radius) .or. pi*sum(radius**2) < freezing*product(packing%box%edges())) return
      call find_lattice(batch%region, packing%box, size(radius), radius(1), x, misfit)
    end associate
    if (misfit /= "") return
    call shuffle(batch%seed, x)
    call move_alloc(x, batch%x)
  end subroutine place_on_lattice

end module relaxed_placement
