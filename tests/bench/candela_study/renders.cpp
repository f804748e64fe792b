#include "tests/bench/candela_study/renders.h"

#include <fmt/format.h>
#include <time.h>

#include <cmath>
#include <filesystem>
#include <iterator>
#include <utility>

#include "common/bundle/gather.h"
#include "common/film/film.h"
#include "tests/bench/candela_bench/spec.h"
#include "tests/epoch_run.h"
#include "tests/paths.h"
#include "worker/render/renderer.h"

namespace candela::study {

namespace {

double cpu_now() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace

Result<Rendered> render_job(const Render& render, const std::vector<std::uint64_t>& counts) {
  const std::filesystem::path file = test::source_path(render.scene);
  CANDELA_ASSIGN(bench::RunSpec run, bench::make_run(file, bench::scene_name_of(file), render.integrator,
                                                     render.settings, render.width, render.height));
  run.job.seed = render.seed;
  run.job.sampler = render.sampler;
  const bundle::DiskSource files(file.parent_path());
  CANDELA_ASSIGN(const auto renderer, render::Renderer::create(files, file.filename(), render.parameters,
                                                               run.job, render.threads));
  render::RunContext context;
  context.threads = render.threads;
  CANDELA_ASSIGN(const PilotResult pilot, renderer->pilot(context));
  if (pilot.work.chains) return internal_error(render.integrator + " has no iterations");
  test::EpochRun epochs(*renderer, pilot);
  render::UnitOutput output = renderer->make_output(pilot.state);

  const std::size_t values = output.film->layout().pixel_count() * 3;
  std::vector<double> sums(values * output.film->layout().layers);
  Rendered rendered;
  std::uint64_t done = 0;
  double seconds = 0;
  for (const std::uint64_t count : counts) {
    for (const Unit& unit : epochs.units(done, count)) {
      output.clear();
      CANDELA_ASSIGN(const render::UnitInput input, epochs.input(unit));
      const double start = cpu_now();
      CANDELA_TRY(renderer->run(unit, input, output, context));
      seconds += cpu_now() - start;
      CANDELA_TRY(epochs.add(unit, output));
      for (const std::uint64_t rejected : output.film->sample_counts().rejected)
        if (rejected != 0)
          return failed_error(fmt::format("{} samples of {} were rejected", rejected, render.integrator))
              .at(file, 0);
      for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += static_cast<double>(output.film->sums()[i]);
    }
    done = count;
    rendered.cpu_seconds.push_back(seconds);
    const double to_value = std::ldexp(1.0, -output.film->scale_log2()) / static_cast<double>(count);
    std::vector<Image> layers(output.film->layout().layers);
    for (std::size_t i = 0; i < sums.size(); ++i)
      layers[i / values].push_back(static_cast<float>(sums[i] * to_value));
    rendered.images.push_back(std::move(layers[0]));
    rendered.layers.assign(std::make_move_iterator(layers.begin() + 1),
                           std::make_move_iterator(layers.end()));
  }
  CANDELA_ASSIGN(rendered.report, epochs.describe(true));
  return rendered;
}

Result<std::vector<Image>> render_images(const Render& render, const std::vector<std::uint64_t>& counts) {
  CANDELA_ASSIGN(Rendered rendered, render_job(render, counts));
  return std::move(rendered.images);
}

}  // namespace candela::study
