#include "worker/integrators/bidirectional/plan.h"

#include <string_view>

#include "worker/integrators/plan_edge_content.h"
#include "worker/integrators/plan_walks.h"

namespace candela::integrators::bidirectional {

Planned plan(const estimators::PathOptions& options, const scene::SceneFeatures& f, bool full,
             Mollifies mollifies) {
  Planned planned;
  estimators::Techniques& t = planned.techniques;
  t.merge_surface = t.merge_medium = false;
  // min_edges: of the shortest path that the technique makes; paths below it cannot be had by any plan.
  const auto decide = [&](bool& technique, std::uint32_t min_edges, std::string_view name, bool pays,
                          std::string_view why, std::string_view why_not) {
    const bool possible = options.max_depth >= min_edges;
    if (full)
      technique = possible;
    else
      planned.plan.decide(technique, name, possible && pays, why, pays ? "max_depth is too small" : why_not);
  };
  note_lucky_light(f, options.max_depth, Finds::connections, mollifies, planned.plan);
  if (full) planned.plan.use("everything", "plan=full");
  const bool lit = f.emitters > 0, scatters = !f.all_bsdfs_delta || f.any_scattering_medium;
  const std::string_view why_not =
      lit ? "every surface scatters specularly: nothing can be connected" : "the scene has no emitter";
  decide(t.hit_light, 1, "light met by the eye's walk (s = 0)", f.any_area_emitter || f.any_environment,
         "there are emitters to be hit", "no ray can hit an emitter");
  decide(t.next_event, 2, "next event estimation (s = 1)", lit && scatters, "emitters can be sampled",
         why_not);
  if (t.next_event) plan_shadow_rays(f, planned.plan);
  decide(t.connect, 3, "connections of vertices (s > 1, t > 1)", lit && scatters,
         "light and eye subpaths meet in between", why_not);
  decide(t.light_image, 2, "connections to the lens (t = 1)", lit && scatters,
         "light paths scatter where the camera may see it", why_not);
  decide(t.hit_lens, 2, "light that meets the lens (t = 0)", lit && f.finite_lens, "the lens has an area",
         "the lens is a point, or infinitely far");
  t.light_paths = t.needs_light_paths();
  if (!full) planned.between = plan_edge_content(f, planned.plan);
  return planned;
}

}  // namespace candela::integrators::bidirectional
