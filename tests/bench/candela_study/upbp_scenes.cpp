// Error of upbp's techniques in media, each alone and all together, in equal CPU time, on five scenes.
//
// Methods render in turn, seed after seed, so that what slows the machine down for a while slows all of them.
// Errors are squared, each value's over its own square plus 1 % of the picture's squared mean, against two
// references (image_errors.h). noise: the part of the error that differs from seed to seed; bias: what the
// mean over seeds keeps. "at equal time": interpolated, in logarithms, to the CPU seconds after which the
// quickest method has made all its iterations.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "common/base/version.h"
#include "tests/bench/candela_study/image_errors.h"
#include "tests/bench/candela_study/kept.h"
#include "tests/bench/candela_study/renders.h"
#include "tests/bench/candela_study/study.h"
#include "tests/statistical/moments.h"

namespace candela::study {
namespace {

using statistical::Moments;

struct MediaScene {
  const char* name;
  const char* file;
  const char* reference;          // integrator
  std::uint64_t reference_count;  // iterations
};
constexpr MediaScene kScenes[] = {
    {"caustic", "tests/bench/candela_study/scenes/media-caustic.xml", "bdpt", 2048},
    {"mist", "tests/bench/candela_study/scenes/media-mist.xml", "bdpt", 2048},
    {"milk", "tests/bench/candela_study/scenes/media-milk.xml", "path", 8192},
    {"smoke", "tests/statistical/transport/smoke.xml", "path", 8192},
    {"still-life", "tests/bench/candela_study/scenes/media-still-life.xml", "bdpt", 4096},
};
constexpr const char* kAlone[] = {"vcm", "pp3d", "pb2d", "bp2d", "bb1d"};
constexpr const char* kTogether[] = {
    "vcm,pp3d,pb2d",    "all",        "all, 1024 beams",    "an eighth of connections",
    "long query beams", "long beams", "merges, 1024 beams", "auto"};
// The layers that upbp writes for layers=techniques, in order.
constexpr const char* kLayers[] = {"connections", "merging", "pp3d", "pb2d", "bp2d", "bb1d"};
constexpr const char* kLayered = "all, 1024 beams";  // whose shares are shown
// The first radius, over that of the scene's bounding sphere: set, so that tables of all versions compare.
constexpr const char* kRadius = "0.003";
SettingsMap settings_of(const std::string& method) {
  SettingsMap settings = {{"radius", kRadius}, {"techniques", method}};
  const auto all_of_1024 = [&](const SettingsMap& more) {
    settings["techniques"] = "all";
    settings["beam_paths"] = "1024";
    for (const auto& [name, value] : more) settings[name] = value;
  };
  if (method == "all, 1024 beams") all_of_1024({});
  if (method == "an eighth of connections") all_of_1024({{"connect_media", "0.125"}});
  if (method == "long query beams") all_of_1024({{"query_beams", "long"}});
  if (method == "long beams") all_of_1024({{"query_beams", "long"}, {"photon_beams", "long"}});
  if (method == "merges, 1024 beams") all_of_1024({{"techniques", "pp3d,pb2d,bp2d,bb1d"}});
  if (method == "bb1d") settings["beam_paths"] = "1024";
  return settings;
}

struct MediaSizes {
  std::uint32_t side;
  std::vector<std::uint64_t> counts;  // of iterations
  std::uint64_t reference_share;      // of the references' iterations: 1 / this
};
MediaSizes media_sizes(const Request& request) {
  MediaSizes sizes = request.short_form ? MediaSizes{12, {2, 4}, 64} : MediaSizes{64, {4, 8, 16, 32, 64}, 1};
  if (request.side != 0) sizes.side = request.side;
  return sizes;
}

// After each count of iterations.
struct MediaCurve {
  std::string name;
  std::vector<Moments> seconds, error;  // over seeds
  std::vector<double> noise, bias;
  Image mean;  // over seeds, after the last
};

// The value at x of a curve through (xs, ys), straight in logarithms and constant outside; xs ascend.
double log_interpolated(const std::vector<double>& xs, const std::vector<double>& ys, double x) {
  std::size_t i = 1;
  while (i + 1 < xs.size() && xs[i] < x) ++i;
  if (xs.size() < 2 || !(ys[i - 1] > 0) || !(ys[i] > 0)) return kNone;
  const double t = std::clamp(std::log(x / xs[i - 1]) / std::log(xs[i] / xs[i - 1]), 0.0, 1.0);
  return std::exp((1 - t) * std::log(ys[i - 1]) + t * std::log(ys[i]));
}

class MediaTable {
 public:
  MediaTable(const Request& request, const MediaSizes& sizes, const MediaScene& scene)
      : request_(request), sizes_(sizes), scene_(scene) {}

