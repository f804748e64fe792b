#include "worker/integrators/upbp/scales.h"

#include <algorithm>
#include <limits>

#include "worker/integrators/merging/first_radius.h"
#include "worker/integrators/merging/scales.h"
#include "worker/transport/radius.h"

namespace candela::integrators::upbp {
namespace {

transport::MediumRadii medium_radii(const MediumRules& rules, const scene::Scene& scene,
                                    const scene::Medium& medium, double first, std::uint64_t iteration) {
  const auto densest = static_cast<double>(medium.max_sigma_t().max_component());
  const double most =
      rules.free_paths > 0 && densest > 0 ? rules.free_paths / densest : std::numeric_limits<double>::max();
  const auto radius = [&](double fraction, int dimension) {
    const double chosen = fraction > 0 ? fraction * static_cast<double>(scene.features().radius) : first;
    return merging::clamped_radius(transport::blur_radius(std::min(chosen, most), iteration, dimension));
  };
  return {radius(rules.radius_pp3d, 3), radius(rules.radius_pb2d, 2), radius(rules.radius_bp2d, 2),
          radius(rules.radius_bb1d, 1)};
}

// beam_paths: the expected number of those that leave beams.
transport::MediumMerges medium_eta(const MediumRules& rules, const scene::Medium& medium,
                                   transport::Kernel kernel, const transport::MediumRadii& radii,
                                   double paths, double beam_paths) {
  transport::MediumMerges eta;
  eta.long_photon_beams = rules.long_photon_beams && medium.homogeneous();
  eta.long_query_beams = rules.long_query_beams && medium.homogeneous();
  if (rules.pp3d) eta.point_point = paths * transport::effective_volume(kernel, radii.point_point);
  if (rules.pb2d) eta.point_beam = paths * transport::effective_area(kernel, radii.point_beam);
  if (rules.bp2d) eta.beam_point = beam_paths * transport::effective_area(kernel, radii.beam_point);
  if (rules.bb1d) eta.beam_beam = beam_paths * transport::effective_length(kernel, radii.beam_beam);
  return eta;
}

}  // namespace

IterationScales iteration_scales(const MediumRules& rules, const merging::MergeRules& merge,
                                 const estimators::Techniques& techniques, const scene::Scene& scene,
                                 double first, std::uint64_t iteration, double paths, double beam_paths,
                                 const ExpectedHits& hits) {
  const double disc = transport::disc_radius(first, iteration, merge.alpha);
  IterationScales scales{
      {merging::make_scale<transport::BeamBalance>(merge.kernel, disc, disc, paths, techniques)},
      {},
      {},
      {},
      {}};
  scales.surfaces.scale.eta.medium = 1;
  const double first_in_media =
      merge.is_automatic() ? merging::kFallbackFraction * static_cast<double>(scene.features().radius)
                           : first;
  const ExpectedHits expected = hits.in(iteration);
  for (std::uint32_t m = 0; m < scene.features().media; ++m) {
    const scene::Medium& medium = scene.medium(m);
    const transport::MediumRadii radii = medium_radii(rules, scene, medium, first_in_media, iteration);
    scales.kernels.emplace_back(merge.kernel, radii);
    scales.eta.push_back(medium_eta(rules, medium, merge.kernel, radii, paths, beam_paths));
    expected.divide(scales.eta.back());
    scales.ball_radii.push_back(static_cast<float>(radii.point_point));
    scales.beam_radii.push_back(
        static_cast<float>(std::max(rules.bp2d ? radii.beam_point : 0, rules.bb1d ? radii.beam_beam : 0)));
  }
  return scales;
}

}  // namespace candela::integrators::upbp
