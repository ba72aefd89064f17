!> Words that users look up although no variable has this name, and the variables that they probably
!> mean.
module looked_up_words
  use texts, only: lower_case
  implicit none
  private
  public :: looked_up, looked_up_word_t, meant_variables, word_length

  !> Largest length of a word, and of a full name of a variable
  integer, parameter :: word_length = 24
  integer, parameter :: most_meant = 4                !! largest number of variables of a word

  type :: looked_up_word_t
    character(len=word_length) :: word
    character(len=word_length) :: meant(most_meant)   !! full names of variables; blank beyond the last one
  end type looked_up_word_t

  type(looked_up_word_t), parameter :: looked_up(*) = [ &
    looked_up_word_t("heat", [character(len=word_length) :: "side.temperature", "obstacle.temperature", "wall.temperature", &
      "drive.temperature"]), &
    looked_up_word_t("thermostat", [character(len=word_length) :: "drive.kind", "side.temperature", "", ""]), &
    looked_up_word_t("wall", [character(len=word_length) :: "box.boundary", "side.name", "contact.wall_restitution", &
      "contact.wall_rule"]), &
    looked_up_word_t("walls", [character(len=word_length) :: "box.boundary", "side.name", "wall.name", ""]), &
    looked_up_word_t("wall_temperature", [character(len=word_length) :: "side.temperature", "wall.temperature", &
      "obstacle.temperature", ""])]

contains

  !> Full names of the variables that a user means by a word; of size 0 if `looked_up` does not
  !> contain the word.
  pure function meant_variables(word) result(names)
    character(len=*), intent(in) :: word
    character(len=word_length), allocatable :: names(:)
    integer :: k

    allocate (names(0))
    do k = 1, size(looked_up)
      if (looked_up(k)%word == lower_case(word)) names = pack(looked_up(k)%meant, looked_up(k)%meant /= "")
    end do
  end function meant_variables

end module looked_up_words
