!> The file that was probably meant where there is none of the name given.
module similar_files
  use system, only: folder_of, list_folder
  use texts, only: nearest_word
  implicit none
  private
  public :: similar_file

contains

  !> In the folder named, or else among the inputs that come with the program; empty if nothing is similar.
  function similar_file(path, ending) result(similar)
    character(len=*), intent(in) :: path
    character(len=*), intent(in) :: ending           !! of the files that can be meant, such as .nml
    character(len=:), allocatable :: similar, name
    integer :: cut

    cut = index(path, "/", back=.true.)
    name = path(cut + 1:)
    if (ends_with(name, ending)) name = name(:len(name) - len(ending))
    similar = similar_in(path(:cut), name, ending)
    if (similar == "") similar = similar_in("input/", name, ending)
  end function similar_file

  function similar_in(folder, name, ending) result(similar)
    character(len=*), intent(in) :: folder           !! with its slash; '' for the current one
    character(len=*), intent(in) :: name             !! without its ending
    character(len=*), intent(in) :: ending
    character(len=:), allocatable :: similar
    character(len=256), allocatable :: names(:)

    call list_folder(folder_of(folder), names)
    similar = nearest_word(name, stem(pack(names, ends_with(names, ending)), ending))
    if (similar /= "") similar = folder//similar//ending
  end function similar_in

  elemental function stem(name, ending)
    character(len=256), intent(in) :: name
    character(len=*), intent(in) :: ending
    character(len=256) :: stem

    stem = name(:len_trim(name) - len(ending))
  end function stem

  elemental function ends_with(name, ending) result(yes)
    character(len=*), intent(in) :: name, ending
    logical :: yes

    yes = len_trim(name) > len(ending) .and. index(name, ending, back=.true.) == len_trim(name) - len(ending) + 1
  end function ends_with

end module similar_files
