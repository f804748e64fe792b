// Samplers: pure functions of (seed, half, index, pixel or light path, dimension). start() and start_light()
// name the sample; each draw takes the next dimension. Every path vertex owns a fixed block of dimensions, so
// that two samples of one pixel use the same dimension for the same decision.
//
// `sobol` is a padded, Owen-scrambled (0,2)-sequence: each dimension is the first two dimensions of Sobol's
// sequence with its index shuffled and both coordinates scrambled by nested uniform permutations of their
// own, so that every draw of a pixel is a (0,2)-sequence and different draws are independent [Burley 2020].
// The scrambles are hashes of the Laine-Karras form with Vegdahl's constants. The second Sobol' dimension's
// matrix is Pascal's triangle mod 2; by Lucas' theorem its product with a vector is a sum over subsets, done
// in five shift-xor steps [Ahmed 2024].
#pragma once

#include <cstdint>

#include "common/rng/stream.h"
#include "worker/core/vec.h"

namespace candela::samplers {

enum class SamplerKind : std::uint8_t { independent, sobol };

namespace detail {

constexpr std::uint32_t reverse_bits(std::uint32_t v) {
  v = __builtin_bswap32(v);
  v = ((v & 0x0f0f0f0fu) << 4) | ((v >> 4) & 0x0f0f0f0fu);
  v = ((v & 0x33333333u) << 2) | ((v >> 2) & 0x33333333u);
  return ((v & 0x55555555u) << 1) | ((v >> 1) & 0x55555555u);
}
constexpr std::uint64_t reverse_bits64(std::uint64_t v) {
  v = __builtin_bswap64(v);
  v = ((v & 0x0f0f0f0f0f0f0f0fu) << 4) | ((v >> 4) & 0x0f0f0f0f0f0f0f0fu);
  v = ((v & 0x3333333333333333u) << 2) | ((v >> 2) & 0x3333333333333333u);
  return ((v & 0x5555555555555555u) << 1) | ((v >> 1) & 0x5555555555555555u);
}

// A permutation in which a bit only depends on the bits below it: on reversed bits, a nested uniform (Owen)
// scramble.
constexpr std::uint32_t owen_hash(std::uint32_t v, std::uint32_t seed) {
  v ^= v * 0x3d20adeau;
  v += seed;
  v *= (seed >> 16) | 1;
  v ^= v * 0x05526c56u;
  v ^= v * 0x53a22864u;
  return v;
}

// From the index to the bit-reversed value of Sobol's second dimension at it.
constexpr std::uint32_t sobol_second_reversed(std::uint32_t index) {
  index ^= index >> 16;
  index ^= (index & 0xff00ff00u) >> 8;
  index ^= (index & 0xf0f0f0f0u) >> 4;
  index ^= (index & 0xccccccccu) >> 2;
  index ^= (index & 0xaaaaaaaau) >> 1;
  return index;
}

}  // namespace detail

class Sampler {
 public:
  Sampler(SamplerKind kind, std::uint64_t seed) : kind_(kind), seed_(seed) {}

  // Sample `index` of the sequence of this pixel in this half. Halves use independent scrambles: their means
  // are independent estimates.
  void start(std::uint32_t half, std::uint64_t index, std::uint32_t x, std::uint32_t y) {
    start_sequence(rng::key(seed_, half, (static_cast<std::uint64_t>(y) << 32) | x), index);
  }
  // Sample `index` of the sequence of light path number `path` in this half: over the iterations each light
  // path is stratified as a pixel's samples are, and different paths of one iteration are independent.
  // Independent of all eye samples too: a pixel's word has its top bit clear, a path's has it set, and words
  // that differ give keys that differ. Precondition: path < 2^63.
  void start_light(std::uint32_t half, std::uint64_t index, std::uint64_t path) {
    start_sequence(rng::key(seed_, half, kLightWord | path), index);
  }
  // Jump to a dimension (start of a vertex's block). Dimensions are counted in draws, 1D and 2D alike count
  // one.
  void set_dimension(std::uint32_t dimension) { dimension_ = dimension; }

  // The draw of a given dimension; where not `stratified`, an independent one whatever the kind. Deep in a
  // path stratification no longer lowers the variance but still costs its hashes.
  float draw_1d(std::uint32_t dimension, bool stratified) {
    dimension_ = dimension;
    return stratified ? next_1d() : independent_1d();
  }
  Vec2 draw_2d(std::uint32_t dimension, bool stratified) {
    dimension_ = dimension;
    return stratified ? next_2d() : independent_2d();
  }

  float next_1d() {
    if (kind_ == SamplerKind::independent) return independent_1d();
    const std::uint64_t h = next_hash(sequence_key_);
    const std::uint32_t index =
        detail::reverse_bits(detail::owen_hash(reversed_index_, static_cast<std::uint32_t>(h)));
    return rng::to_float(detail::reverse_bits(detail::owen_hash(index, static_cast<std::uint32_t>(h >> 32))));
  }
  Vec2 next_2d() {
    if (kind_ == SamplerKind::independent) return independent_2d();
    const std::uint64_t h = next_hash(sequence_key_);
    const auto seed_x = static_cast<std::uint32_t>(h >> 32);
    const auto seed_y = static_cast<std::uint32_t>((h * 0xd1342543de82ef95u) >> 32);
    const std::uint32_t index =
        detail::reverse_bits(detail::owen_hash(reversed_index_, static_cast<std::uint32_t>(h)));
    const std::uint32_t x = detail::owen_hash(index, seed_x);
    const std::uint32_t y = detail::owen_hash(detail::sobol_second_reversed(index), seed_y);
    // One reversal of 64 bits reverses both and swaps them.
    const std::uint64_t both = detail::reverse_bits64((static_cast<std::uint64_t>(y) << 32) | x);
    return {rng::to_float(static_cast<std::uint32_t>(both >> 32)),
            rng::to_float(static_cast<std::uint32_t>(both))};
  }
  // Names the sample: seeds the film's rounding. (Several contributions of one sample may share it: each is
  // rounded without bias.)
  std::uint64_t sample_key() const { return sample_key_; }

 private:
  static constexpr std::uint64_t kLightWord = 1ULL << 63;

  void start_sequence(std::uint64_t sequence_key, std::uint64_t index) {
    sequence_key_ = sequence_key;
    sample_key_ = rng::combine(sequence_key, index);
    // The sequence has 2^32 points; each further block of as many has scrambles of its own.
    if ((index >> 32) != 0) sequence_key_ = rng::combine(sequence_key, ~(index >> 32));
    reversed_index_ = detail::reverse_bits(static_cast<std::uint32_t>(index));
    dimension_ = 0;
  }
  float independent_1d() { return rng::to_float(static_cast<std::uint32_t>(next_hash(sample_key_) >> 32)); }
  Vec2 independent_2d() {
    const std::uint64_t h = next_hash(sample_key_);
    return {rng::to_float(static_cast<std::uint32_t>(h)), rng::to_float(static_cast<std::uint32_t>(h >> 32))};
  }
  std::uint64_t next_hash(std::uint64_t key) {
    return rng::mix64(key + static_cast<std::uint64_t>(++dimension_) * 0x9e3779b97f4a7c15u);
  }

  SamplerKind kind_;
  std::uint64_t seed_;
  std::uint64_t sequence_key_ = 0;  // (seed, half, pixel or path, block of the sequence): scrambles
  std::uint64_t sample_key_ = 0;    // (seed, half, pixel or path, index)
  std::uint32_t reversed_index_ = 0;
  std::uint32_t dimension_ = 0;
};

}  // namespace candela::samplers
