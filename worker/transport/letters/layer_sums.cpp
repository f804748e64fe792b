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

void LayerUnits::write(std::span<const LabelledSum> sums, float weight, film::UnitFilm& film, std::uint32_t x,
                       std::uint32_t y, std::uint64_t key, std::uint32_t offset) {
  std::array<std::int64_t, kColors> before{};
  for (const LabelledSum& part : sums) {
    const Spectrum value = part.sum * weight;
    const auto units = film.units({value.r, value.g, value.b}, key);
    for (std::size_t c = 0; c < kColors; ++c) {
      const std::int64_t difference = units[c] - before[c];
      before[c] = units[c];
      if (difference == 0) continue;
      for (const std::uint8_t layer : letters_.layers(part.labels.of[c])) {
        if (touched_[layer] == 0) {
          touched_[layer] = 1;
          units_[layer] = {};
          used_.push_back(layer);
        }
        units_[layer][c] += difference;
      }
    }
  }
  for (const std::uint8_t layer : used_) {
    film.splat_units(letters_.first_layer() + offset + layer, x, y, units_[layer]);
    touched_[layer] = 0;
  }
  used_.clear();
}

void LayerSums::add(const Spectrum& before, const Spectrum& sum, const LabelledParts& parts,
                    const Spectrum& factor) {
  const auto all = parts.parts();
  Spectrum prefix = before;
  for (std::size_t i = 0; i < all.size(); ++i) {
    prefix += all[i].value * factor;
    sums_.push_back({i + 1 == all.size() ? sum : prefix, all[i].labels});
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
