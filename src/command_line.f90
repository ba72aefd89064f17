!> Reads the command line and prints the information requested by options such as --help. File names
!> may have any length.
module command_line
  use, intrinsic :: iso_fortran_env, only: compiler_version
  use build_info, only: build_flags, git_commit
  use errors, only: error_t, exit_usage, fail
  use hdf5_handle, only: hdf5_version
  use run_files, only: check_name
  use system, only: print_text
  use texts, only: did_you_mean, eol, nearest_word, shown, text_t
  use version, only: program_version
  use variable_help, only: defaults_text, explain, variables_text
  implicit none
  private
  public :: command_t, read_command_line, parse_arguments, answer, help_text

  type :: command_t
    !> Information to be printed: help, version, print-defaults, print-variables or explain; empty
    !> for a run.
    character(len=:), allocatable :: question
    character(len=:), allocatable :: topic         !! topic of --explain: a variable or a word
    character(len=:), allocatable :: input         !! path of the input file
    character(len=:), allocatable :: output        !! path of the output file
    type(text_t), allocatable :: overrides(:)      !! GROUP.VARIABLE=VALUE for each --set
    logical :: resume = .false.
    logical :: check = .false.                     !! .true. to validate the input only
    logical :: print_input = .false.               !! .true. to print the input as JSON only
    logical :: quiet = .false.
    logical :: force = .false.                     !! .true. to replace a finished or unfinished output
  end type command_t

  !> Parser of the command line.
  type :: parser_t
    type(text_t), allocatable :: arguments(:)
    integer :: k = 0                               !! index of the argument being read
    type(command_t) :: command
    type(error_t), allocatable :: error
  contains
    procedure :: take_all
    procedure :: take_option
    procedure :: take_value
    procedure :: expect_assignment
    procedure :: report_unknown
    procedure :: refuse
  end type parser_t

  character(len=17), parameter :: switches(*) = [character(len=17) :: "--resume", "--check", "--quiet", "--force", &
    "--help", "--version", "--print-defaults", "--print-variables", "--print-input"]
  character(len=17), parameter :: options(*) = [character(len=17) :: "--output", "--set", "--explain", switches]

