#include "tests/bench/candela_study/mis_job.h"

#include <fmt/format.h>
#include <time.h>

#include <cmath>
#include <filesystem>

#include "common/bundle/gather.h"
#include "common/film/delta.h"
#include "common/film/development.h"
#include "common/mis/estimators.h"
#include "common/stages/development.h"
#include "common/stages/developments/optimal_mis.h"
#include "tests/bench/candela_bench/spec.h"
#include "tests/paths.h"
#include "worker/integrators/unit_data.h"

namespace candela::study {

namespace {

double seconds_by(clockid_t clock) {
  timespec time{};
  ::clock_gettime(clock, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

double thread_seconds() {
  return seconds_by(CLOCK_THREAD_CPUTIME_ID);
}

Result<MisJob> MisJob::create(const Render& render) {
  MisJob job;
  job.render_ = render;
  const std::filesystem::path file = test::source_path(render.scene);
  CANDELA_ASSIGN(bench::RunSpec run, bench::make_run(file, bench::scene_name_of(file), render.integrator,
                                                     render.settings, render.width, render.height));
  run.job.seed = render.seed;
  run.job.sampler = render.sampler;
  const bundle::DiskSource files(file.parent_path());
  CANDELA_ASSIGN(job.renderer_, render::Renderer::create(files, file.filename(), {}, run.job, 1));
  CANDELA_ASSIGN(job.pilot_, job.renderer_->pilot({}));
  job.output_ = job.renderer_->make_output(job.pilot_.state);
  return job;
}

MisJob::Merged MisJob::empty() const {
  Merged merged{film::MergedFilm({render_.width, render_.height, 1}, pilot_.state.film_scale_log2), {}};
  for (auto& half : merged.sums)
    for (const film::AccumulatorSpec& spec : work().accumulators)
      half.emplace_back(render_.width, render_.height, spec);
  return merged;
}

Result<double> MisJob::render(std::uint64_t begin, std::uint64_t end, const std::vector<Merged*>& into) {
  double seconds = 0;
  for (const std::uint32_t half : {0U, 1U}) {
    const Unit unit{Unit::Kind::iterations, half, begin, end};
    output_.clear();
    const double start = thread_seconds();
    CANDELA_TRY(renderer_->run(unit, {pilot_.state, {}, {}}, output_, {}));
    seconds += thread_seconds() - start;
    for (const std::uint64_t rejected : output_.film->sample_counts().rejected)
      if (rejected != 0)
        return failed_error(fmt::format("{} samples of {} were rejected", rejected, render_.integrator))
            .at(render_.scene, 0);
    const std::string bytes = integrators::encode_delta({unit, {}, 0, "study", "study"}, output_);
    CANDELA_ASSIGN(const film::Delta delta,
                   film::Delta::decode(bytes, {{render_.width, render_.height, 1}, work().accumulators}));
    for (Merged* merged : into) {
      CANDELA_TRY(merged->film.merge(delta));
      for (std::size_t i = 0; i < delta.accumulators().size(); ++i)
        merged->sums[half][i].merge(delta.accumulators()[i].sums);
    }
  }
  return seconds;
}

Result<Image> MisJob::image(const Merged& merged, std::string_view estimator, double* seconds) const {
  const double start = seconds_by(CLOCK_PROCESS_CPUTIME_ID);  // rows are developed on several threads
  film::Development development;
  if (work().development) {
    const auto sums = [&](std::string_view name, std::uint32_t half) -> const film::MergedAccumulator* {
      for (const film::MergedAccumulator& a : merged.sums[half])
        if (a.spec().name == name) return &a;
      return nullptr;
    };
    CANDELA_ASSIGN(auto corrections,
                   correct({*work().development, estimator, render_.width, render_.height, sums}));
    for (std::size_t half = 0; half < 2; ++half)
      if (!corrections[half].empty())
        development.corrections[half] =
            std::make_shared<const std::vector<float>>(std::move(corrections[half]));
  }
  Image image = film::develop_image(merged.film, development);
  if (seconds != nullptr) *seconds += seconds_by(CLOCK_PROCESS_CPUTIME_ID) - start;
  return image;
}

std::vector<std::vector<float>> MisJob::slopes(const Merged& merged) const {
  if (!work().development) return {};
  std::size_t n = 1;
  while (mis::packed_size(n) < work().accumulators.at(0).channels) ++n;
  const mis::Allocation allocation = mis::Allocation::ones(n);
  std::vector<std::vector<float>> out(n);
  for (std::uint32_t y = 0; y < render_.height; ++y)
    for (std::uint32_t x = 0; x < render_.width; ++x) {
      mis::Sums sums;
      for (std::size_t half = 0; half < 2; ++half) {
        const film::MergedAccumulator &a = merged.sums[half][0], &b = merged.sums[half][1];
        for (std::uint32_t i = 0; i < mis::packed_size(n); ++i)
          sums.a[i] += std::ldexp(static_cast<double>(a.sum(x, y, i)), -a.spec().scale_log2);
        for (std::uint32_t k = 0; k < mis::kColors; ++k)
          for (std::uint32_t i = 0; i < n; ++i)
            sums.b[k][i] +=
                std::ldexp(static_cast<double>(b.sum(x, y, k * static_cast<std::uint32_t>(n) + i)),
                           -b.spec().scale_log2);
      }
      const double batches = sums.samples(allocation) / allocation.total();
      const mis::Slopes slopes = mis::solve(
          allocation, sums, mis::ridge(allocation, sums.samples(allocation), pixel_sums::kMatrixScale));
      constexpr std::size_t kGreen = 1;
      const double light =
          batches > 0
              ? (sums.balance_sum(allocation, kGreen) + mis::correction(allocation, sums, slopes)[kGreen]) /
                    batches
              : 0;
      double sum = 0;
      for (std::size_t i = 0; i < n; ++i) sum += slopes[kGreen][i];
      for (std::size_t i = 0; i < n; ++i)
        out[i].push_back(static_cast<float>(slopes[kGreen][i] + (light - sum) / static_cast<double>(n)));
    }
  return out;
}

}  // namespace candela::study
