#include "tests/bench/candela_bench/coverage_cases.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>

#include "common/base/files.h"
#include "common/job/effort.h"
#include "common/stats/error_context.h"
#include "tests/bench/candela_bench/estimator.h"
#include "tests/integrators.h"
#include "tests/paths.h"
#include "tests/statistical/transport_scenes.h"
#include "worker/render/renderer.h"

namespace candela::bench {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kMagic = "CANHALF5";
constexpr std::uint64_t kFileLimitBytes = 1ULL << 32;

std::vector<std::string> all_but_light() {
  return test::integrators_where([](const test::IntegratorRow& row) { return row.name != "light"; });
}

CoverageScene transport(std::string_view name, bool held_out, std::string reference = "bdpt") {
  CoverageScene scene;
  scene.name = name;
  scene.file = test::source_path(fmt::format("tests/statistical/transport/{}.xml", name));
  scene.held_out = held_out;
  scene.reference = std::move(reference);
  for (const statistical::TransportScene& row : statistical::kTransportScenes)
    if (row.name == name)
      scene.integrators = test::integrators_where([&](const test::IntegratorRow& integrator) {
        // Chains are over bdpt.
        const unsigned bit =
            integrator.chains ? statistical::kBdpt : statistical::transport_bit(integrator.name);
        return (row.complete & bit) != 0;
      });
  return scene;
}

CoverageScene file(std::string name, fs::path file, bool held_out, std::string reference = "bdpt") {
  CoverageScene scene;
  scene.name = std::move(name);
  scene.file = std::move(file);
  scene.held_out = held_out;
  scene.integrators = all_but_light();
  scene.reference = std::move(reference);
  return scene;
}

template <class T>
void put(std::string& out, const T& value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}
void put(std::string& out, const std::vector<float>& values) {
  put(out, std::uint64_t{values.size()});
  out.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(float));
}

struct FileReader {
  std::string_view bytes;
  bool ok = true;
  template <class T>
  T get() {
    T value{};
    if (bytes.size() < sizeof value) {
      ok = false;
      return value;
    }
    std::memcpy(&value, bytes.data(), sizeof value);
    bytes.remove_prefix(sizeof value);
    return value;
  }
  std::vector<float> floats() {
    const auto count = get<std::uint64_t>();
    if (!ok || count > bytes.size() / sizeof(float)) {
      ok = false;
      return {};
    }
    std::vector<float> values(count);
    std::memcpy(values.data(), bytes.data(), count * sizeof(float));
    bytes.remove_prefix(count * sizeof(float));
    return values;
  }
};

std::string encode(const std::vector<CoveragePoint>& points) {
  std::string out(kMagic);
  for (const CoveragePoint& point : points) {
    const stats::HalfImages& h = point.halves;
    put(out, point.spp);
    put(out, point.alpha);
    put(out, point.expected_bias);
    put(out, std::uint64_t{point.connects});
    put(out, h.width);
    put(out, h.height);
    put(out, h.n0);
    put(out, h.n1);
    put(out, std::uint64_t{h.chains});
    put(out, h.factor_variance);
    put(out, h.a);
    put(out, h.b);
    put(out, h.scaled);
    put(out, point.measured.a);
    put(out, point.measured.b);
  }
  return out;
}

std::optional<std::vector<CoveragePoint>> decode(std::string_view bytes) {
  if (!bytes.starts_with(kMagic)) return std::nullopt;
  FileReader reader{bytes.substr(kMagic.size())};
  std::vector<CoveragePoint> points;
  while (reader.ok && !reader.bytes.empty()) {
    CoveragePoint& point = points.emplace_back();
    point.spp = reader.get<std::uint64_t>();
    point.alpha = reader.get<double>();
    point.expected_bias = reader.get<double>();
    point.connects = reader.get<std::uint64_t>() != 0;
    stats::HalfImages& h = point.halves;
    h.width = reader.get<std::uint32_t>();
    h.height = reader.get<std::uint32_t>();
    h.n0 = reader.get<double>();
    h.n1 = reader.get<double>();
    h.chains = reader.get<std::uint64_t>() != 0;
    h.factor_variance = reader.get<double>();
    h.a = reader.floats();
    h.b = reader.floats();
    h.scaled = reader.floats();
    point.measured.a = reader.floats();
    point.measured.b = reader.floats();
  }
  if (!reader.ok) return std::nullopt;
  return points;
}

Result<CoveragePoint> point_of(Estimator& estimator, const RunSpec& run, std::uint64_t spp,
                               std::uint64_t units) {
  CANDELA_ASSIGN(const Cost cost, estimator.advance(units));
  (void)cost;
  CANDELA_ASSIGN(stats::HalfImages halves, estimator.halves());
  const stats::ErrorContext context = stats::context_of(run.job.integrator_settings, estimator.plan());
  return CoveragePoint{spp,
                       context.alpha,
                       context.expected_bias,
                       context.connects,
                       std::move(halves),
                       estimator.measured_bias()};
}

