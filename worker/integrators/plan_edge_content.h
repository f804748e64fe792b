// Content of the edges of a scene's paths (between two vertices): the choice of the kernel's form, and its
// lines in the plan, the same for every integrator.
#pragma once

#include <string>
#include <type_traits>

#include "worker/integrators/plan.h"
#include "worker/scene/features.h"
#include "worker/transport/between.h"

namespace candela::integrators {

// media: what is done where there are any. with_letters: layers by light path expressions are written by the
// form for media alone (docs/decisions/085), if they are asked for; the path tracer has forms of its own.
inline transport::EdgeContent plan_edge_content(const scene::SceneFeatures& features, Plan& plan,
                                                const std::string& media = "free flights and transmittance",
                                                bool with_letters = true) {
  if (features.any_passthrough)
    plan.use("light through surfaces straight on", "some surface is null, a mask or thin glass");
  else
    plan.skip("light through surfaces straight on", "no surface lets light pass straight");
  if (features.media > 0)
    plan.use("media", media);
  else
    plan.skip("media", "there is none");
  return features.media > 0 || (with_letters && features.reads_letters) ? transport::EdgeContent::media
         : features.any_passthrough                                     ? transport::EdgeContent::surfaces
                                                                        : transport::EdgeContent::nothing;
}

// Calls f with the form as a compile-time constant: std::integral_constant<EdgeContent, ...>.
template <class F>
decltype(auto) with_edge_content(transport::EdgeContent between, F&& f) {
  using transport::EdgeContent;
  switch (between) {
    case EdgeContent::nothing:
      return f(std::integral_constant<EdgeContent, EdgeContent::nothing>());
    case EdgeContent::surfaces:
      return f(std::integral_constant<EdgeContent, EdgeContent::surfaces>());
    case EdgeContent::media:
      break;
  }
  return f(std::integral_constant<EdgeContent, EdgeContent::media>());
}

}  // namespace candela::integrators
