#include "worker/integrators/pssmlt/mollified.h"

#include "worker/integrators/pssmlt/targets.h"

namespace candela::integrators::pssmlt {
namespace {

class MollifiedPathTarget final : public mcmc::PrimaryTarget {
 public:
  MollifiedPathTarget(const UnitContext& context, const PathOptions& options, const Techniques& techniques,
                      double bandwidth, film::SampleCounts& sample_counts)
      : scene_(context.scene),
        options_(options),
        techniques_(techniques),
        mollifier_(bandwidth),
        film_(context.filter, context.width, context.height),
        sample_counts_(sample_counts) {}

  void evaluate(mcmc::PrimaryState& numbers, mcmc::SplatList& out) override {
    mcmc::PrimarySampler& eye = numbers.walk(mcmc::PrimaryState::eye);
    const FilmRay ray = film_ray(scene_, film_, eye);
    ++sample_counts_.eye_samples;
    Spectrum mollified;
    const Spectrum value = estimators::mollified_path_radiance(
        scene_, options_, techniques_, ray.ray, eye, sample_counts_, nullptr, mollifier_, &mollified);
    const float scale = ray.weight * static_cast<float>(film_.area_over_film());
    if (out.add(ray.at, value * scale)) out.mollify(mollified * scale);
  }

 private:
  const scene::Scene& scene_;
  const PathOptions& options_;
  const Techniques& techniques_;
  const transport::Mollifier mollifier_;
  estimators::FilmDomain film_;
  film::SampleCounts& sample_counts_;
};

}  // namespace

std::unique_ptr<mcmc::PrimaryTarget> make_mollified_target(bool over_path, const UnitContext& context,
                                                           const PathOptions& options,
                                                           const Techniques& techniques, double bandwidth,
                                                           film::SampleCounts& sample_counts) {
  if (over_path)
    return std::make_unique<MollifiedPathTarget>(context, options, techniques, bandwidth, sample_counts);
  return std::make_unique<BdptTarget<transport::EdgeContent::media, true>>(context, options, techniques,
                                                                           sample_counts, bandwidth);
}

}  // namespace candela::integrators::pssmlt
