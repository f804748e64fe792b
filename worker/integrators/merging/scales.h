// The scales that iterations merge with.
#pragma once

#include <cstdint>

#include "worker/estimators/options.h"
#include "worker/integrators/merging/rules.h"
#include "worker/transport/merge_scale.h"
#include "worker/transport/radius.h"

namespace candela::integrators::merging {

// The scale of these radii for `paths` light paths an iteration; eta as the weights of Mis want it, 0 where
// nothing is merged.
template <class Mis>
transport::MergeScale make_scale(transport::Kernel kernel, double disc, double ball, double paths,
                                 const estimators::Techniques& techniques) {
  transport::MergeFactors eta;
  if (techniques.merge_surface) eta.surface = Mis::raise(paths * transport::effective_area(kernel, disc));
  if (techniques.merge_medium) eta.medium = Mis::raise(paths * transport::effective_volume(kernel, ball));
  transport::MergeScale scale(kernel, static_cast<float>(disc), static_cast<float>(ball), eta);
  if (techniques.photons_alone()) scale.want_inner();
  return scale;
}

// The radius that range searches are built for: that of most queries.
struct SearchRadii {
  float disc, ball;
};

// One scale for the whole film, by the number of the iteration. Scales of a unit are a class like this one.
template <class Mis>
class ProgressiveScales {
 public:
  using Field = transport::ConstantScale;
  ProgressiveScales(const MergeRules& rules, double first_radius, double paths,
                    const estimators::Techniques& techniques)
      : rules_(rules), first_radius_(first_radius), paths_(paths), techniques_(techniques) {}

  // iteration: of the job.
  Field field(std::uint64_t iteration) const {
    return {make_scale<Mis>(rules_.kernel, transport::disc_radius(first_radius_, iteration, rules_.alpha),
                            transport::ball_radius(first_radius_, iteration, rules_.alpha), paths_,
                            techniques_)};
  }
  static SearchRadii search_radii(const Field& field) {
    return {field.scale.disc_radius, field.scale.ball_radius};
  }

 private:
  const MergeRules& rules_;
  double first_radius_, paths_;
  const estimators::Techniques& techniques_;
};

}  // namespace candela::integrators::merging
