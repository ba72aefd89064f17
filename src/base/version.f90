!> The version of the program, for `--version` and output files.
module version
  implicit none
  private
  public :: program_version

  character(len=*), parameter :: program_version = "0.3.0"
end module version
