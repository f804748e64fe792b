// The sums that the movement of a job's image (movement.h) is computed from. They are integers that each
// merged delta adds to, so the movement, and with it the shown error, is a function of the merged indices: it
// does not depend on when or in which order they were merged.
//
// The indices of each half form groups: [0, 2), [2, 4), [4, 8), [8, 16), ... All deltas of a group have one
// weight, and no unit of a job with such sums crosses the border of a group.
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "common/film/delta.h"
#include "common/film/merged_film.h"
#include "common/stats/movement.h"

namespace candela::stats {

// One past the last index of the group that an index of a half is in.
constexpr std::uint64_t end_of_group(std::uint64_t index) {
  return index < 2 ? 2 : std::bit_floor(index) * 2;
}

class MovementSums {
 public:
  // Bytes of such sums of an image.
  static std::uint64_t memory_bytes(std::uint32_t width, std::uint32_t height);
  MovementSums() = default;  // of a job whose image does not move: nothing has an effect on them
  // The job has this film, and its squared bias falls as ErrorContext::alpha says. alpha = 1: as above.
  MovementSums(const film::Layout& layout, double alpha);

  // False: the job's image does not move.
  bool needed() const { return alpha_ < 1; }
  // Adds the image of a delta. Allocates nothing. Preconditions: the delta is of iterations, its film has
  // this layout, and `buffers` are for film::kChannels.
  void add(const film::Delta& delta, film::SparseSums::TileBuffers& buffers);
  // Adds sums of the same job. Allocates nothing.
  void add(const MovementSums& other);
  // Replaces the sums by those of a film that was merged without them, as one group.
  void adopt(const film::MergedFilm& film);
  // True if the sums are those of as many indices as the film has.
  bool fits(const film::MergedFilm& film) const;

  // Precondition: the film is that of the sums.
  Movement movement(const film::MergedFilm& film) const;

  std::string serialise() const;
  // Replaces the sums. False: they are of another alpha, and these stay. Fails (input) on anything but the
  // whole of what serialise() made for this layout.
  Result<bool> parse(std::string_view bytes);

 private:
  struct Half {
    std::uint64_t n = 0;                       // indices
    std::array<film::Uint128, 4> powers = {};  // as Movement::Half has them, of weight_of()
    std::vector<film::Int128> squares, cubes;
  };
  std::uint64_t weight_of(std::uint64_t from, std::uint64_t to) const;
  static void count(Half& half, std::uint64_t indices, std::uint64_t weight);

  film::Layout layout_;
  double alpha_ = 1;
  std::uint32_t side_ = 1, width_ = 0, height_ = 0;  // of a block, and of all blocks
  std::array<Half, 2> halves_;
};

}  // namespace candela::stats
