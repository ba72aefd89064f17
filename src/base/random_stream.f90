!> Reproducible random numbers from the generator xoshiro256** (Blackman and Vigna, 2021,
!> doi:10.1145/3460772). The generator is seeded by SplitMix64 (Steele, Lea and Flood, 2014,
!> doi:10.1145/2660193.2660195), so that consecutive seeds give unrelated streams. A copy of a
!> random stream yields the same numbers as the original.
!>
!> Both generators use unsigned arithmetic modulo 2**64. Fortran has no unsigned integers and does
!> not allow signed integers to overflow, so sums and products modulo 2**64 are calculated in
!> 128-bit integers.
module random_stream
  use kinds, only: int32, int64, int128, real64
  implicit none
  private
  public :: key_of_draws, random_stream_t

  !> Purposes of random numbers during a run. The initial state uses other streams.
  integer, parameter, public :: thermal_walls = 3, kicked_disks = 4, orientations = 5, recycled_disks = 6, entering_disks = 7

  real(real64), parameter :: unit_53 = 2.0_real64**(-53)

  !> State of one xoshiro256** generator.
  type :: random_stream_t
    integer(int64) :: word(4) = 0_int64         !! state; at least one word is nonzero after seeding
  contains
    procedure :: seed
    procedure :: seed_draw
    procedure :: seed_disk
    procedure :: draw_word
    procedure :: draw_uniform
    procedure :: draw_index
    procedure :: draw_direction
    procedure :: draw_normals
  end type random_stream_t

