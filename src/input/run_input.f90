!> What a run was asked for, in all its forms.
module run_input
  use parameter_values, only: parameter_group_t
  use settings, only: settings_t
  use texts, only: text_t
  implicit none
  private
  public :: run_input_t

  type :: run_input_t
    character(len=:), allocatable :: text                !! the input file as it is
    type(text_t), allocatable :: overrides(:)            !! GROUP.VARIABLE=VALUE of each --set
    type(parameter_group_t), allocatable :: groups(:)    !! every value as used
    type(settings_t) :: settings                         !! the same as typed data
  end type run_input_t

end module run_input
