// ppm, cppm and fppm after equal iterations from equal first radii, on seven scenes: Fig. 6 to 8 of Lin et
// al. on scenes that are at hand.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "common/image/image.h"
#include "tests/bench/candela_study/image_errors.h"
#include "tests/bench/candela_study/renders.h"
#include "tests/bench/candela_study/study.h"
#include "tests/paths.h"

namespace candela::study {
namespace {

struct Scene {
  const char* name;
  const char* file;
  // An image of another renderer with standard errors beside it; null: two renders of bdpt.
  const char* reference;
  std::uint32_t width, height;  // of the study's full form
};
// The first four are not part of the sources. The last three were chosen before any method ran on them.
constexpr Scene kScenes[] = {
    {"cornell-box", "../shared/scenes/cornell-box/scene.xml", "../shared/references/cornell-box", 128, 128},
    {"veach-mis", "../shared/scenes/veach-mis/scene.xml", "../shared/references/veach-mis", 128, 72},
    {"veach-bidir", "../shared/scenes/veach-bidir/scene.xml", "../shared/references/veach-bidir", 128, 128},
    {"veach-ajar", "../shared/scenes/veach-ajar/scene.xml", "../shared/references/veach-ajar", 128, 72},
    {"split-box", "tests/bench/candela_study/scenes/split-box.xml", nullptr, 128, 128},
    {"studio", "deploy/scenes/studio/scene.xml", nullptr, 128, 72},
    {"textured-lamp", "tests/statistical/transport/textured-lamp.xml", nullptr, 128, 128},
};

const std::vector<Method>& methods() {
  static const std::vector<Method> all = {
      {"ppm", "ppm", {}},
      {"cppm", "cppm", {}},
      {"fppm", "fppm", {}},
  };
  return all;
}

// Photons in the median first disc, as in the paper: 0.1 to 0.3 % of the scene's radius and a million photon
// paths are 2 to 20.
constexpr const char* kNeighbors = "20";

std::string path_of(const std::string& file) {
  return test::source_path(file);
}

// The mean over squares of pixels.
Result<Image> shrunk(const image::Image& large, std::uint32_t width, std::uint32_t height,
                     bool standard_errors) {
  if (large.width % width != 0 || large.height % height != 0 || large.width / width != large.height / height)
    return internal_error("the reference has another aspect");
  const std::uint32_t factor = large.width / width;
  std::vector<double> sums(std::size_t{3} * width * height);
  for (std::uint32_t y = 0; y < large.height; ++y)
    for (std::uint32_t x = 0; x < large.width; ++x)
      for (std::uint32_t c = 0; c < 3; ++c) {
        const auto value = static_cast<double>(large.rgb[3 * (std::size_t{y} * large.width + x) + c]);
        sums[3 * (std::size_t{y / factor} * width + x / factor) + c] +=
            standard_errors ? value * value : value;
      }
  Image image;
  const double pixels = static_cast<double>(factor) * factor;
  for (const double sum : sums)
    image.push_back(static_cast<float>((standard_errors ? std::sqrt(sum) : sum) / pixels));
  return image;
}

// R + s and R - s for standard errors s: the product of an image's differences to both is (I - R)^2 - s^2.
Result<Truth> read_truth(const Scene& scene, std::uint32_t width, std::uint32_t height) {
  CANDELA_ASSIGN(const image::Image mean, image::read_image(path_of(std::string(scene.reference) + ".exr")));
  CANDELA_ASSIGN(const image::Image deviation,
                 image::read_image(path_of(std::string(scene.reference) + ".stderr.exr")));
  CANDELA_ASSIGN(Image above, shrunk(mean, width, height, false));
  CANDELA_ASSIGN(const Image errors, shrunk(deviation, width, height, true));
  Image below = above;
  for (std::size_t i = 0; i < above.size(); ++i) {
    above[i] += errors[i];
    below[i] -= errors[i];
  }
  return Truth(std::move(above), std::move(below));
}

}  // namespace

Result<Results> run_fppm_scenes(const Request& request) {
  const std::uint32_t down = request.short_form ? 8 : 1;
  const std::vector<std::uint64_t> counts =
      request.short_form ? std::vector<std::uint64_t>{4, 16} : std::vector<std::uint64_t>{32, 128, 512};
  std::vector<std::string> scene_names;
  for (const Scene& scene : kScenes) scene_names.emplace_back(scene.name);
  CANDELA_TRY(check_scenes(request, scene_names));
  Results results;
  for (const Scene& scene : kScenes) {
    if (!request.wants(scene.name)) continue;
    if (request.short_form && scene.reference != nullptr) continue;  // seconds to load
    if (!std::filesystem::exists(path_of(scene.file))) {
      request.say(fmt::format("fppm-scenes: {} is left out: {} is not here", scene.name, scene.file));
      continue;
    }
    const std::uint32_t width = scene.width / down, height = scene.height / down;
    const auto render = [&](const std::string& integrator, std::uint64_t seed) {
      return Render{.scene = scene.file,
                    .width = width,
                    .height = height,
                    .integrator = integrator,
                    .seed = seed,
                    .threads = request.threads};
    };
    const auto add = [&](const std::string& method, double n, const std::string& quantity, double value,
                         double standard_error) {
      results.rows.push_back({"fppm-scenes", scene.name, method, kNone, n, quantity, value, standard_error});
    };
    std::vector<Image> halves;
    for (std::uint64_t seed = 900001; scene.reference == nullptr && seed <= 900002; ++seed) {
      Render reference = render("bdpt", seed);
      reference.sampler = "sobol";
      CANDELA_ASSIGN(auto images, render_images(reference, {request.short_form ? 64U : 256U}));
      halves.push_back(std::move(images[0]));
    }
    CANDELA_ASSIGN(const Truth truth, scene.reference != nullptr
                                          ? read_truth(scene, width, height)
                                          : Result<Truth>(Truth(halves[0], halves[1])));
    add("reference", kNone, "variance", truth.variance, kNone);

    for (const Method& method : methods()) {
      std::vector<statistical::Moments> relative(counts.size()), plain(counts.size());
      double seconds = 0;
      for (std::uint64_t seed = 1; seed <= request.seeds; ++seed) {
        Render one = render(method.integrator, seed);
        one.settings = method.settings;
        one.settings["radius_neighbors"] = kNeighbors;
        CANDELA_ASSIGN(Rendered rendered, render_job(one, counts));
        for (std::size_t c = 0; c < counts.size(); ++c) {
          relative[c].add(relative_squared_error(rendered.images[c], truth));
          plain[c].add(errors_of({rendered.images[c]}, truth).squared_error.mean());
        }
        seconds += rendered.cpu_seconds.back() / static_cast<double>(request.seeds);
        if (seed != 1) continue;
        const auto n = static_cast<double>(counts.back());
        for (const auto& [name, value] : rendered.report.figures) add(method.name, n, name, value, kNone);
        for (const StateReport::Layer& layer : rendered.report.layers)
          if (layer.name == "radius")
            results.maps.push_back(
                {std::string(scene.name) + " " + method.name, width, height, layer.values});
      }
      for (std::size_t c = 0; c < counts.size(); ++c) {
        const auto n = static_cast<double>(counts[c]);
        const double known = request.seeds > 2 ? 1 : kNone;
        add(method.name, n, "relative squared error", relative[c].mean(), known * relative[c].error());
        add(method.name, n, "squared error", plain[c].mean(), known * plain[c].error());
      }
      add(method.name, static_cast<double>(counts.back()), "CPU seconds", seconds, kNone);
      request.say(
          fmt::format("fppm-scenes: {}, {}: {:.3g} ({:.3g} relative to the pixel) in {:.0f} CPU seconds",
                      scene.name, method.name, plain.back().mean(), relative.back().mean(), seconds));
    }
  }
  return results;
}

}  // namespace candela::study
