!> Radii of the disks of a species: equal, or drawn from a distribution. The distribution is
!> truncated so that the maximum radius is ten times the minimum. A radius outside these limits is
!> drawn again. Polydispersities that would often require redrawing are not allowed.
module radii
  use kinds, only: int64, real64
  use random_stream, only: random_stream_t
  use settings, only: species_settings_t
  implicit none
  private
  public :: drawn_radii, largest_radius, widest_spread

  !> Key of the random streams of this module.
  integer, parameter :: purpose = 7
  !> Maximum deviation of a radius from the mean radius, relative to the mean.
  real(real64), parameter :: part = 9.0_real64/11
  !> Maximum deviation of ln(radius) from its mean.
  real(real64), parameter :: powers = 0.5_real64*log(10.0_real64)
  !> Minimum distance from the mean to the limits of the distribution, in standard deviations.
  real(real64), parameter :: deviations = 3

contains

  !> Draws the radius of each disk. For a lognormal distribution, ln(radius) has the variance ln(1 +
  !> polydispersity**2). The last bits of lognormal and Gaussian radii may depend on the
  !> mathematical library.
  pure function drawn_radii(species, s, seed) result(radius)
    class(species_settings_t), intent(in) :: species
    integer, intent(in) :: s                                !! index of the species
    integer(int64), intent(in) :: seed                      !! seed of the run
    real(real64) :: radius(species%count)                   !! [length]
    type(random_stream_t) :: stream
    real(real64) :: z(2), difference, deviation
    integer :: k

    radius = species%mean_radius
    if (.not. species%polydispersity > 0) return
    call stream%seed(seed, [s, purpose])
    deviation = species%polydispersity
    if (species%distribution == "lognormal") deviation = sqrt(log(1 + deviation**2))
    k = 1
    do while (k <= size(radius))
      call stream%draw_normals(z)
      difference = deviation*z(1)
      if (species%distribution == "uniform") then
        call stream%draw_uniform(z(1))
        difference = deviation*sqrt(3.0_real64)*(2*z(1) - 1)
      end if
      if (abs(difference) > merge(powers, part, species%distribution == "lognormal")) cycle
      radius(k) = species%mean_radius*(1 + difference)
      if (species%distribution == "lognormal") radius(k) = species%mean_radius*exp(difference - 0.5_real64*deviation**2)
      k = k + 1
    end do
  end function drawn_radii

  !> Estimates the maximum radius of a species without drawing the radii. Gaussian and lognormal
  !> radii are assumed to lie within five standard deviations of the distribution.
  pure function largest_radius(species) result(radius)
    class(species_settings_t), intent(in) :: species
    real(real64) :: radius                                  !! [length]
    real(real64) :: deviation

    associate (spread => species%polydispersity)
      radius = species%radius
      if (.not. spread > 0) return
      deviation = sqrt(log(1 + spread**2))
      select case (species%distribution)
      case ("uniform")
        radius = species%mean_radius*(1 + sqrt(3.0_real64)*spread)
      case ("lognormal")
        radius = species%mean_radius*exp(min(5*deviation, powers) - 0.5_real64*deviation**2)
      case default
        radius = species%mean_radius*(1 + min(5*spread, part))
      end select
    end associate
  end function largest_radius

  !> Maximum polydispersity allowed for a distribution.
  pure function widest_spread(distribution) result(spread)
    !> Distribution: 'uniform', 'gaussian' or 'lognormal'.
    character(len=*), intent(in) :: distribution
    real(real64) :: spread

    spread = part/merge(sqrt(3.0_real64), deviations, distribution == "uniform")
    if (distribution == "lognormal") spread = sqrt(exp((powers/deviations)**2) - 1)
  end function widest_spread

end module radii
