#include "worker/integrators/plan_light.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

#include "common/job/plan_words.h"
#include "worker/estimators/options.h"

namespace candela::integrators {

namespace {

// Mirrors or glass. Surfaces that let light pass straight on focus none.
bool bends_light(const scene::SceneFeatures& features) {
  const auto has = [&](const char* kind) { return features.bsdf_kinds.contains(kind); };
  return features.any_delta_bsdf &&
         (has("conductor") || has("dielectric") || has("plastic") || has("coating"));
}
// Some surface or medium has vertices to connect or merge at.
bool has_vertices_to_join(const scene::SceneFeatures& features) {
  return !features.all_bsdfs_delta || features.any_scattering_medium;
}
// The scene has paths that end as `finds` cannot: light, glass, a matt surface, the eye; with glass between
// the last two if light paths are connected.
bool hides_light(const scene::SceneFeatures& features, std::uint32_t max_depth, Finds finds) {
  const std::uint32_t edges = finds == Finds::eye_paths ? 3 : 4;
  return features.emitters > 0 && max_depth >= edges && bends_light(features) &&
         has_vertices_to_join(features);
}
// Light paths happen to meet the lens: by luck they find all light.
bool meets_lens(const scene::SceneFeatures& features, Finds finds) {
  return finds == Finds::connections && features.finite_lens;
}
std::string_view over(Finds finds) {
  return finds == Finds::eye_paths
             ? "over mirrors or glass onto other surfaces (caustics)"
             : "over glass or mirrors, another surface, and glass or mirrors again to the eye";
}

// Says which light merging cannot find because all surfaces are specular. Empty: there is none.
std::string cannot_merge(const scene::SceneFeatures& features, std::uint32_t max_depth) {
  if (!features.any_delta_emitter || has_vertices_to_join(features) || features.finite_lens ||
      max_depth < 2 || !bends_light(features))
    return {};
  return "of points and directions over mirrors or glass straight to the eye: no path has a vertex where it "
         "could merge; take bdpt with regularise=on, which blurs it";
}

}  // namespace

std::string missing_light(const scene::SceneFeatures& features, std::uint32_t max_depth, Finds finds,
                          Mollifies mollifies) {
  if (!features.any_delta_emitter || mollifies == Mollifies::always || meets_lens(features, finds)) return {};
  if (!hides_light(features, max_depth, finds)) {
    // Lamps in mirrors.
    if (mollifies != Mollifies::if_asked || max_depth < 2 || !bends_light(features)) return {};
    return "of points and directions over mirrors or glass straight to the eye: no integrator finds it; give "
           "regularise=on, which blurs it";
  }
  return fmt::format(
      "of points and directions {}: this integrator never finds it; {}{}", over(finds),
      finds == Finds::eye_paths ? "take vcm, or bdpt for what the eye sees directly" : "take vcm",
      mollifies == Mollifies::if_asked ? ", or give regularise=on, which blurs it" : "");
}

std::string missing_light(const scene::SceneFeatures& features, std::string_view integrator,
                          const SettingsMap& settings) {
  const auto setting = [&](const char* name) {
    const auto found = settings.find(name);
    return found == settings.end() ? std::string_view() : std::string_view(found->second);
  };
  int depth = -1;
  const std::string_view text = setting("max_depth");
  std::from_chars(text.data(), text.data() + text.size(), depth);
  const std::uint32_t max_depth = depth < 0 ? estimators::kNoDepthLimit : static_cast<std::uint32_t>(depth);
  constexpr std::array<std::string_view, 9> kMerging{"ppm",  "bpm",  "vcm",  "upbp", "vcmplus",
                                                     "fppm", "cppm", "appm", "mcppm"};
  if (std::ranges::find(kMerging, integrator) != kMerging.end()) return cannot_merge(features, max_depth);
  const bool from_eye = integrator == "path" || integrator == "optimis" ||
                        (integrator == "pssmlt" && setting("over") == "path");
  constexpr std::array<std::string_view, 5> kConnecting{"bdpt", "pssmlt", "mmlt", "mlt", "erpt"};
  if (!from_eye && std::ranges::find(kConnecting, integrator) == kConnecting.end()) return {};
  return missing_light(features, max_depth, from_eye ? Finds::eye_paths : Finds::connections,
                       !settings.contains("regularise") ? Mollifies::never
                       : setting("regularise") == "on"  ? Mollifies::always
                                                        : Mollifies::if_asked);
}

void note_lucky_light(const scene::SceneFeatures& features, std::uint32_t max_depth, Finds finds,
                      Mollifies mollifies, Plan& plan) {
  if (std::string missing = missing_light(features, max_depth, finds, mollifies); !missing.empty())
    plan.note(std::string(kMissingLight), std::move(missing));
  if (!hides_light(features, max_depth, finds)) return;
  const bool uneven = features.any_environment && features.environment_variation >= 1;
  if (features.any_delta_emitter && meets_lens(features, finds))
    plan.note(
        std::string(kLuckyLight),
        fmt::format("of points and directions {}: found only if a path happens to hit the lens; vcm finds it",
                    over(finds)));
  if (features.any_area_emitter || uneven)
    plan.note(std::string(kLuckyLight),
              fmt::format("{}: found only if a path happens to hit {}; {} finds it", over(finds),
                          features.any_area_emitter ? "a lamp" : "the bright part of the environment",
                          finds == Finds::eye_paths ? "vcm or bdpt" : "vcm"));
}

}  // namespace candela::integrators
