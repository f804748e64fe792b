#include "worker/integrators/vcm/plan.h"

#include "worker/integrators/plan_between.h"
#include "worker/integrators/plan_walks.h"

namespace candela::integrators::vcm {
namespace {

// Turns a technique off, and says why; one that is off already is not spoken of.
void skip(bool& technique, Plan& plan, const char* name, const char* reason) {
  if (!technique) return;
  technique = false;
  plan.skip(name, reason);
}

void use(bool technique, Plan& plan, const char* name, const char* reason) {
  if (technique) plan.use(name, reason);
}

constexpr const char* kSpecular = "every surface scatters specularly: only chance leads there";

}  // namespace

Planned make_plan(const estimators::Techniques& wanted, const estimators::PathOptions& options, bool full,
                  const scene::SceneFeatures& features) {
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

  if (!features.any_area_emitter && !features.any_environment)
    skip(t.hit_light, plan, "light met by eye paths", "no emitter has an area, and there is no environment");
  use(t.hit_light, plan, "light met by eye paths", "area emitters or an environment");

  const bool no_vertices = features.all_bsdfs_delta && !features.any_scattering_medium;
  const bool connects = t.next_event || t.connect || t.light_image;
  if (no_vertices) {
    skip(t.next_event, plan, "next event estimation", kSpecular);
    skip(t.connect, plan, "connections", kSpecular);
    skip(t.light_image, plan, "connections to the lens",
         "every surface scatters specularly: no vertex sees it");
    skip(t.merge_surface, plan, "merging", kSpecular);
    skip(t.merge_medium, plan, "merging in media", kSpecular);
  }
  use(t.next_event, plan, "next event estimation",
      "emitters can be sampled from vertices that are not specular");
  use(t.connect, plan, "connections", "of the eye path's vertices to those of a light path");
  use(t.light_image, plan, "connections to the lens", "light paths scatter where the camera may see it");

  // Merging finds light that connections cannot, through specular vertices, or do not well, through glossy
  // ones. All other paths connections make with less noise, and without bias.
  if (features.all_bsdfs_delta)
    skip(t.merge_surface, plan, "merging on surfaces", kSpecular);
  else if (connects && !features.any_delta_bsdf && !features.any_rough_glossy)
    skip(t.merge_surface, plan, "merging on surfaces",
         "nothing glossy or specular can hide a light from connections: bidirectional path tracing is left");
  use(t.merge_surface, plan, "merging on surfaces",
      connects ? "something glossy or specular may hide a light from connections"
               : "the only way light paths are used");
  if (!features.any_scattering_medium)
    skip(t.merge_medium, plan, "merging in media", "no medium scatters");
  else if (!t.merge_medium && connects)
    plan.skip("merging in media", "merge_media is false: connections find light in media");
  use(t.merge_medium, plan, "merging in media", "there are media that scatter");

  if (!features.finite_lens)
    skip(t.hit_lens, plan, "light that meets the lens", "the lens is a point, or infinitely far");
  use(t.hit_lens, plan, "light that meets the lens", "the lens has an area");

  t.light_paths = t.needs_light_paths();
  if (!t.light_paths) plan.skip("light paths", "no technique needs them");
  planned.between = plan_between(features, plan);
  return planned;
}

}  // namespace candela::integrators::vcm