  Result<Results> run() {
    CANDELA_ASSIGN(const Truth truth, references());
    CANDELA_ASSIGN(const std::vector<MediaCurve> curves, measure(truth));
    add_map("reference", mean_image({truth.first, truth.second}, 0, 2));
    for (const MediaCurve& curve : curves) add_curve(curve);
    add_equal_time(curves);
    CANDELA_TRY(add_layers());
    return std::move(results_);
  }

 private:
  Render render(const std::string& integrator, std::uint64_t seed) const {
    return {.scene = scene_.file,
            .width = sizes_.side,
            .height = sizes_.side,
            .integrator = integrator,
            .seed = seed,
            .threads = request_.threads};
  }
  Result<Truth> references() const {
    const std::uint64_t count = std::max<std::uint64_t>(16, scene_.reference_count / sizes_.reference_share);
    std::vector<Image> images;
    for (const std::uint64_t seed : {900001, 900002}) {
      const std::string name =
          fmt::format("{}-{}-{}-{}-{}", scene_.name, scene_.reference, sizes_.side, count, seed);
      const auto make = [&]() -> Result<Image> {
        Render one = render(scene_.reference, seed);
        one.sampler = "sobol";
        CANDELA_ASSIGN(auto made, render_images(one, {count}));
        return std::move(made[0]);
      };
      CANDELA_ASSIGN(Image image,
                     kept_image(request_.folder, name, std::size_t{sizes_.side} * sizes_.side * 3, make));
      images.push_back(std::move(image));
    }
    return Truth(std::move(images[0]), std::move(images[1]));
  }

  Result<std::vector<MediaCurve>> measure(const Truth& truth) const {
    std::vector<MediaCurve> curves;
    for (const char* name : kAlone) curves.push_back({name, {}, {}, {}, {}, {}});
    for (const char* name : kTogether) curves.push_back({name, {}, {}, {}, {}, {}});
    const std::size_t levels = sizes_.counts.size();
    std::vector<std::vector<std::vector<Image>>> images(curves.size(),
                                                        std::vector<std::vector<Image>>(levels));
    for (std::uint64_t seed = 1; seed <= request_.seeds; ++seed)
      for (std::size_t m = 0; m < curves.size(); ++m) {
        MediaCurve& curve = curves[m];
        curve.seconds.resize(levels);
        curve.error.resize(levels);
        Render one = render("upbp", seed);
        one.settings = settings_of(curve.name);
        CANDELA_ASSIGN(Rendered rendered, render_job(one, sizes_.counts));
        for (std::size_t k = 0; k < levels; ++k) {
          curve.seconds[k].add(rendered.cpu_seconds[k]);
          curve.error[k].add(relative_squared_error(rendered.images[k], truth));
          images[m][k].push_back(std::move(rendered.images[k]));
        }
      }
    // With variance V of one image and squared bias B: the error is V + B, that of the mean V / seeds + B.
    const auto seeds = static_cast<double>(request_.seeds);
    for (std::size_t m = 0; m < curves.size(); ++m)
      for (std::size_t k = 0; k < levels; ++k) {
        curves[m].mean = mean_image(images[m][k], 0, images[m][k].size());
        if (request_.seeds < 2) continue;
        const double whole = curves[m].error[k].mean(),
                     of_mean = relative_squared_error(curves[m].mean, truth),
                     noise = (whole - of_mean) * seeds / (seeds - 1);
        curves[m].noise.push_back(noise);
        curves[m].bias.push_back(whole - noise);
      }
    return curves;
  }

