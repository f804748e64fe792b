// vcm and vcmplus to equal error: Table I of Lin et al. as ratios of iterations and of CPU seconds, Fig. 14
// (first radii), tables II and III (k, alpha_f) as errors over those of vcm. Both integrators start at the
// radius in which ten photons of an iteration lie, as in the paper's pictures, whatever the size of ours.
#include "tests/bench/candela_study/vcmplus_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "common/base/version.h"
#include "tests/bench/candela_study/kept.h"
#include "tests/paths.h"

namespace candela::study {
namespace {

struct Sizes {
  std::uint32_t side;
  std::vector<std::uint64_t> counts;  // of iterations
  std::size_t parameters_at;          // index of the count at which parameters are compared
  std::uint64_t pairs;                // of renders whose times are compared
  std::uint64_t reference_share;      // of the references' samples: 1 / this
};
Sizes sizes_of(const Request& request) {
  Sizes sizes =
      request.short_form ? Sizes{12, {4, 8, 16}, 1, 2, 64} : Sizes{64, {16, 32, 64, 128, 256, 512}, 3, 6, 1};
  if (request.side != 0) sizes.side = request.side;
  return sizes;
}

// All results of one scene.
class SceneTable {
 public:
  SceneTable(const Request& request, const Sizes& sizes, const TableScene& scene, const TableTruth& truth)
      : request_(request), sizes_(sizes), scene_(scene), truth_(truth) {}

  Result<Results> run() {
    CANDELA_ASSIGN(const auto both, measure({vcm(scene_.photons), vcmplus(scene_.photons)}, sizes_.counts));
    if (!both[1].report.figures.empty()) {
      add_maps(both);
      CANDELA_TRY(add_cost());
    }
    add_curves("table", both);
    add_ratios("table", both);
    if (scene_.parameters) {
      CANDELA_TRY(add_radii());
      CANDELA_TRY(add_parameters(both[0]));
    }
    return std::move(results_);
  }

 private:
  static Method vcm(int photons) {
    return {"vcm", "vcm", {{"radius_neighbors", std::to_string(photons)}, {"layers", "merging"}}};
  }
  static Method vcmplus(int photons, const SettingsMap& settings = {}) {
    Method method{"vcmplus", "vcmplus", vcm(photons).settings};
    for (const auto& [name, value] : settings) {
      method.name += ' ' + name + '=' + value;
      method.settings[name] = value;
    }
    return method;
  }
  void add(const std::string& part, const std::string& method, double n, const std::string& quantity,
           double value, double standard_error = kNone) {
    if (std::isfinite(value))
      results_.rows.push_back({part, scene_.name, method, kNone, n, quantity, value, standard_error});
  }
  void add_median(const std::string& part, const std::string& method, double n, const std::string& quantity,
                  const std::vector<double>& values) {
    statistical::Moments moments;
    for (const double value : values) moments.add(value);
    add(part, method, n, quantity, median(values), values.size() > 2 ? moments.error() : kNone);
  }

  Result<Rendered> render(const Method& method, std::uint64_t seed,
                          const std::vector<std::uint64_t>& counts) const {
    return render_job({.scene = scene_.file,
                       .width = sizes_.side,
                       .height = sizes_.side,
                       .integrator = method.integrator,
                       .settings = method.settings,
                       .seed = seed,
                       .threads = request_.threads},
                      counts);
  }

  // Methods take turns, so that what slows the machine down for a while slows all of them.
  Result<std::vector<TableCurve>> measure(const std::vector<Method>& methods,
                                          const std::vector<std::uint64_t>& counts) const {
    std::vector<TableCurve> curves(methods.size());
    std::vector<std::vector<std::vector<Image>>> images(methods.size());  // [method][count][seed]
    for (std::size_t m = 0; m < methods.size(); ++m) {
      curves[m].name = methods[m].name;
      curves[m].counts.assign(counts.begin(), counts.end());
      curves[m].squared.resize(counts.size());
      images[m].resize(counts.size());
      curves[m].relative.resize(counts.size());
      curves[m].trimmed.resize(counts.size());
      curves[m].seconds.resize(counts.size());
    }
    for (std::uint64_t seed = 1; seed <= request_.seeds; ++seed)
      for (std::size_t m = 0; m < methods.size(); ++m) {
        CANDELA_ASSIGN(Rendered rendered, render(methods[m], seed, counts));
        TableCurve& curve = curves[m];
        for (std::size_t k = 0; k < counts.size(); ++k) {
          curve.squared[k].push_back(truth_.squared_error(rendered.images[k]));
          curve.relative[k].push_back(truth_.relative_error(rendered.images[k]));
          curve.trimmed[k].push_back(truth_.trimmed_error(rendered.images[k]));
          curve.seconds[k].push_back(rendered.cpu_seconds[k]);
          images[m][k].push_back(rendered.images[k]);
        }
        if (seed != 1) continue;
        curve.report = std::move(rendered.report);
        curve.image = std::move(rendered.images.back());
        if (!rendered.layers.empty()) curve.merged = std::move(rendered.layers[0]);
      }
    for (std::size_t m = 0; m < methods.size() && request_.seeds > 1; ++m)
      for (const auto& of_count : images[m]) curves[m].bias.push_back(truth_.relative_bias(of_count));
    return curves;
  }

