#include "worker/scene/emitters/emitter_build.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <variant>

#include "worker/scene/emitters/emitter_set.h"

namespace candela::scene {
namespace {

template <class Light>
concept BuildsItself = requires {
  Light::kPlugins;
};

// Tries the kinds from kRow on.
template <std::size_t kRow = 0>
Result<std::optional<Emitter>> build_kind(const description::Object& object, TextureStore& textures) {
  if constexpr (kRow == kEmitterKinds) {
    return emitter_error(object, "emitter '" + object.plugin + "' is not supported yet");
  } else {
    using Light = std::variant_alternative_t<kRow, Emitter>;
    if constexpr (BuildsItself<Light>) {
      const auto& names = Light::kPlugins;
      if (std::find(std::begin(names), std::end(names), object.plugin) != std::end(names)) {
        CANDELA_ASSIGN(Light light, Light::build(object, textures));
        if (light.black()) return std::optional<Emitter>();
        return std::optional<Emitter>(std::move(light));
      }
    }
    return build_kind<kRow + 1>(object, textures);
  }
}

}  // namespace

Result<std::optional<Emitter>> build_emitter(const description::Object& object, TextureStore& textures) {
  return build_kind(object, textures);
}

Error emitter_error(const description::Object& object, std::string message, std::string_view property) {
  Error error = input_error(std::move(message)).at(object.where.file, object.where.line);
  return property.empty() ? error : std::move(error).with_field(std::string(property));
}

bool is_radiometric(Spectrum s) {
  return std::min(s.r, std::min(s.g, s.b)) >= 0 && std::isfinite(s.r) && std::isfinite(s.g) &&
         std::isfinite(s.b);
}

Result<Spectrum> read_quantity(const description::Object& object, std::string_view name) {
  const auto rgb = object.get_rgb(name);
  const Spectrum value = rgb ? Spectrum{static_cast<float>(rgb->value[0]), static_cast<float>(rgb->value[1]),
                                        static_cast<float>(rgb->value[2])}
                             : Spectrum(1.0f);
  if (!is_radiometric(value))
    return emitter_error(object, std::string(name) + " must be finite and not negative", name);
  return value;
}

Result<Frame> read_frame(const description::Object& object, const Transform& to_world) {
  const Vec3d x = to_world.column(0), y = to_world.column(1), z = to_world.column(2);
  if (!to_world.is_similarity() || !(length(z) > 0)) {
    return emitter_error(object,
                         "the to_world of a " + object.plugin + " light must not shear, stretch or flatten",
                         "to_world");
  }
  // Gram-Schmidt: what is left of the rounding in the file.
  const Vec3d n = normalize(z), s = normalize(x - n * dot(n, x));
  const Vec3d t = normalize(y - n * dot(n, y) - s * dot(s, y));
  return Frame{Vec3(s), Vec3(t), Vec3(n)};
}

float radiance_of_point(Spectrum peak, double scene_radius) {
  const double r = std::max(scene_radius, 1e-12);
  return luminance(peak) / static_cast<float>(r * r);
}

}  // namespace candela::scene