  // The share of each technique in the picture of all, and their part of its light.
  Result<void> add_layers() {
    Render one = render("upbp", 1);
    one.settings = settings_of(kLayered);
    one.settings["layers"] = "techniques";
    CANDELA_ASSIGN(const Rendered rendered, render_job(one, {sizes_.counts.back()}));
    const auto sum = [](const Image& image) {
      return std::accumulate(image.begin(), image.end(), 0.0,
                             [](double total, float v) { return total + static_cast<double>(v); });
    };
    const double whole = sum(rendered.images.back());
    if (rendered.layers.size() != std::size(kLayers)) return internal_error("upbp has other layers");
    for (std::size_t i = 0; i < rendered.layers.size(); ++i) {
      const std::string name = kLayers[i];
      add("layers", name, static_cast<double>(sizes_.counts.back()), "share of the light",
          sum(rendered.layers[i]) / whole);
      add_map("layer " + name, rendered.layers[i]);
    }
    return {};
  }

  void add(const std::string& part, const std::string& method, double n, const std::string& quantity,
           double value, double standard_error = kNone) {
    if (std::isfinite(value))
      results_.rows.push_back({part, scene_.name, method, kNone, n, quantity, value, standard_error});
  }
  void add_map(const std::string& method, const Image& image) {
    std::vector<float> green;
    for (std::size_t i = 1; i < image.size(); i += 3) green.push_back(image[i]);
    results_.maps.push_back(
        {std::string(scene_.name) + ' ' + method, sizes_.side, sizes_.side, std::move(green)});
  }
  void add_curve(const MediaCurve& curve) {
    const double known = request_.seeds > 2 ? 1 : kNone;
    for (std::size_t k = 0; k < sizes_.counts.size(); ++k) {
      const auto n = static_cast<double>(sizes_.counts[k]);
      add("curves", curve.name, n, "relative squared error", curve.error[k].mean(),
          known * curve.error[k].error());
      add("curves", curve.name, n, "CPU seconds", curve.seconds[k].mean(), known * curve.seconds[k].error());
      if (curve.noise.empty()) continue;
      add("curves", curve.name, n, "noise", curve.noise[k]);
      add("curves", curve.name, n, "bias", curve.bias[k]);
    }
    add_map(curve.name, curve.mean);
  }
  void add_equal_time(const std::vector<MediaCurve>& curves) {
    double time = std::numeric_limits<double>::infinity();
    for (const MediaCurve& curve : curves) time = std::min(time, curve.seconds.back().mean());
    for (const MediaCurve& curve : curves) {
      std::vector<double> seconds, error;
      for (const Moments& moments : curve.seconds) seconds.push_back(moments.mean());
      for (const Moments& moments : curve.error) error.push_back(moments.mean());
      add("equal time", curve.name, time, "relative squared error", log_interpolated(seconds, error, time));
      add("equal time", curve.name, time, "seconds of an iteration over vcm's",
          seconds.back() / curves[0].seconds.back().mean());
      if (!curve.noise.empty())
        add("equal time", curve.name, time, "noise", log_interpolated(seconds, curve.noise, time));
    }
  }

  const Request& request_;
  const MediaSizes& sizes_;
  const MediaScene& scene_;
  Results results_;
};

}  // namespace

Result<Results> run_upbp_scenes(const Request& request) {
  const MediaSizes sizes = media_sizes(request);
  std::vector<std::string> scene_names;
  for (const MediaScene& scene : kScenes) scene_names.emplace_back(scene.name);
  CANDELA_TRY(check_scenes(request, scene_names));
  Results results;
  for (const MediaScene& scene : kScenes) {
    if (!request.wants(scene.name)) continue;
    const std::string key = fmt::format("{} side {} seeds {} last {}", build_id(), sizes.side, request.seeds,
                                        sizes.counts.back());
    CANDELA_ASSIGN(Results of_scene, kept_results(request.folder, scene.name, key,
                                                  [&] { return MediaTable(request, sizes, scene).run(); }));
    results.rows.insert(results.rows.end(), of_scene.rows.begin(), of_scene.rows.end());
    results.maps.insert(results.maps.end(), of_scene.maps.begin(), of_scene.maps.end());
    request.say(fmt::format("upbp-scenes: {}", scene.name));
  }
  return results;
}

}  // namespace candela::study
