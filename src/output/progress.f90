!> How far the output of a run has come.
module progress
  use kinds, only: int64, real64
  use cadence, only: cadence_t
  use settings, only: settings_t
  implicit none
  private
  public :: progress_t

  !> With the state, all that is needed to go on.
  type :: progress_t
    type(cadence_t) :: frames, observables
    integer(int64) :: events = 0                  !! collisions written to the event log
  contains
    procedure :: counts
  end type progress_t

  interface progress_t
    module procedure new_progress
  end interface progress_t

contains

  !> The progress of a run that has written nothing yet.
  pure function new_progress(settings) result(progress)
    type(settings_t), intent(in) :: settings
    type(progress_t) :: progress

    associate (s => settings%output, pairs => 0.5_real64*settings%n_disks())
      progress%frames = cadence_t(s%frames_every_time, s%frames_every_collisions, s%frames_every_events, &
        pairs*s%frames_every_collisions_per_disk)
      progress%observables = cadence_t(s%observables_every_time, s%observables_every_collisions, &
        s%observables_every_events, pairs*s%observables_every_collisions_per_disk)
    end associate
  end function new_progress

  !> Number of samples of frames, observables and events.
  pure function counts(self)
    class(progress_t), intent(in) :: self
    integer(int64) :: counts(3)

    counts = [self%frames%count, self%observables%count, self%events]
  end function counts

end module progress
