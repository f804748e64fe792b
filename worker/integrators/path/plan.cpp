#include "worker/integrators/path/plan.h"

#include <fmt/format.h>

#include "worker/integrators/plan_edge_content.h"
#include "worker/integrators/plan_walks.h"

namespace candela::integrators::path {

bool ray_a_group(const scene::SceneFeatures& features) {
  constexpr float kUneven = 1;  // below that, scattered rays find the environment well enough
  return features.any_environment && !features.endless_medium && features.environment_variation >= kUneven &&
         features.emitters > features.infinite_emitters;
}

Planned plan(const estimators::PathOptions& options, const scene::SceneFeatures& features, bool full,
             bool rays_a_group, Mollifies mollifies) {
  Planned planned;
  Plan& plan = planned.plan;
  estimators::Techniques& techniques = planned.techniques;
  techniques = estimators::Techniques::none();
  techniques.eye_paths = techniques.next_event = techniques.hit_light = true;
  note_lucky_light(features, options.max_depth, Finds::eye_paths, mollifies, plan);
  if (full) {
    plan.use("everything", "plan=full");
    return planned;
  }
  const bool bounces = options.max_depth >= 2;
  const bool scatters = !features.all_bsdfs_delta || features.any_scattering_medium;
  plan.decide(
      techniques.next_event, "next event estimation", bounces && features.emitters > 0 && scatters,
      features.any_scattering_medium ? "emitters can be sampled from points in media and from surfaces"
                                     : "emitters can be sampled from surfaces that are not specular",
      !bounces                 ? "max_depth shows emitters only"
      : features.emitters == 0 ? "the scene has no emitter"
                               : "every surface scatters specularly: no sampled light direction can matter");

  if (techniques.next_event && rays_a_group)
    plan.use(
        "a shadow ray to lamps and one to the environment",
        fmt::format("the environment is uneven (relative variance {:.2g}): neither finds the other's light",
                    static_cast<double>(features.environment_variation)));
  else if (techniques.next_event)
    plan_shadow_rays(features, plan);

  techniques.hit_light = features.any_area_emitter || features.any_environment;
  if (features.any_area_emitter)
    plan.use("light found by bsdf sampling", "area emitters can be hit");
  else
    plan.skip("light found by bsdf sampling on surfaces", "no surface emits");

  if (features.any_environment)
    plan.use("light from outside the scene", "there is an environment");
  else
    plan.skip("light from outside the scene", "no environment");

  if (techniques.next_event && techniques.hit_light)
    plan.use("multiple importance sampling", "both techniques can find the same light");
  else
    plan.skip("multiple importance sampling", techniques.next_event
                                                  ? "only point-like emitters: bsdf sampling cannot find them"
                                                  : "one technique finds all the light there is");

  planned.between =
      plan_edge_content(features, plan,
                        features.any_heterogeneous_medium
                            ? "free flights by delta tracking, transmittance by residual ratio tracking"
                            : "homogeneous: free flights and transmittance in closed form",
                        false);
  return planned;
}

}  // namespace candela::integrators::path
