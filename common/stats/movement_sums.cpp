#include "common/stats/movement_sums.h"

#include <algorithm>
#include <cmath>

#include "common/film/codec.h"
#include "common/film/tile_sums.h"

namespace candela::stats {
namespace {

constexpr std::string_view kMagic = "CANMOVE2";
constexpr int kWeightLog2 = 14;  // a weight of 1 is 2^14

film::Uint128 read_wide(film::Reader& reader) {
  const film::Uint128 high = reader.u64();
  return high << 64 | reader.u64();
}
void put_wide(std::string& out, film::Uint128 value) {
  film::put_u64(out, static_cast<std::uint64_t>(value >> 64));
  film::put_u64(out, static_cast<std::uint64_t>(value));
}
// Sums of real jobs are far from the ends of 128 bits; those of absurd ones wrap around, in any order alike.
void add_wide(film::Int128& to, film::Int128 value) {
  to = static_cast<film::Int128>(static_cast<film::Uint128>(to) + static_cast<film::Uint128>(value));
}

}  // namespace

std::uint64_t MovementSums::memory_bytes(std::uint32_t width, std::uint32_t height) {
  const std::uint64_t side = block_side(width, height);
  const std::uint64_t blocks = ((width + side - 1) / side) * ((height + side - 1) / side);
  return blocks * film::kChannels * sizeof(film::Int128) * 2 * 2;  // squares and cubes of each half
}

MovementSums::MovementSums(const film::Layout& layout, double alpha) : alpha_(alpha) {
  if (!needed()) return;
  layout_ = layout;
  side_ = block_side(layout.width, layout.height);
  width_ = (layout.width + side_ - 1) / side_;
  height_ = (layout.height + side_ - 1) / side_;
  for (Half& half : halves_) {
    half.squares.resize(std::size_t{width_} * height_ * film::kChannels);
    half.cubes.resize(half.squares.size());
  }
}

// The indices [from, to) of each half, which are the iterations [2 from, 2 to).
std::uint64_t MovementSums::weight_of(std::uint64_t from, std::uint64_t to) const {
  const double mean =
      mean_movement_weight(2 * static_cast<double>(from), 2 * static_cast<double>(to), alpha_);
  return std::max<std::uint64_t>(1, static_cast<std::uint64_t>(std::llround(std::ldexp(mean, kWeightLog2))));
}

void MovementSums::count(Half& half, std::uint64_t indices, std::uint64_t weight) {
  half.n += indices;
  film::Uint128 power = indices;
  for (film::Uint128& sum : half.powers) sum += power *= weight;
}

void MovementSums::add(const film::Delta& delta, film::SparseSums::TileBuffers& buffers) {
  if (!needed()) return;
  const Unit& unit = delta.info().unit;
  Half& half = halves_[unit.half];
  const std::uint64_t end = end_of_group(unit.begin);
  const std::uint64_t w = weight_of(end > 2 ? end / 2 : 0, end);
  count(half, unit.end - unit.begin, w);
  const film::Int128 square = film::Int128{static_cast<std::int64_t>(w)} * w, cube = square * w;
  const std::size_t image_tiles = std::size_t{layout_.tiles_x()} * layout_.tiles_y();
  delta.film().for_each_tile(buffers, [&](std::size_t tile, std::span<const std::int64_t> values) {
    if (tile >= image_tiles) return;
    const film::TileRect rect = film::tile_rect(layout_, tile);
    const std::int64_t* from = values.data();
    for (std::size_t c = 0; c < film::kChannels; ++c)
      for (std::uint32_t y = rect.y; y < rect.y + rect.height; ++y) {
        const std::size_t row = std::size_t{y / side_} * width_;
        for (std::uint32_t x = rect.x; x < rect.x + rect.width; ++x) {
          const std::size_t i = (row + x / side_) * film::kChannels + c;
          add_wide(half.squares[i], *from * square);
          add_wide(half.cubes[i], *from++ * cube);
        }
      }
  });
}

void MovementSums::add(const MovementSums& other) {
  if (!needed()) return;
  for (std::size_t h = 0; h < 2; ++h) {
    Half& to = halves_[h];
    const Half& from = other.halves_[h];
    to.n += from.n;
    for (std::size_t k = 0; k < to.powers.size(); ++k) to.powers[k] += from.powers[k];
    for (std::size_t i = 0; i < to.squares.size(); ++i) {
      add_wide(to.squares[i], from.squares[i]);
      add_wide(to.cubes[i], from.cubes[i]);
    }
  }
}

void MovementSums::adopt(const film::MergedFilm& film) {
  *this = MovementSums(layout_, alpha_);
  if (!needed()) return;
  for (std::uint32_t h = 0; h < 2; ++h) {
    Half& half = halves_[h];
    const std::uint64_t n = film.merged(h).count(), w = weight_of(0, std::max<std::uint64_t>(n, 1));
    count(half, n, w);
    for (std::uint32_t y = 0; y < layout_.height; ++y)
      for (std::uint32_t x = 0; x < layout_.width; ++x)
        for (int c = 0; c < film::kChannels; ++c) {
          const std::size_t i =
              (std::size_t{y / side_} * width_ + x / side_) * film::kChannels + static_cast<std::size_t>(c);
          const film::Int128 square =
              film.sum(h, 0, x, y, c) * static_cast<film::Int128>(film::Uint128{w} * w);
          add_wide(half.squares[i], square);
          add_wide(half.cubes[i], square * static_cast<film::Int128>(w));
        }
  }
}

bool MovementSums::fits(const film::MergedFilm& film) const {
  return !needed() || (halves_[0].n == film.merged(0).count() && halves_[1].n == film.merged(1).count());
}

Movement MovementSums::movement(const film::MergedFilm& film) const {
  if (!needed() || !fits(film) || halves_[0].n == 0 || halves_[1].n == 0) return {};
  BlockMeans now;
  now.side = side_;
  now.width = width_;
  now.height = height_;
  now.n0 = static_cast<double>(halves_[0].n);
  now.n1 = static_cast<double>(halves_[1].n);
  std::array<Movement::Half, 2> sums;
  for (std::size_t h = 0; h < 2; ++h) {
    const Half& half = halves_[h];
    for (std::size_t k = 0; k < half.powers.size(); ++k)
      sums[h].powers[k] =
          std::ldexp(static_cast<double>(half.powers[k]), -kWeightLog2 * (static_cast<int>(k) + 1));
    const auto put = [&](const std::vector<film::Int128>& from, int power, std::vector<float>& to) {
      const double value_per_unit = std::ldexp(1.0, -film.scale_log2() - power * kWeightLog2);
      to.reserve(from.size());
      for (std::size_t i = 0; i < from.size(); ++i) {
        const std::size_t block = i / film::kChannels, x = block % width_, y = block / width_;
        const double pixels = std::min<double>(side_, layout_.width - static_cast<double>(x * side_)) *
                              std::min<double>(side_, layout_.height - static_cast<double>(y * side_));
        to.push_back(static_cast<float>(static_cast<double>(from[i]) * value_per_unit / pixels));
      }
    };
    put(half.squares, 2, sums[h].squares);
    put(half.cubes, 3, sums[h].cubes);
  }
  return Movement::of(std::move(now), std::move(sums));
}

// Alpha (a double's bits, u64); for each half the number of indices (u64), the sums of powers (two u64 each),
// and those of the blocks, squares and then cubes, in the form of a film's; checksum.
std::string MovementSums::serialise() const {
  std::string out(kMagic);
  film::put_u64(out, std::bit_cast<std::uint64_t>(alpha_));
  for (const Half& half : halves_) {
    film::put_u64(out, half.n);
    for (const film::Uint128 power : half.powers) put_wide(out, power);
    for (const std::vector<film::Int128>* blocks : {&half.squares, &half.cubes}) {
      film::TileSums sums({width_, height_, 1}, film::kChannels);
      for (std::uint32_t y = 0; y < height_; ++y)
        for (std::uint32_t x = 0; x < width_; ++x)
          sums.set_pixel(
              0, x, y,
              std::span(*blocks).subspan((std::size_t{y} * width_ + x) * film::kChannels, film::kChannels));
      sums.put(out);
    }
  }
  film::seal(out);
  return out;
}

Result<bool> MovementSums::parse(std::string_view bytes) {
  CANDELA_ASSIGN(const std::string_view content, film::unseal(bytes, kMagic, "the movement of the image"));
  film::Reader reader(content);
  const auto alpha = std::bit_cast<double>(reader.u64());
  if (reader.ok() && alpha != alpha_) return false;
  std::array<Half, 2> halves = halves_;
  for (Half& half : halves) {
    half.n = reader.u64();
    for (film::Uint128& power : half.powers) power = read_wide(reader);
    for (std::vector<film::Int128>* blocks : {&half.squares, &half.cubes}) {
      film::TileSums sums({width_, height_, 1}, film::kChannels);
      CANDELA_TRY(sums.read(reader, ~film::Uint128{0} >> 1, "the movement of the image"));
      for (std::uint32_t y = 0; y < height_; ++y)
        for (std::uint32_t x = 0; x < width_; ++x)
          sums.get_pixel(
              0, x, y,
              std::span(*blocks).subspan((std::size_t{y} * width_ + x) * film::kChannels, film::kChannels));
    }
  }
  if (!reader.ok() || !reader.rest().empty())
    return input_error("the movement of the image is cut, or too long").with_field("length");
  halves_ = std::move(halves);
  return true;
}

}  // namespace candela::stats
