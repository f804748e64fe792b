// Costs of one delta: bytes on the wire, CPU time of the worker to encode it, CPU time of the master to
// verify, decode and merge it, for a film of a real scene.
//
//   bench_delta_cost SCENE.xml [WIDTH HEIGHT [ITERATIONS...]]        default 1920 1080 1 4 16
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include "common/base/hash.h"
#include "common/bundle/gather.h"
#include "common/film/delta.h"
#include "tests/bench/count_argument.h"
#include "tests/bench/thread_time.h"
#include "worker/render/renderer.h"

namespace {

using namespace candela;
using bench::thread_cpu_seconds;

int fail(const std::string& message) {
  std::fprintf(stderr, "bench_delta_cost: %s\n", message.c_str());
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return fail("usage: SCENE.xml [WIDTH HEIGHT [ITERATIONS...]]");
  const std::filesystem::path scene_path = argv[1];
  JobSettings settings;
  if (argc == 3) return fail("a width wants a height");
  settings.width = static_cast<std::uint32_t>(bench::count_argument("WIDTH", argc, argv, 2, 1920, 65536));
  settings.height = static_cast<std::uint32_t>(bench::count_argument("HEIGHT", argc, argv, 3, 1080, 65536));
  std::vector<std::uint64_t> counts;
  for (int i = 4; i < argc; ++i) counts.push_back(bench::count_argument("ITERATIONS", argv[i], 1, 1e9));
  if (counts.empty()) counts = {1, 4, 16};

  auto complete = render::complete_integrator_settings("path", {{"max_depth", "8"}}, {});
  if (!complete.ok()) return fail(complete.error().to_string());
  settings.integrator_settings = *complete;
  const bundle::DiskSource files(scene_path.parent_path().empty() ? "." : scene_path.parent_path());
  const auto renderer = render::Renderer::create(files, scene_path.filename(), {}, settings, 2);
  if (!renderer.ok()) return fail(renderer.error().to_string());
  render::RunContext run;
  run.threads = 2;
  const auto pilot = (*renderer)->pilot(run);
  if (!pilot.ok()) return fail(pilot.error().to_string());
  auto output = (*renderer)->make_output(pilot->state);
  const auto& film = output.film;
  for (std::uint64_t count : counts) {
    film->clear();
    const auto done =
        (*renderer)->run({Unit::Kind::iterations, 0, 0, count}, {pilot->state, {}, {}}, output, run);
    if (!done.ok()) return fail(done.error().to_string());
    film::DeltaInfo info;
    info.unit = {Unit::Kind::iterations, 0, 0, count};
    info.layout = film->layout();
    info.scale_log2 = film->scale_log2();
    info.job_id = "bench";
    info.build_id = "bench";
    const double t0 = thread_cpu_seconds();
    const std::string bytes = film::encode_delta(*film, info);
    const double t1 = thread_cpu_seconds();
    film::MergedFilm merged(film->layout(), film->scale_log2());
    // A first merge allocates; the second is what every later one costs.
    double hash = 0, decode = 0, merge = 0;
    for (std::uint64_t repeat = 0; repeat < 4; ++repeat) {
      film->clear();
      info.unit = {Unit::Kind::iterations, 0, repeat * count, (repeat + 1) * count};
      const auto again = (*renderer)->run(info.unit, {pilot->state, {}, {}}, output, run);
      if (!again.ok()) return fail(again.error().to_string());
      const std::string next = film::encode_delta(*film, info);
      const double t2 = thread_cpu_seconds();
      const std::string digest = sha256_hex(next);
      const double t3 = thread_cpu_seconds();
      const auto delta = film::Delta::decode(next, film->layout());
      const double t4 = thread_cpu_seconds();
      if (!delta.ok()) return fail(delta.error().to_string());
      const auto ok = merged.merge(*delta);
      if (!ok.ok()) return fail(ok.error().to_string());
      hash = t3 - t2;
      decode = t4 - t3;
      merge = thread_cpu_seconds() - t4;
    }
    const double values = static_cast<double>(film->layout().pixel_count()) * 3;
    std::printf(
        "%ux%u, %llu iterations: %.2f MB (%.2f bytes a value), worker encode %.1f ms, master sha256 %.1f ms "
        "+ decode %.1f "
        "ms + merge %.1f ms\n",
        settings.width, settings.height, static_cast<unsigned long long>(count),
        static_cast<double>(bytes.size()) * 1e-6, static_cast<double>(bytes.size()) / values, (t1 - t0) * 1e3,
        hash * 1e3, decode * 1e3, merge * 1e3);
  }
  return 0;
}
