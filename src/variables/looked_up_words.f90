!> Words that users look up although no variable has this name, and the variables that they probably
!> mean.
module looked_up_words
  use texts, only: did_you_mean, joined, lower_case
  use variables, only: full_names
  implicit none
  private
  public :: advice_about, looked_up, looked_up_word_t, meant_variables, word_length

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

  !> Advice about an unknown name: the variables that a user means by it, or the variables of this
  !> name, or else `otherwise`.
  pure function advice_about(name, otherwise) result(advice)
    character(len=*), intent(in) :: name, otherwise
    character(len=:), allocatable :: advice

    advice = full_names(name)
    if (size(meant_variables(name)) > 0) advice = joined(meant_variables(name), " or ")
    if (advice /= "") then
      advice = did_you_mean(advice)
    else
      advice = otherwise
    end if
  end function advice_about

end module looked_up_words