  void add_curves(const std::string& part, const std::vector<TableCurve>& curves) {
    for (const TableCurve& curve : curves) {
      for (std::size_t k = 0; k < curve.counts.size(); ++k) {
        add_median(part, curve.name, curve.counts[k], "squared error", curve.squared[k]);
        add_median(part, curve.name, curve.counts[k], "relative error", curve.relative[k]);
        add_median(part, curve.name, curve.counts[k], "trimmed error", curve.trimmed[k]);
        add_median(part, curve.name, curve.counts[k], "CPU seconds", curve.seconds[k]);
        if (!curve.bias.empty())
          add(part, curve.name, curve.counts[k], "relative squared bias", curve.bias[k]);
      }
      for (const auto& [name, value] : curve.report.figures)
        add(part, curve.name, curve.counts.back(), name, value);
      add(part, curve.name, curve.counts.back(), "share of merging", share_of(curve.merged, curve.image));
    }
  }
  static double share_of(const Image& part, const Image& whole) {
    double sum = 0, all = 0;
    for (const float value : part) sum += static_cast<double>(value);
    for (const float value : whole) all += static_cast<double>(value);
    return all > 0 ? sum / all : kNone;
  }

  // Adds the ratios of curves[1] over curves[0].
  void add_ratios(const std::string& part, const std::vector<TableCurve>& curves) {
    const TableCurve &base = curves[0], &other = curves[1];
    for (const auto& [name, errors] : {std::pair{"", &TableCurve::relative},
                                       {", squared error", &TableCurve::squared},
                                       {", trimmed error", &TableCurve::trimmed}}) {
      const std::vector<double> target = medians(base.*errors);
      for (std::size_t k = 1; k < base.counts.size(); ++k) {
        std::vector<double> iterations, ratios;
        for (std::size_t s = 0; s < request_.seeds; ++s) {
          iterations.push_back(iterations_ratio(base.counts, target, of_seed(other.*errors, s), k));
          ratios.push_back((other.*errors)[k][s] / target[k]);
        }
        add_median(part, other.name, base.counts[k], std::string("iterations over vcm's") + name, iterations);
        add_median(part, other.name, base.counts[k], std::string("error over vcm's") + name, ratios);
      }
      const auto seconds = medians(other.seconds);
      add(part, other.name, base.counts.back(), std::string("CPU seconds over vcm's") + name,
          reached(seconds, medians(other.*errors), target.back()) / median(base.seconds.back()));
    }
    std::vector<double> costs;
    for (std::size_t s = 0; s < request_.seeds; ++s)
      costs.push_back(other.seconds.back()[s] / base.seconds.back()[s]);
    add_median(part, other.name, base.counts.back(), "CPU seconds of an iteration over vcm's", costs);
  }
  static std::vector<double> medians(const std::vector<std::vector<double>>& values) {
    std::vector<double> found;
    for (const auto& of_count : values) found.push_back(median(of_count));
    return found;
  }
  static std::vector<double> of_seed(const std::vector<std::vector<double>>& values, std::size_t seed) {
    std::vector<double> found;
    for (const auto& of_count : values) found.push_back(of_count[seed]);
    return found;
  }
  // Iterations that `errors` need to the k-th target, over those of the target. If they never get there:
  // those that the target's curve needs less to where `errors` get, as a ratio.
  static double iterations_ratio(const std::vector<double>& counts, const std::vector<double>& targets,
                                 const std::vector<double>& errors, std::size_t k) {
    const double needed = reached(counts, errors, targets[k]);
    if (std::isfinite(needed)) return needed / counts[k];
    return counts.back() / reached(counts, targets, errors.back());
  }

  void add_maps(const std::vector<TableCurve>& curves) {
    for (const StateReport::Layer& layer : curves[1].report.layers)
      if (layer.name == "radius") add_map("radius", layer.values);
    for (const TableCurve& curve : curves) {
      std::vector<float> shares;
      for (std::size_t i = 0; i + 2 < curve.image.size(); i += 3) {
        const float all = curve.image[i] + curve.image[i + 1] + curve.image[i + 2],
                    part = curve.merged[i] + curve.merged[i + 1] + curve.merged[i + 2];
        shares.push_back(all > 0 ? part / all : 0);
      }
      add_map("merging " + curve.name, std::move(shares));
    }
  }
  void add_map(const std::string& what, std::vector<float> values) {
    results_.maps.push_back({scene_.name + ' ' + what, sizes_.side, sizes_.side, std::move(values)});
  }

