!> Typical speeds of the disks, and the units of the sums over collisions, which depend on these
!> speeds.
submodule(simulation_state) typical_speeds
  implicit none

  !> Factors in the bound for the terms of an exact sum, which determines the unit of the sum (see
  !> `exact_sums: choose_unit`). The bound is `common` times a typical term of the heaviest disks or
  !> `rare` times a typical term of the lightest disks, whichever is smaller.
  real(real64), parameter :: common = 2.0_real64**7, rare = 2.0_real64**22
  !> Reduction of the units of the exact sums in driven simulations. The work of walls and kicks may
  !> be far smaller than estimated from their parameters. With the smaller units, such work is still
  !> resolved.
  real(real64), parameter :: finer = 2.0_real64**(-30)

contains

  !> Records the initial energy and chooses the units of the sums, if this has not been done by an
  !> earlier call.
  pure module subroutine start_sums(self)
    class(simulation_t), intent(inout) :: self

    if (self%tally%sum(1)%per_one > 0 .or. self%n_disks() == 0) return
    self%start_energy = self%kinetic_energy()
    self%reference_energy = self%start_energy
    self%typical_speed2 = self%mean_square_speed()
    call self%choose_units()
  end subroutine start_sums

  !> Root mean square speed of the fastest species after kicks or at sources; 0 without kicks and
  !> sources.
  pure module function fastest_drive(self) result(speed)
    class(simulation_t), intent(in) :: self
    real(real64) :: speed                         !! [length/time]

    speed = sqrt(max(maxval([0.0_real64, kick_speed2(self)]), source_speed2(self)))
  end function fastest_drive

  !> Mean square of the velocities set or added by a kick, for the disks of each species. For
  !> species without driving, the result is 0.
  pure function kick_speed2(self) result(speed2)
    class(simulation_t), intent(in) :: self
    real(real64) :: speed2(size(self%species))    !! [(length/time)**2]
    integer :: s

    speed2 = 0
    if (.not. allocated(self%drive)) return
    do s = 1, size(speed2)
      if (self%drive%acts_on(s)) speed2(s) = self%drive%speed2(self%species(s)%mass)
    end do
  end function kick_speed2

  !> Mean square velocity of the disks entering through the fastest source; 0 without sources.
  pure function source_speed2(self) result(speed2)
    class(simulation_t), intent(in) :: self
    real(real64) :: speed2                        !! [(length/time)**2]
    integer :: k

    speed2 = 0
    if (.not. allocated(self%source)) return
    do k = 1, size(self%source)
      speed2 = max(speed2, self%source(k)%speed2(self%species(self%source(k)%species)%mass))
    end do
  end function source_speed2

  !> Mean square speed at the present time, including the surface speed of rotating disks.
  pure module function mean_square_speed(self) result(speed2)
    class(simulation_t), intent(in) :: self
    real(real64) :: speed2                        !! [(length/time)**2]
    integer(int32) :: i

    speed2 = 0
    do i = 1, self%n_disks()
      if (.not. self%is_inside(i)) cycle
      speed2 = speed2 + (sum(self%velocity(i)**2) + (self%spin(i)*self%disk(i)%radius)**2)/self%n_inside()
    end do
  end function mean_square_speed

  !> Chooses the units of the sums from the sizes of typical terms. The sizes are estimated from the
  !> mean square speed of the disks and from the effects of gravity, walls and kicks. If the masses
  !> differ widely, terms of the lightest disks still have 40 binary digits each. Terms of the
  !> heaviest disks may exceed the bound of `exact_sum_t`; adding such rare terms takes slightly
  !> longer.
  pure module subroutine choose_units(self)
    class(simulation_t), intent(inout) :: self
    real(real64) :: mass(size(self%disk))         ! [mass]
    real(real64) :: speed2, light, heavy, small, large, length

    mass = self%masses()
    light = minval(mass)
    heavy = maxval(mass)
    small = 2*minval(self%disk%radius)
    large = 2*maxval(self%disk%radius)
    length = maxval(self%box%edges())
    speed2 = self%typical_speed2 + sum(abs(self%box%gravity)*self%box%edges()) + self%box%highest_temperature()/light &
      + self%box%highest_speed()**2 + max(maxval(kick_speed2(self)), source_speed2(self))
    call self%tally%make_room(size(self%box%surface))
    call self%tally%choose_units(merge(finer, 1.0_real64, self%is_driven())*[ &
      min(common*heavy, rare*light)*speed2, &
      min(common*heavy, rare*light)*sqrt(speed2), &
      min(common*heavy*large, rare*light*small)*sqrt(speed2), &
      min(common*heavy*length, rare*light*small)*speed2, &
      min(common*heavy*length, rare*light*small)*sqrt(speed2)])
  end subroutine choose_units

end submodule typical_speeds
