!> The version of the program, as `--version` and the output files name it.
module version
  implicit none
  private
  public :: program_version

  character(len=*), parameter :: program_version = "0.1.0"
end module version
