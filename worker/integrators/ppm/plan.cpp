#include "worker/integrators/ppm/plan.h"

#include "worker/integrators/plan_edge_content.h"
#include "worker/integrators/plan_walks.h"

namespace candela::integrators::ppm {

Planned plan(const estimators::PathOptions& options, bool caustics_only, const scene::SceneFeatures& features,
             bool full) {
  Planned planned;
  Plan& plan = planned.plan;
  estimators::Techniques& t = planned.techniques;
  t = estimators::Techniques::none();
  if (options.max_depth < 1 || features.emitters == 0) {
    plan.skip("everything",
              features.emitters == 0 ? "the scene has no emitter" : "max_depth 0 is a black image");
    return planned;
  }
  t.eye_paths = true;
  t.hit_light = !caustics_only;
  if (options.max_depth < 2) {
    plan.skip("photons", "max_depth shows emitters only");
    return planned;
  }
  if (caustics_only && !features.any_delta_bsdf) {
    t = estimators::Techniques::none();
    plan.skip("everything", "no surface is specular: there are no caustics");
    return planned;
  }
  t.merge_surface = t.merge_medium = t.light_paths = true;
  note_lasting_media(features, options.max_depth, options.rr_depth, plan);
  if (full) {
    plan.use("everything", "plan=full");
    return planned;
  }
  if (caustics_only) {
    plan.skip("photons that no specular vertex sent", "photons=caustics");
    plan.skip("light met by eye paths", "photons=caustics");
  }
  plan.decide(t.hit_light, "light met by eye paths", features.any_area_emitter || features.any_environment,
              "seen directly, or by specular reflection or refraction",
              "no emitter has an area, and there is no environment");
  plan.decide(t.merge_surface, "photons on surfaces", !features.all_bsdfs_delta,
              "some surface is not specular", "every surface scatters specularly");
  plan.decide(t.merge_medium, "photons in media", features.any_scattering_medium,
              "there are media that scatter", "no medium scatters");
  t.light_paths = t.merges();
  planned.between = plan_edge_content(features, plan, "free flights");
  return planned;
}

}  // namespace candela::integrators::ppm
