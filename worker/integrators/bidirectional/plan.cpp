#include "worker/integrators/bidirectional/plan.h"

#include <string_view>

#include "worker/integrators/plan_between.h"

namespace candela::integrators::bidirectional {

Planned plan(const estimators::PathOptions& options, const scene::SceneFeatures& f, bool full, Plan& plan) {
  Planned planned;
  estimators::Techniques& t = planned.techniques;
  // What cannot be run at all, whatever is asked for.
  if (options.max_depth < 2) t.next_event = t.light_image = t.hit_lens = false;
  if (options.max_depth < 3) t.connect = false;
  if (options.max_depth < 1) t.hit_light = false;
  const auto finish = [&] { t.light_paths = t.connect || t.light_image || t.hit_lens; };
  if (full) {
    plan.use("everything", "plan=full");
    finish();
    return planned;
  }
  const auto decide = [&](bool& technique, std::string_view name, bool pays, std::string_view why,
                          std::string_view why_not) {
    technique = technique && pays;
    if (technique)
      plan.use(std::string(name), std::string(why));
    else
      plan.skip(std::string(name), pays ? "max_depth is too small" : std::string(why_not));
  };
  const bool scatters = !f.all_bsdfs_delta || f.any_scattering_medium;
  const bool lit = f.emitters > 0;
  const std::string_view specular = "every surface scatters specularly: nothing can be connected";
  const std::string_view why_not = lit ? specular : "the scene has no emitter";
  decide(t.hit_light, "light met by the eye's walk (s = 0)", f.any_area_emitter || f.any_environment,
         "there are emitters to be hit", "no ray can hit an emitter");
  decide(t.next_event, "next event estimation (s = 1)", lit && scatters, "emitters can be sampled", why_not);
  decide(t.connect, "connections of vertices (s > 1, t > 1)", lit && scatters,
         "light and eye subpaths meet in between", why_not);
  decide(t.light_image, "connections to the lens (t = 1)", lit && scatters,
         "light paths scatter where the camera may see it", why_not);
  decide(t.hit_lens, "light that meets the lens (t = 0)", lit && f.finite_lens, "the lens has an area",
         "the lens is a point, or infinitely far");
  planned.between = plan_between(f, plan);
  finish();
  return planned;
}

}  // namespace candela::integrators::bidirectional