  // Measures the cost of the statistics: vcm and vcmplus make the same film at the same constant radius.
  Result<void> add_cost() {
    const std::uint64_t count = sizes_.counts[1];
    Method constant = vcm(scene_.photons);
    constant.settings["alpha"] = "1";
    // Lag 1: the first two epochs have the first radius.
    const Method tested = vcmplus(scene_.photons, {{"alpha", "1"}, {"epoch_min", std::to_string(count / 2)}});
    std::vector<double> ratios;
    for (std::uint64_t seed = 1; seed <= sizes_.pairs; ++seed) {
      CANDELA_ASSIGN(const Rendered without, render(constant, seed, {count}));
      CANDELA_ASSIGN(const Rendered with, render(tested, seed, {count}));
      if (with.images != without.images)
        return internal_error("vcmplus at one radius makes another film than vcm on " + scene_.name);
      ratios.push_back(with.cpu_seconds[0] / without.cpu_seconds[0]);
    }
    add_median("cost", "vcmplus", static_cast<double>(count), "CPU seconds at equal radii over vcm's",
               ratios);
    return {};
  }

  // Fig. 14.
  Result<void> add_radii() {
    for (const int photons : {1, 100}) {  // and scene_.photons in the table
      CANDELA_ASSIGN(const auto both, measure({vcm(photons), vcmplus(photons)}, sizes_.counts));
      const std::string part = fmt::format("{} photons in a first disc", photons);
      add_curves(part, both);
      add_ratios(part, both);
    }
    return {};
  }

  // Tables II and III.
  Result<void> add_parameters(const TableCurve& base) {
    const double n = base.counts[sizes_.parameters_at];
    const double squared = median(base.squared[sizes_.parameters_at]),
                 relative = median(base.relative[sizes_.parameters_at]);
    const std::vector<SettingsMap> settings = {{{"k", "0.5"}},       {{"k", "0.6"}},
                                               {{"k", "0.7"}},       {{"k", "0.8"}},
                                               {{"k", "0.9"}},       {{"alpha_f", "0.01"}},
                                               {{"alpha_f", "0.1"}}, {{"alpha", "1"}},
                                               {{"alpha", "0.8"}},   {{"alpha", "1"}, {"alpha_f", "0.01"}}};
    std::vector<Method> methods;
    for (const SettingsMap& one : settings) methods.push_back(vcmplus(scene_.photons, one));
    CANDELA_ASSIGN(const auto curves, measure(methods, {static_cast<std::uint64_t>(n)}));
    for (const TableCurve& curve : curves) {
      std::vector<double> of_squared, of_relative;
      for (const double error : curve.squared[0]) of_squared.push_back(error / squared);
      for (const double error : curve.relative[0]) of_relative.push_back(error / relative);
      add_median("parameters", curve.name, n, "error over vcm's", of_relative);
      add_median("parameters", curve.name, n, "error over vcm's, squared error", of_squared);
    }
    return {};
  }

  const Request& request_;
  const Sizes& sizes_;
  const TableScene& scene_;
  const TableTruth& truth_;
  Results results_;
};

Result<Results> results_of(const Request& request, const Sizes& sizes, const TableScene& scene) {
  const std::uint64_t count = std::max<std::uint64_t>(16, scene.reference_count / sizes.reference_share);
  CANDELA_ASSIGN(const TableTruth truth,
                 TableTruth::render(scene, sizes.side, count, request.threads, request.folder));
  CANDELA_ASSIGN(Results results, SceneTable(request, sizes, scene, truth).run());
  for (const auto& [quantity, value] :
       {std::pair{"squared error", truth.variance()}, {"relative error", truth.relative_variance()}})
    results.rows.push_back({"reference", scene.name, scene.reference, kNone, static_cast<double>(count),
                            quantity, value, kNone});
  return results;
}

}  // namespace

Result<Results> run_vcmplus_table(const Request& request) {
  const Sizes sizes = sizes_of(request);
  std::vector<std::string> scene_names;
  for (const TableScene& scene : table_scenes()) scene_names.push_back(scene.name);
  CANDELA_TRY(check_scenes(request, scene_names));
  Results results;
  for (const TableScene& scene : table_scenes()) {
    const bool by_name = !request.scenes.empty();
    if (!request.wants(scene.name) || (request.short_form && !by_name && !scene.in_short_form)) continue;
    if (!std::filesystem::exists(test::source_path(scene.file))) {
      request.say(fmt::format("vcmplus-table: {} is skipped: there is no {}", scene.name, scene.file));
      continue;
    }
    const std::string key = fmt::format("{} side {} seeds {} last {}", build_id(), sizes.side, request.seeds,
                                        sizes.counts.back());
    CANDELA_ASSIGN(Results of_scene, kept_results(request.folder, scene.name, key,
                                                  [&] { return results_of(request, sizes, scene); }));
    results.rows.insert(results.rows.end(), of_scene.rows.begin(), of_scene.rows.end());
    results.maps.insert(results.maps.end(), of_scene.maps.begin(), of_scene.maps.end());
    request.say(fmt::format("vcmplus-table: {}", scene.name));
  }
  return results;
}

}  // namespace candela::study
