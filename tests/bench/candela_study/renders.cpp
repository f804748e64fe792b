#include "tests/bench/candela_study/renders.h"

#include "tests/bench/candela_bench/estimator.h"

namespace candela::study {

Result<std::vector<Image>> render_images(const Render& render, const std::vector<std::uint64_t>& counts) {
  const std::string file = CANDELA_SOURCE_DIR "/" + render.scene;
  CANDELA_ASSIGN(bench::RunSpec run, bench::make_run(file, bench::scene_name_of(file), render.integrator,
                                                     render.settings, render.width, render.height));
  run.job.seed = render.seed;
  run.job.sampler = render.sampler;
  run.threads = render.threads;
  CANDELA_ASSIGN(const auto estimator, bench::make_render_estimator(run));
  std::vector<Image> images;
  for (const std::uint64_t count : counts) {
    CANDELA_TRY(estimator->advance(count));
    CANDELA_ASSIGN(bench::Snapshot snapshot, estimator->snapshot());
    images.push_back(std::move(snapshot.image));
  }
  return images;
}

}  // namespace candela::study