Result<std::vector<CoveragePoint>> render(const CoverageScene& scene, const std::string& integrator,
                                          std::uint64_t seed, std::uint32_t side,
                                          const std::vector<std::uint64_t>& spp) {
  std::vector<CoveragePoint> points;
  if (test::has_chains(integrator)) {
    for (const std::uint64_t samples : spp) {
      const std::uint64_t pixels = std::uint64_t{side} * side;
      CANDELA_ASSIGN(const SettingsMap given,
                     render::integrator_settings_of_effort(integrator, effort_of(samples, {}, pixels, 1)));
      CANDELA_ASSIGN(RunSpec run, make_run(scene.file, scene.name, integrator, given, side, side));
      run.job.seed = seed;
      const auto number = [&](const char* name) { return std::stoull(run.job.integrator_settings.at(name)); };
      const std::uint64_t rounds = (samples + number("mutations") - 1) / number("mutations");
      CANDELA_ASSIGN(const auto estimator, make_render_estimator(run));
      CANDELA_ASSIGN(CoveragePoint point, point_of(*estimator, run, samples, rounds * number("chains")));
      points.push_back(std::move(point));
    }
    return points;
  }
  CANDELA_ASSIGN(RunSpec run, make_run(scene.file, scene.name, integrator, {}, side, side));
  run.job.seed = seed;
  CANDELA_ASSIGN(const auto estimator, make_render_estimator(run));
  for (const std::uint64_t samples : spp) {
    CANDELA_ASSIGN(CoveragePoint point, point_of(*estimator, run, samples, samples));
    points.push_back(std::move(point));
  }
  return points;
}

}  // namespace

bool held_out(const CoverageScene& scene, const std::string& integrator) {
  return scene.held_out && std::ranges::find(scene.looked_at, integrator) == scene.looked_at.end();
}

std::vector<CoverageScene> coverage_scenes() {
  const fs::path shared = test::shared_path() / "scenes";
  const auto deploy = [](const char* name) {
    return test::source_path(fmt::format("deploy/scenes/{}/scene.xml", name));
  };
  const auto study = [](const char* name) {
    return test::source_path(fmt::format("tests/bench/candela_study/scenes/{}.xml", name));
  };
  std::vector<CoverageScene> scenes = {
      // Chosen by.
      transport("box-diffuse", false),
      transport("caustic", false),
      transport("rough-glass", false),
      transport("fog-glass", false),
      transport("many-lamps", false, "path"),
      transport("point-caustic", false, "vcm"),
      file("cornell", deploy("cornell"), false),
      file("furnace", deploy("furnace"), false),
      file("edge", study("edge"), false, "path"),
      file("veach-mis", shared / "veach-mis/scene.xml", false, "path"),
      // Held out.
      transport("sds", true),
      transport("mirror-glossy", true),
      transport("envmap", true, "path"),
      transport("hidden-caustic", true),
      transport("fog-thin", true),
      transport("mirror-room", true),
      file("studio", deploy("studio"), true),
      file("lamp-over-plane", deploy("lamp-over-plane"), true, "path"),
      file("curvature", study("curvature"), true, "path"),
      file("veach-bidir", shared / "veach-bidir/scene.xml", true),
  };
  for (CoverageScene& scene : scenes) {
    if (scene.name == "furnace") scene.exact = 1;
    if (scene.name == "veach-bidir")
      scene.looked_at = {"ppm", "bpm", "fppm", "cppm", "appm", "mcppm", "vcmplus"};
    if (scene.name == "mirror-room") scene.looked_at = {"pssmlt", "mmlt", "mlt"};
  }
  std::erase_if(scenes, [](const CoverageScene& scene) { return !fs::exists(scene.file); });
  return scenes;
}

Result<std::vector<CoveragePoint>> coverage_points(const fs::path& folder, const CoverageScene& scene,
                                                   const std::string& integrator, std::uint64_t seed,
                                                   std::uint32_t side,
                                                   const std::vector<std::uint64_t>& spp) {
  const fs::path path = folder / fmt::format("{}-{}-{}-{}-{}.halves", scene.name, integrator, side, seed,
                                             spp.empty() ? 0 : spp.back());
  if (fs::exists(path)) {
    CANDELA_ASSIGN(const std::string bytes, read_file(path, kFileLimitBytes));
    if (auto points = decode(bytes);
        points && std::equal(points->begin(), points->end(), spp.begin(), spp.end(),
                             [](const CoveragePoint& p, std::uint64_t n) { return p.spp == n; }))
      return std::move(*points);
  }
  CANDELA_ASSIGN(std::vector<CoveragePoint> points, render(scene, integrator, seed, side, spp));
  std::error_code error;
  fs::create_directories(folder, error);
  CANDELA_TRY(write_file_atomically(path, encode(points)));
  return points;
}

}  // namespace candela::bench
