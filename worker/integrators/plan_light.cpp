#include "worker/integrators/plan_light.h"

#include <fmt/format.h>

#include <string>
#include <string_view>

#include "common/job/plan_words.h"

namespace candela::integrators {

void note_lucky_light(const scene::SceneFeatures& features, std::uint32_t max_depth, Finds finds,
                      Plan& plan) {
  const bool from_eye = finds == Finds::eye_paths;
  // Light, glass, a matt surface, the eye; with glass between the last two where light paths are connected.
  const std::uint32_t edges = from_eye ? 3 : 4;
  const auto has = [&](const char* kind) { return features.bsdf_kinds.contains(kind); };
  // Surfaces that let light pass straight on focus none.
  const bool bends =
      features.any_delta_bsdf && (has("conductor") || has("dielectric") || has("plastic") || has("coating"));
  const bool rests = !features.all_bsdfs_delta || features.any_scattering_medium;
  if (features.emitters == 0 || max_depth < edges || !bends || !rests) return;
  const std::string_view where =
      from_eye ? "over mirrors or glass onto other surfaces (caustics)"
               : "over glass or mirrors, another surface, and glass or mirrors again to the eye";
  if (features.any_delta_emitter)
    plan.note(std::string(kMissingLight),
              fmt::format("of points and directions {}: this integrator never finds it; {}", where,
                          from_eye ? "vcm does, and bdpt what the eye sees directly" : "vcm does"));
  const bool uneven = features.any_environment && features.environment_variation >= 1;
  if (features.any_area_emitter || uneven)
    plan.note(std::string(kLuckyLight),
              fmt::format("{}: found only if a path happens to hit {}; {} finds it", where,
                          features.any_area_emitter ? "a lamp" : "the bright part of the environment",
                          from_eye ? "vcm or bdpt" : "vcm"));
}

}  // namespace candela::integrators
