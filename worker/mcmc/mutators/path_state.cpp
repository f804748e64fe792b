#include "worker/mcmc/mutators/path_state.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "worker/core/recycling_allocator.h"

namespace candela::mcmc {

std::optional<PathState> path_state(const scene::Scene& scene, transport::path::Path path,
                                    const transport::path::Rules& rules, const PathState* near,
                                    const transport::path::FoundSurfaces* met) {
  PathState out;
  transport::path::SharedVertices shared;
  if (near != nullptr) shared = transport::path::shared_vertices(near->assembled(), near->path, path);
  out.stands_on_ = std::allocate_shared<PathState::StandsOn>(RecyclingAllocator<PathState::StandsOn>());
  transport::path::Assembled& assembled = out.stands_on_->assembled;
  if (!transport::path::assemble_into(assembled, scene, path, rules.film_border, shared, met))
    return std::nullopt;
  const bool mollified =
      std::ranges::any_of(path.vertices, [](const auto& vertex) { return vertex.mollified; });
  if (near != nullptr && near->mollified)  // copied
    for (transport::path::InnerVertex& inner : assembled.path.inner) inner.cone = {};
  if (mollified) {
    const auto found = transport::path::mollified_vertex(scene, path, assembled.edges);
    if (!found || !(rules.bandwidth > 0)) return std::nullopt;
    assembled.path.inner[found->vertex - 1].cone = found->cone;
    out.mollified = *found;
  }
  transport::path::SharedEnds ends;
  if (near != nullptr) ends = {&near->evaluation(), shared.light, shared.sensor};
  out.shared_light = shared.light;
  out.stands_on_->evaluation.emplace(scene, assembled.path, rules, ends, transport::path::Wanted::if_lit);
  const transport::path::Evaluation& evaluation = out.evaluation();
  if (!evaluation.valid() || !evaluation.media_agree() || !evaluation.closed_form()) return std::nullopt;
  out.contribution = evaluation.contribution_values();
  // As luminance() of vec.h has it.
  out.scalar =
      0.212671 * out.contribution[0] + 0.715160 * out.contribution[1] + 0.072169 * out.contribution[2];
  if (!(out.scalar > 0) || !std::isfinite(out.scalar)) return std::nullopt;
  out.path = std::move(path);
  return out;
}

}  // namespace candela::mcmc
