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

    progress%frames%every = intervals(settings%output%frames_every)
    progress%observables%every = intervals(settings%output%observables_every)
  contains

    !> Of time, of collisions in all or per disk, and of events.
    pure function intervals(every)
      real(real64), intent(in) :: every(:)        !! see `settings: sampled_by`
      real(real64) :: intervals(3)

      intervals = [every(1), min(every(2), 0.5_real64*settings%n_disks()*every(4)), every(3)]
    end function intervals
  end function new_progress

  !> Number of samples of frames, observables and events.
  pure function counts(self)
    class(progress_t), intent(in) :: self
    integer(int64) :: counts(3)

    counts = [self%frames%count, self%observables%count, self%events]
  end function counts

end module progress
