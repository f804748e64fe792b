#include "worker/transport/letters/layer_sums.h"

#include <bit>

namespace candela::transport {
namespace {

// The key of the draws between letters on a path that begins with this ray.
std::uint64_t letters_key(std::uint64_t key, const Ray& ray) {
  const auto bits = [](float v) { return std::uint64_t{std::bit_cast<std::uint32_t>(v)}; };
  return rng::key(key, 0x6c657474657273ULL,  // "letters"
                  bits(ray.direction.x) << 32 | bits(ray.direction.y), bits(ray.direction.z));
}

}  // namespace

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
  const std::uint64_t word = film::dither_word(key);
  std::array<std::int64_t, kColors> before{};
  for (const LabelledSum& part : sums) {
    const Spectrum value = part.sum * weight;
    const auto units = film.units({value.r, value.g, value.b}, word);
    for (std::size_t c = 0; c < kColors; ++c) {
      const std::int64_t difference = units[c] - before[c];
      const letters::Automaton::Label label = part.labels.of[c];
      if (touched_[label] == 0) {
        touched_[label] = 1;
        units_[label] = {};
        used_.push_back(label);
      }
      wrapped_ |= __builtin_add_overflow(units_[label][c], difference, &units_[label][c]);
    }
    before = units;
  }
}

void LayerUnits::write(film::UnitFilm& film, std::uint32_t x, std::uint32_t y, std::uint32_t offset) {
  // Labels share layers: the film's cells are touched once a layer.
  std::array<std::array<std::int64_t, kColors>, 64> sums;  // of layers in `filled`
  std::uint64_t filled = 0;
  for (const letters::Automaton::Label label : used_) {
    touched_[label] = 0;
    const std::array<std::int64_t, kColors>& units = units_[label];
    if ((units[0] | units[1] | units[2]) == 0) continue;
    const std::uint64_t bits = letters_.layer_bits(label);
    for (std::uint64_t rest = bits; rest != 0; rest &= rest - 1) {
      auto& sum = sums[static_cast<std::size_t>(std::countr_zero(rest))];
      if ((filled & rest & -rest) == 0) {
        sum = units;
        continue;
      }
      for (std::size_t c = 0; c < kColors; ++c) wrapped_ |= __builtin_add_overflow(sum[c], units[c], &sum[c]);
    }
    filled |= bits;
  }
  used_.clear();
  for (; filled != 0; filled &= filled - 1) {
    const int layer = std::countr_zero(filled);
    film.splat_units(letters_.first_layer() + offset + static_cast<std::uint32_t>(layer), x, y,
                     sums[static_cast<std::size_t>(layer)]);
  }
  if (wrapped_) [[unlikely]]
    film.note_overflow();
  wrapped_ = false;
}

void splat_labelled(const PathLetters& letters, const ChannelLabels& labels,
                    const std::array<std::int64_t, kColors>& units, film::UnitFilm& film, std::uint32_t x,
                    std::uint32_t y) {
  std::array<std::uint64_t, kColors> bits;
  std::uint64_t all = 0;
  for (std::size_t c = 0; c < kColors; ++c) all |= bits[c] = letters.layer_bits(labels.of[c]);
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

void EyeLetters::begin(std::uint64_t key, const Ray& ray) {
  sums_.clear();
  states_ = letters_.at_eye();
  key_ = letters_key(key, ray);
}

void EyeLetters::scattered(const ScatterPoint& v, Vec3 wi) {
  step(letters_.left(v, wi, TransportMode::radiance, next_key()));
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

void EyeLetters::lit(const Spectrum& sum, const ChannelClasses& token, const ChannelStates& light) {
  sums_.add(sum, letters_.labels(light, letters_.from_eye(states_, token)));
}

void EyeLetters::lit(const Spectrum& sum, const ScatterPoint& v, const Towards& light) {
  const ChannelClasses token = letters_.of(v, light.wi, TransportMode::radiance, next_key());
  lit(sum, token, letters_.at_light(light.emitter, light.wi, next_key()));
}

void EyeLetters::connected(const Spectrum& sum, const ScatterPoint& y, const ScatterPoint& z,
                           const ChannelStates& before) {
  const Vec3 to_light = Vec3(normalize(Vec3d(z.hit.p) - Vec3d(y.hit.p)));
  const ChannelClasses at_light = letters_.of(z, -to_light, TransportMode::importance, next_key());
  const ChannelClasses at_eye = letters_.of(y, to_light, TransportMode::radiance, next_key());
  lit(sum, at_eye, letters_.from_light(before, at_light));
}

void LightLetters::begin(const scene::EmissionSample& light, std::uint64_t key) {
  key_ = letters_key(key, light.ray);
  states_ = letters_.at_light(light.vertex.emitter, -light.ray.direction, next_key());
}

void LightLetters::scattered(const ScatterPoint& v, Vec3 wi) {
  states_ = letters_.from_light(states_, letters_.left(v, wi, TransportMode::importance, next_key()));
}

ChannelLabels LightLetters::connected(const ScatterPoint& v, Vec3 wi) {
  const ChannelClasses token = letters_.of(v, wi, TransportMode::importance, next_key());
  return letters_.labels(letters_.from_light(states_, token), letters_.at_eye());
}

}  // namespace candela::transport
