#include "worker/integrators/vcm/plan.h"

#include "worker/integrators/plan_edge_content.h"
#include "worker/integrators/plan_walks.h"

namespace candela::integrators::vcm {
namespace {

constexpr const char* kSpecular = "every surface scatters specularly: only chance leads there";

}  // namespace

Planned plan(const estimators::PathOptions& options, const estimators::Techniques& wanted,
             const scene::SceneFeatures& features, bool full) {
  Planned planned;
  estimators::Techniques& t = planned.techniques;
  Plan& plan = planned.plan;
  t = wanted;
  if (options.max_depth < 1) {
    t = estimators::Techniques::none();
    plan.skip("everything", "max_depth 0 is a black image");
    return planned;
  }
  if (features.emitters == 0) {
    t = estimators::Techniques::none();
    plan.skip("everything", "the scene has no emitter");
    return planned;
  }
  if (options.max_depth < 2) {
    t = estimators::Techniques::none();
    t.eye_paths = t.hit_light = true;
    plan.skip("all but light seen directly", "max_depth shows emitters only");
    return planned;
  }
  if (options.max_depth < 3) t.connect = false;
  note_lasting_media(features, options.max_depth, options.rr_depth, plan);
  if (full) {
    plan.use("everything", "plan=full");
    t.light_paths = t.needs_light_paths();
    return planned;
  }

  plan.decide(t.hit_light, "light met by eye paths", features.any_area_emitter || features.any_environment,
              "area emitters or an environment", "no emitter has an area, and there is no environment");
  const bool scatters = !features.all_bsdfs_delta || features.any_scattering_medium;
  const bool connects = t.next_event || t.connect || t.light_image;
  plan.decide(t.next_event, "next event estimation", scatters,
              "emitters can be sampled from vertices that are not specular", kSpecular);
  if (t.next_event) plan_shadow_rays(features, plan);
  plan.decide(t.connect, "connections", scatters, "of the eye path's vertices to those of a light path",
              kSpecular);
  plan.decide(t.light_image, "connections to the lens", scatters,
              "light paths scatter where the camera may see it",
              "every surface scatters specularly: no vertex sees it");
  if (!scatters) {
    plan.decide(t.merge_surface, "merging", false, "", kSpecular);
    plan.decide(t.merge_medium, "merging in media", false, "", kSpecular);
  }
  // Merging finds light that connections cannot, through specular vertices, or do not well, through glossy
  // ones. All other paths connections make with less noise, and without bias.
  const bool hidden_light = features.any_delta_bsdf || features.any_rough_glossy;
  plan.decide(t.merge_surface, "merging on surfaces",
              !features.all_bsdfs_delta && (!connects || hidden_light),
              connects ? "something glossy or specular may hide a light from connections"
                       : "the only way light paths are used",
              features.all_bsdfs_delta ? kSpecular
                                       : "nothing glossy or specular can hide a light from connections: "
                                         "bidirectional path tracing is left");
  if (features.any_scattering_medium && !t.merge_medium && connects)
    plan.skip("merging in media", "merge_media is false: connections find light in media");
  plan.decide(t.merge_medium, "merging in media", features.any_scattering_medium,
              "there are media that scatter", "no medium scatters");
  plan.decide(t.hit_lens, "light that meets the lens", features.finite_lens, "the lens has an area",
              "the lens is a point, or infinitely far");

  t.light_paths = t.needs_light_paths();
  if (!t.light_paths) plan.skip("light paths", "no technique needs them");
  planned.between = plan_edge_content(features, plan);
  return planned;
}

}  // namespace candela::integrators::vcm