contains

  !> Starts the random stream of a seed and a key. Streams with different keys are independent, so
  !> the number of draws for one purpose never affects the random numbers for another.
  pure subroutine seed(self, number, key)
    class(random_stream_t), intent(inout) :: self
    integer(int64), intent(in) :: number        !! seed from the input; any value is allowed
    integer, intent(in) :: key(:)               !! key that identifies the purpose of the stream; may be empty
    integer(int64) :: state
    integer :: k

    state = number
    do k = 1, size(key)
      call add_key(state, key(k))
    end do
    call fill(self, state)
  end subroutine seed

  !> Starts a separate random stream for a single draw during a run. The random numbers depend only
  !> on the arguments, and not on the thread or on earlier draws.
  pure subroutine seed_draw(self, number, purpose, id, count)
    class(random_stream_t), intent(inout) :: self
    integer(int64), intent(in) :: number        !! seed from the input
    integer, intent(in) :: purpose              !! such as `thermal_walls`; one of the constants above
    integer(int32), intent(in) :: id            !! id of the disk
    integer(int64), intent(in) :: count      !! index of the draw, or of the event that needs random numbers

    call self%seed_disk(key_of_draws(number, purpose), id, count)
  end subroutine seed_draw

  !> Part of the key of `seed_draw` that is common to all disks.
  pure function key_of_draws(number, purpose) result(key)
    integer(int64), intent(in) :: number        !! seed from the input
    integer, intent(in) :: purpose              !! as in `seed_draw`
    integer(int64) :: key, state

    state = number
    call add_key(state, purpose)
    call draw_seed(state, key)
  end function key_of_draws

  !> Version of `seed_draw` for callers that reuse the part of the key common to all disks.
  pure subroutine seed_disk(self, key, id, count)
    class(random_stream_t), intent(inout) :: self
    integer(int64), intent(in) :: key           !! from `key_of_draws`
    integer(int32), intent(in) :: id            !! id of the disk
    integer(int64), intent(in) :: count         !! as in `seed_draw`
    integer(int64) :: state

    state = ieor(key, int(id, int64))
    call add_key(state, int(ibits(count, 0, 31)))
    call add_key(state, int(ibits(count, 31, 31)))
    call fill(self, state)
  end subroutine seed_disk

  !> Mixes one element of a key into the state of SplitMix64.
  pure subroutine add_key(state, part)
    integer(int64), intent(inout) :: state
    integer, intent(in) :: part
    integer(int64) :: word

    call draw_seed(state, word)
    state = ieor(word, int(part, int64))
  end subroutine add_key

  !> Fills the state of a random stream with numbers from SplitMix64.
  pure subroutine fill(self, state)
    class(random_stream_t), intent(inout) :: self
    integer(int64), intent(inout) :: state
    integer :: k

    do k = 1, size(self%word)
      call draw_seed(state, self%word(k))
    end do
  end subroutine fill

  !> Returns the next 64 random bits.
  pure subroutine draw_word(self, word)
    class(random_stream_t), intent(inout) :: self
    integer(int64), intent(out) :: word

    call step(self%word, word)
  end subroutine draw_word

  !> Advances the state of the generator by one step and returns the next 64 random bits.
  pure subroutine step(s, word)
    integer(int64), intent(inout) :: s(4)
    integer(int64), intent(out) :: word
    integer(int64) :: shifted

    word = ishftc(wrapped(5*int(s(2), int128)), 7)
    word = wrapped(9*int(word, int128))
    shifted = ishft(s(2), 17)
    s(3) = ieor(s(3), s(1))
    s(4) = ieor(s(4), s(2))
    s(2) = ieor(s(2), s(3))
    s(1) = ieor(s(1), s(4))
    s(3) = ieor(s(3), shifted)
    s(4) = ishftc(s(4), 45)
  end subroutine step

  !> Draws a number uniformly distributed in [0, 1).
  pure subroutine draw_uniform(self, u)
    class(random_stream_t), intent(inout) :: self
    real(real64), intent(out) :: u
    integer(int64) :: word

    call self%draw_word(word)
    u = uniform(word)
  end subroutine draw_uniform

  !> Draws an integer uniformly distributed from 1 to n.
  pure subroutine draw_index(self, n, k)
    class(random_stream_t), intent(inout) :: self
    integer(int32), intent(in) :: n             !! > 0
    integer(int32), intent(out) :: k
    real(real64) :: u

    call self%draw_uniform(u)
    k = 1 + int(n*u, int32)
  end subroutine draw_index

  !> Draws a unit vector in a random direction by normalising a random point of the unit disk. Sine
  !> and cosine are avoided, because their last bits depend on the mathematical library.
  pure subroutine draw_direction(self, e)
    class(random_stream_t), intent(inout) :: self
    real(real64), intent(out) :: e(2)
    real(real64) :: s

    call draw_in_disk(self, e, s)
    e = e/sqrt(s)
  end subroutine draw_direction

  !> Draws two independent Gaussian random numbers of zero mean and unit variance by the polar
  !> method (Marsaglia and Bray, 1964, doi:10.1137/1006063). The last bits of the numbers may depend
  !> on the mathematical library, which computes the logarithm.
  pure subroutine draw_normals(self, z)
    class(random_stream_t), intent(inout) :: self
    real(real64), intent(out) :: z(2)
    real(real64) :: s

    call draw_in_disk(self, z, s)
    z = z*sqrt(-2*log(s)/s)
  end subroutine draw_normals

  !> Draws a uniformly distributed point of the unit disk, excluding the centre. Also returns the
  !> squared distance of the point from the centre.
  pure subroutine draw_in_disk(stream, point, s)
    class(random_stream_t), intent(inout) :: stream
    real(real64), intent(out) :: point(2), s
    integer(int64) :: state(4), word(2)

    state = stream%word                         ! a local copy can stay in registers
    do
      call step(state, word(1))
      call step(state, word(2))
      point = 2*uniform(word) - 1
      s = point(1)**2 + point(2)**2
      if (s > 0 .and. s < 1) exit
    end do
    stream%word = state
  end subroutine draw_in_disk

  !> Converts 64 random bits to a number in [0, 1): the upper 53 bits times 2**-53.
  elemental function uniform(word) result(u)
    integer(int64), intent(in) :: word
    real(real64) :: u

    u = real(ishft(word, -11), real64)*unit_53
  end function uniform

  !> Advances the generator SplitMix64 by one step and returns its next number.
  pure subroutine draw_seed(state, word)
    integer(int64), intent(inout) :: state
    integer(int64), intent(out) :: word
    integer(int64), parameter :: step = ior(ishft(int(z"9E3779B9", int64), 32), int(z"7F4A7C15", int64))
    integer(int64), parameter :: factor_1 = ior(ishft(int(z"BF58476D", int64), 32), int(z"1CE4E5B9", int64))
    integer(int64), parameter :: factor_2 = ior(ishft(int(z"94D049BB", int64), 32), int(z"133111EB", int64))

    state = wrapped(int(state, int128) + step)
    word = wrapped(int(ieor(state, ishft(state, -30)), int128)*factor_1)
    word = wrapped(int(ieor(word, ishft(word, -27)), int128)*factor_2)
    word = ieor(word, ishft(word, -31))
  end subroutine draw_seed

  !> Reduces an integer of magnitude up to 2**126, such as a product of two 64-bit integers, modulo
  !> 2**64. The result contains the lower 64 bits as a signed integer.
  pure function wrapped(number) result(word)
    integer(int128), intent(in) :: number
    integer(int64) :: word

    word = int(shifta(shiftl(number, 64), 64), int64)
  end function wrapped

end module random_stream
