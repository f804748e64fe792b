#include "worker/transport/letters/layer_sums.h"

#include <bit>
#include <utility>

namespace candela::transport {
void LabelledParts::add(const ChannelLabels& labels, const Spectrum& value) {
  for (Part& part : parts_) {
    if (part.labels != labels) continue;
    part.value += value;
    return;
  }
  parts_.push_back({labels, value});
}

void LayerUnits::gather(std::span<const LabelledSum> sums, float weight, const film::UnitFilm& film,
                        std::uint64_t key) {
  if (sums.empty()) return;
  const std::uint64_t word = film::dither_word(key);
  Units before{};
  bool wrapped = false;
  const auto add = [&](std::int64_t& to, std::int64_t more) {
    wrapped |= __builtin_add_overflow(to, more, &to);
  };
  for (const LabelledSum& part : sums) {
    const Spectrum value = part.sum * weight;
    const Units units = film.units({value.r, value.g, value.b}, word);
    if (part.labels.uniform()) [[likely]] {
      Cell& cell = use(part.labels[0]);
      for (std::size_t c = 0; c < kColors; ++c) add(cell.units[c], units[c] - before[c]);
    } else {
      for (std::size_t c = 0; c < kColors; ++c) add(use(part.labels[c]).units[c], units[c] - before[c]);
    }
    before = units;
  }
  wrapped_ |= wrapped;
}

void LayerUnits::write(film::UnitFilm& film, std::uint32_t x, std::uint32_t y, std::uint32_t offset) {
  // Labels share layers: the film's cells are touched once a layer.
  std::array<Units, 64> sums;  // of layers in `filled`
  std::uint64_t filled = 0;
  for (std::size_t i = 0; i < used_count_; ++i) {
    Cell& cell = cells_[used_[i]];
    cell.used = false;
    const Units units = std::exchange(cell.units, {});
    if ((units[0] | units[1] | units[2]) == 0) continue;
    const std::uint64_t bits = letters_.layer_bits(used_[i]);
    for (std::uint64_t rest = bits & ~filled; rest != 0; rest &= rest - 1)
      sums[static_cast<std::size_t>(std::countr_zero(rest))] = units;
    for (std::uint64_t rest = bits & filled; rest != 0; rest &= rest - 1) {
      Units& sum = sums[static_cast<std::size_t>(std::countr_zero(rest))];
      for (std::size_t c = 0; c < kColors; ++c) wrapped_ |= __builtin_add_overflow(sum[c], units[c], &sum[c]);
    }
    filled |= bits;
  }
  used_count_ = 0;
  const std::uint32_t first = letters_.first_layer() + offset;
  for (; filled != 0; filled &= filled - 1) {
    const int layer = std::countr_zero(filled);
    film.splat_units(first + static_cast<std::uint32_t>(layer), x, y, sums[static_cast<std::size_t>(layer)]);
  }
  if (wrapped_) [[unlikely]] {
    film.note_overflow();
    wrapped_ = false;
  }
}

void splat_labelled(const PathLetters& letters, const ChannelLabels& labels,
                    const std::array<std::int64_t, kColors>& units, film::UnitFilm& film, std::uint32_t x,
                    std::uint32_t y) {
  if (labels.uniform()) [[likely]] {
    for (std::uint64_t rest = letters.layer_bits(labels[0]); rest != 0; rest &= rest - 1)
      film.splat_units(letters.first_layer() + static_cast<std::uint32_t>(std::countr_zero(rest)), x, y,
                       units);
    return;
  }
  std::array<std::uint64_t, kColors> bits;
  std::uint64_t all = 0;
  for (std::size_t c = 0; c < kColors; ++c) all |= bits[c] = letters.layer_bits(labels[c]);
  for (; all != 0; all &= all - 1) {
    const int layer = std::countr_zero(all);
    const auto part = [&](std::size_t c) { return (bits[c] >> layer & 1) != 0 ? units[c] : 0; };
    film.splat_units(letters.first_layer() + static_cast<std::uint32_t>(layer), x, y,
                     {part(0), part(1), part(2)});
  }
}

void LayerSums::add(const Spectrum& before, const Spectrum& sum, const LabelledParts& parts,
                    const Spectrum& factor) {
  const auto all = parts.parts();
  Spectrum prefix = before;
  for (std::size_t i = 0; i < all.size(); ++i) {
    prefix += all[i].value * factor;
    add(i + 1 == all.size() ? sum : prefix, all[i].labels);
  }
}

std::uint64_t LetterKeys::at(std::uint32_t number) {
  if (made_ > number) {  // none, or one behind it
    const auto bits = [](float v) { return std::uint64_t{std::bit_cast<std::uint32_t>(v)}; };
    value_ = rng::key(path_, 0x6c657474657273ULL,  // "letters"
                      bits(direction_.x) << 32 | bits(direction_.y), bits(direction_.z));
    made_ = 0;
  }
  for (; made_ < number; ++made_) value_ = rng::combine(value_, 1);
  return value_;
}

void EyeLetters::scattered(const ScatterPoint& v, Vec3 wi) {
  step(letters_.left(v, wi, TransportMode::radiance, next_key()));
}

void EyeLetters::scattered(const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo, Vec3 wi,
                           bool delta) {
  step(delta ? letters_.by_delta(hit, wo, wi)
             : letters_.by_lobes(hit, closure, wo, wi, TransportMode::radiance, next_key()));
}

void EyeLetters::scattered(std::uint32_t medium, Vec3 p) {
  step(letters_.in_medium(medium, p));
}

void EyeLetters::met(const Spectrum& sum, std::uint32_t emitter) {
  sums_.add(sum, letters_.labels(letters_.at_lamp(emitter), states_));
}

void EyeLetters::met_outside(const Spectrum& sum, Vec3 d) {
  sums_.add(sum, letters_.labels(letters_.at_outside(d, next_key()), states_));
}

void EyeLetters::met(const Spectrum& sum, const ScatterPoint& v, bool left) {
  if (left)
    met_outside(sum, -v.wo);
  else
    met(sum, v.hit.emitter);
}

void EyeLetters::lit(const Spectrum& sum, const ScatterPoint& v, const Towards& light) {
  const ChannelClasses token = letters_.of(v, light.wi, TransportMode::radiance, next_key());
  add(sum, token, letters_.at_light(light.emitter, light.wi, next_key()));
}

void EyeLetters::lit(const Spectrum& sum, const SurfaceHit& hit, const scene::Closure& closure, Vec3 wo,
                     const Towards& light) {
  const ChannelClasses token =
      letters_.by_lobes(hit, closure, wo, light.wi, TransportMode::radiance, next_key());
  add(sum, token, letters_.at_light(light.emitter, light.wi, next_key()));
}

void EyeLetters::lit(const Spectrum& sum, std::uint32_t medium, Vec3 p, const Towards& light) {
  next_key();  // as many names as on a surface
  add(sum, letters_.in_medium(medium, p), letters_.at_light(light.emitter, light.wi, next_key()));
}

void EyeLetters::connected(const Spectrum& sum, const ScatterPoint& y, const ScatterPoint& z,
                           const ChannelStates& before) {
  const Vec3 to_light = Vec3(normalize(Vec3d(z.hit.p) - Vec3d(y.hit.p)));
  const ChannelClasses at_light = letters_.of(z, -to_light, TransportMode::importance, next_key());
  const ChannelClasses at_eye = letters_.of(y, to_light, TransportMode::radiance, next_key());
  add(sum, at_eye, letters_.from_light(before, at_light));
}

void LightLetters::begin(const scene::EmissionSample& light, std::uint64_t key) {
  keys_.begin(key, light.ray);
  states_ = letters_.at_light(light.vertex.emitter, -light.ray.direction, keys_.next());
}

void LightLetters::scattered(const ScatterPoint& v, Vec3 wi) {
  states_ = letters_.from_light(states_, letters_.left(v, wi, TransportMode::importance, keys_.next()));
}

ChannelLabels LightLetters::connected(const ScatterPoint& v, Vec3 wi) {
  const ChannelClasses token = letters_.of(v, wi, TransportMode::importance, keys_.next());
  return letters_.labels(letters_.from_light(states_, token), letters_.at_eye());
}

}  // namespace candela::transport