contains

  !> Reads the command-line arguments of the program.
  subroutine read_command_line(command, error)
    type(command_t), intent(out) :: command
    type(error_t), allocatable, intent(out) :: error
    type(text_t) :: arguments(command_argument_count())
    integer :: k, length

    do k = 1, size(arguments)
      call get_command_argument(k, length=length)
      allocate (character(len=length) :: arguments(k)%text)
      call get_command_argument(k, arguments(k)%text)
    end do
    call parse_arguments(arguments, command, error)
  end subroutine read_command_line

  !> Converts the arguments to a command, or reports the first invalid argument.
  subroutine parse_arguments(arguments, command, error)
    type(text_t), intent(in) :: arguments(:)
    type(command_t), intent(out) :: command
    type(error_t), allocatable, intent(out) :: error
    type(parser_t) :: parser

    parser%arguments = arguments
    parser%command%question = ""
    parser%command%input = ""
    parser%command%output = ""
    allocate (parser%command%overrides(0))
    call parser%take_all()
    command = parser%command
    call move_alloc(parser%error, error)
    if (allocated(error) .or. command%question /= "") return
    if (command%input == "") then
      call fail(error, exit_usage, "no input file is given; usage: ricochet INPUT.nml, see --help")
    else if (command%resume .and. command%force) then
      call fail(error, exit_usage, "--resume continues a run, --force starts it again; give only one of them")
    end if
    if (command%output == "") command%output = default_output(command%input)
    if (.not. allocated(error)) call check_name(command%output, error)
  end subroutine parse_arguments

  !> Reads the arguments until an error occurs or an option such as --help requests information.
  subroutine take_all(self)
    class(parser_t), intent(inout) :: self
    character(len=:), allocatable :: argument
    logical :: only_files

    only_files = .false.
    do while (self%k < size(self%arguments) .and. self%command%question == "")
      self%k = self%k + 1
      argument = self%arguments(self%k)%text
      if (.not. only_files .and. argument == "--") then
        only_files = .true.
      else if (.not. only_files .and. index(argument, "-") == 1) then
        call self%take_option(argument(:merge(index(argument//"=", "=") - 1, len(argument), index(argument, "--") == 1)))
      else if (self%command%input == "" .and. argument /= "") then
        self%command%input = argument
      else if (argument == "") then
        call self%refuse("the name of the input file is empty")
      else
        call self%refuse("only one input file is allowed; there is also "//shown(argument))
      end if
      if (allocated(self%error)) return
    end do
  end subroutine take_all

  !> Reports an error in the command line, unless an error was already reported.
  subroutine refuse(self, why)
    class(parser_t), intent(inout) :: self
    character(len=*), intent(in) :: why

    if (.not. allocated(self%error)) call fail(self%error, exit_usage, why)
  end subroutine refuse

  !> Reads the option in argument k, and its value if that is argument k+1.
  subroutine take_option(self, name)
    class(parser_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    type(text_t) :: value

    if (name /= self%arguments(self%k)%text .and. any(switches == name)) then
      call self%refuse("option "//name//" takes no value")
      return
    end if
    select case (name)
    case ("-o", "--output")
      call self%take_value(name, value%text)
      self%command%output = value%text
    case ("--set")
      call self%take_value(name, value%text)
      call self%expect_assignment(value%text)
      ! with gfortran 12 a constructor `text_t(...)` would leak memory
      self%command%overrides = [self%command%overrides, value]
    case ("--explain")
      self%command%question = "explain"
      call self%take_value(name, value%text)
      self%command%topic = value%text
    case ("-h", "--help")
      self%command%question = "help"
    case ("--version", "--print-defaults", "--print-variables")
      self%command%question = name(3:)
    case ("--resume")
      self%command%resume = .true.
    case ("--check")
      self%command%check = .true.
    case ("--print-input")
      self%command%print_input = .true.
    case ("--quiet")
      self%command%quiet = .true.
    case ("--force")
      self%command%force = .true.
    case default
      call self%report_unknown(name)
    end select
  end subroutine take_option

  !> Reads the value of an option: the text after `=` or, without `=`, the next argument.
  subroutine take_value(self, name, value)
    class(parser_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable, intent(out) :: value

    value = self%arguments(self%k)%text(min(len(name) + 2, len(self%arguments(self%k)%text) + 1):)
    if (name == self%arguments(self%k)%text .and. self%k < size(self%arguments)) then
      self%k = self%k + 1
      value = self%arguments(self%k)%text
    end if
    if (value == "") call self%refuse("option "//name//" needs a value")
  end subroutine take_value

  !> Reports an error for `--set NAME VALUE` (without `=`), where VALUE would be mistaken for a file
  !> name.
  subroutine expect_assignment(self, text)
    class(parser_t), intent(inout) :: self
    character(len=*), intent(in) :: text

    if (index(text, "=") > 0 .or. self%k == size(self%arguments)) return
    associate (next => self%arguments(self%k + 1)%text)
      if (index(next, "-") /= 1 .and. index(next//"|", ".nml|") == 0) &
        call self%refuse("--set "//text//": = is missing; "//did_you_mean("--set "//text//"="//next))
    end associate
  end subroutine expect_assignment

  !> Reports an unknown option. The message suggests the known option or the file name that the user
  !> may have meant.
  subroutine report_unknown(self, name)
    class(parser_t), intent(inout) :: self
    character(len=*), intent(in) :: name
    character(len=:), allocatable :: meant

    meant = nearest_word(name, options)
    if (meant == "" .and. index(name, "--") /= 1) meant = nearest_word("-"//name, options)
    if (meant /= "") meant = did_you_mean(meant)
    if (meant == "") meant = "see --help; put -- before a file name that begins with -"
    call self%refuse("unknown option "//shown(name)//"; "//meant)
  end subroutine report_unknown

  !> Default path of the output: runs/NAME.h5 for the input file NAME.nml.
  pure function default_output(input) result(output)
    character(len=*), intent(in) :: input
    character(len=:), allocatable :: output

    output = input(index(input, "/", back=.true.) + 1:)
    if (len(output) > 4) then
      if (output(len(output) - 3:) == ".nml") output = output(:len(output) - 4)
    end if
    output = "runs/"//output//".h5"
  end function default_output

  !> Prints the requested information.
  subroutine answer(command, error)
    type(command_t), intent(in) :: command
    type(error_t), allocatable, intent(out) :: error
    character(len=:), allocatable :: text

    select case (command%question)
    case ("help")
      text = help_text()
    case ("version")
      text = version_text()
    case ("print-defaults")
      text = defaults_text()
      text = text(:len(text) - 1)
    case ("print-variables")
      text = variables_text()
    case default
      call explain(command%topic, text, error)
      if (allocated(error)) return
    end select
    call print_text(text, error)
  end subroutine answer

  !> Output of `--version`, with all data required in a bug report.
  function version_text() result(text)
    character(len=:), allocatable :: text

    text = "ricochet "//program_version//eol//"commit:   "//git_commit//eol// &
      "compiler: "//compiler_version()//eol//"flags:    "//build_flags//eol//"HDF5:     "//hdf5_version()//eol// &
      "threads:  "//trim(merge("set by run.threads", "one, no OpenMP    ", index(build_flags, "-fopenmp") > 0))
  end function version_text

  !> Output of `--help`, which fits on one screen.
  pure function help_text() result(text)
    character(len=:), allocatable :: text

    text = "ricochet: event-driven simulation of hard disks"//eol//eol// &
      "usage:  ricochet INPUT.nml [option]..."//eol// &
      "        ricochet --help | --version | --print-defaults | --explain WORD"//eol//eol// &
      "  -o, --output FILE   where the results go; default runs/<input name>.h5"//eol// &
      "  --set NAME=VALUE    override a variable of the input, any number of times:"//eol// &
      "                      run.seed=7, species.gas.mass=50, 'box.gravity(2)=-5';"//eol// &
      "                      the last one for a variable counts, an empty VALUE"//eol// &
      "                      restores the default"//eol// &
      "  --resume            continue a stopped run, or a finished one to a later end"//eol// &
      "  --check             read and check everything, run nothing"//eol// &
      "  --force             start again: replace FILE.part and, at the end, FILE"//eol// &
      "  --quiet             no progress, notes or warnings on stderr"//eol// &
      "  --print-defaults    an input file with every variable and its default"//eol// &
      "  --print-variables   all about every variable, as JSON for other programs"//eol// &
      "  --print-input       what the input and --set give, as JSON; run nothing"//eol// &
      "  --explain WORD      all about a variable or group, or the variables about it"//eol// &
      "  --version           version, commit, compiler, flags and HDF5 version"//eol// &
      "  --                  the next argument is a file name, even with a leading -"//eol//eol// &
      "exit:   0 finished; 2 wrong usage or bad input; 3 cannot read or write a file;"//eol// &
      "        4 the simulation broke off; 75 stopped after writing a checkpoint,"//eol// &
      "        the same command with --resume continues it; or before it began"//eol//eol// &
      "examples:"//eol// &
      "  ricochet input/gas.nml"//eol// &
      "  ricochet input/crater.nml -o runs/heavy.h5 --set species.projectile.mass=50"//eol// &
      "  ricochet input/cooling.nml --set contact.restitution=0.8 --check"//eol// &
      "  ricochet --explain restitution"
  end function help_text

end module command_line
