#include "tests/bench/candela_bench/coverage.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <functional>
#include <limits>
#include <utility>

#include "common/base/files.h"
#include "common/stats/error_interval.h"
#include "common/stats/image_error.h"
#include "tests/integrators.h"

namespace candela::bench {
namespace {

double cpu_seconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

bool wanted(const std::vector<std::string>& names, const std::string& name) {
  return names.empty() || std::find(names.begin(), names.end(), name) != names.end();
}

std::vector<std::uint64_t> doublings(std::uint64_t last) {
  std::vector<std::uint64_t> points;
  for (std::uint64_t n = 4; n <= last; n *= 2) points.push_back(n);
  return points;
}

double mean_of(const std::vector<float>& values) {
  double sum = 0;
  for (const float value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double median(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::string csv_of(const std::vector<CoverageRow>& rows) {
  std::string out =
      "scene,integrator,held_out,seed,spp,truth,reference,relmse,upper,noise,blur,by_own_image\n";
  for (const CoverageRow& r : rows)
    out += fmt::format("{},{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g},{:.6g}\n", r.scene,
                       r.integrator, r.held_out ? 1 : 0, r.seed, r.spp, r.truth, r.reference, r.relmse,
                       r.upper, r.noise, r.blur, r.by_own_image);
  return out;
}

// Summary of the rows from `from` to `to` samples a pixel: "38 of 40 | 1.31".
std::string cells(const std::vector<CoverageRow>& rows, std::uint64_t from, std::uint64_t to) {
  std::size_t count = 0, covered = 0;
  std::vector<double> uppers, estimates, own;
  for (const CoverageRow& row : rows) {
    if (row.spp < from || row.spp > to || !row.known()) continue;
    ++count;
    covered += row.covered() ? 1 : 0;
    uppers.push_back(row.upper / row.truth);
    estimates.push_back(row.relmse / row.truth);
    own.push_back(row.by_own_image / row.truth);
  }
  if (count == 0) return "- | - | - | -";
  return fmt::format("{:.1f} % of {} | {:.2f} | {:.2f} | {:.2f}",
                     100 * static_cast<double>(covered) / static_cast<double>(count), count, median(uppers),
                     median(estimates), median(own));
}

}  // namespace

std::vector<CoverageRow> coverage_rows(const CoverageScene& scene, const std::string& integrator,
                                       std::uint64_t seed, const std::vector<CoveragePoint>& points,
                                       const std::vector<float>& reference_a,
                                       const std::vector<float>& reference_b) {
  std::vector<CoverageRow> rows;
  stats::Movement movement;
  const double mean = (mean_of(reference_a) + mean_of(reference_b)) / 2;
  for (const CoveragePoint& point : points) {
    const stats::HalfImages& h = point.halves;
    const double w0 = h.n0 / (h.n0 + h.n1), w1 = 1 - w0;
    const double factor = h.chains ? (w0 * w0 + w1 * w1) / 2 : w0 * w1;
    CoverageRow row{.scene = scene.name,
                    .integrator = integrator,
                    .held_out = held_out(scene, integrator),
                    .seed = seed,
                    .spp = point.spp};
    double image_mean = 0;
    for (std::size_t i = 0; i < h.a.size(); ++i) image_mean += w0 * h.a[i] + w1 * h.b[i];
    image_mean /= static_cast<double>(h.a.size());
    for (std::size_t i = 0; i < h.a.size(); ++i) {
      const double image = w0 * h.a[i] + w1 * h.b[i], a = reference_a[i], b = reference_b[i];
      const double weight = stats::relative_weight((a + b) / 2, mean);
      row.truth += (image - a) * (image - b) * weight;
      row.reference += (a - b) * (a - b) / 4 * weight;
      const double d = double{h.a[i]} - h.b[i];
      row.by_own_image += d * d * factor * stats::relative_weight(image, image_mean);
    }
    const auto values = static_cast<double>(h.a.size());
    row.truth /= values;
    row.reference /= values;
    row.by_own_image /= values;
    const stats::ErrorInterval shown = stats::error_interval(
        stats::halves_of(h), {point.alpha, point.expected_bias, point.connects, &movement, &point.measured});
    row.relmse = shown.relmse;
    row.upper = shown.upper;
    row.noise = shown.noise;
    row.blur = shown.blur;
    movement.add(shown.blocks, point.alpha);
    rows.push_back(std::move(row));
  }
  return rows;
}

std::string coverage_table(const std::vector<CoverageRow>& rows) {
  std::string out;
  const auto chosen_by = [](const CoverageRow& row) { return !row.held_out; };
  const auto kept_apart = [](const CoverageRow& row) { return row.held_out; };
  const auto any = [](const CoverageRow&) { return true; };
  const std::vector<std::pair<std::string, std::function<bool(const CoverageRow&)>>> parts = {
      {"Scenes that the method was chosen by", chosen_by},
      {"Scenes held out", kept_apart},
      {"All scenes", any}};
  for (const auto& [title, within] : parts) {
    const auto part = [&](const std::string& integrator) {
      std::vector<CoverageRow> some;
      std::copy_if(rows.begin(), rows.end(), std::back_inserter(some), [&](const CoverageRow& row) {
        return within(row) && (integrator.empty() || row.integrator == integrator);
      });
      return some;
    };
    if (part("").empty()) continue;
    out += title + "\n\n";
    out +=
        "| integrator | 4, 8 spp | | | | 16, 32 | | | | from 64 | | | "
        "|\n|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";
    for (const std::string& integrator : test::all_integrators())
      if (const auto some = part(integrator); !some.empty())
        out += fmt::format("| {} | {} | {} | {} |\n", integrator, cells(some, 1, 15), cells(some, 16, 63),
                           cells(some, 64, ~std::uint64_t{0}));
    const auto all = part("");
    out += fmt::format("| all | {} | {} | {} |\n\n", cells(all, 1, 15), cells(all, 16, 63),
                       cells(all, 64, ~std::uint64_t{0}));
  }
  return out;
}

Result<std::string> coverage(const CoverageOptions& options, const std::atomic<bool>& stop,
                             const std::function<void(const std::string&)>& say) {
  std::vector<CoverageRow> rows;
  for (std::uint64_t seed = 1; seed <= options.seeds; ++seed)
    for (const CoverageScene& scene : coverage_scenes()) {
      if (!wanted(options.scenes, scene.name) || (options.chosen_only && scene.held_out)) continue;
      if (options.cpu_minutes > 0 && cpu_seconds() > 60 * options.cpu_minutes) {
        say("no time is left: the rest is missing");
        break;
      }
      std::vector<float> a(std::size_t{options.side} * options.side * 3, static_cast<float>(scene.exact)),
          b = a;
      if (scene.exact == 0) {
        const double start = cpu_seconds();
        const std::uint64_t spp = options.reference_spp > 0 ? options.reference_spp : scene.reference_spp;
        constexpr std::uint64_t kReferenceSeed = 1000;
        CANDELA_ASSIGN(const auto reference, coverage_points(options.out, scene, scene.reference,
                                                             kReferenceSeed, options.side, {spp}));
        a = reference.back().halves.a;
        b = reference.back().halves.b;
        say(fmt::format("{}: reference {:.1f} s", scene.name, cpu_seconds() - start));
      }
      for (const std::string& integrator : scene.integrators) {
        if (!wanted(options.integrators, integrator)) continue;
        if (stop) return refused_error("stopped").with_mend("the same command goes on");
        const double start = cpu_seconds();
        const auto points =
            coverage_points(options.out, scene, integrator, seed, options.side, doublings(options.last_spp));
        if (!points.ok()) {
          say(fmt::format("{} {}: {}", scene.name, integrator, points.error().to_string()));
          continue;
        }
        const auto some = coverage_rows(scene, integrator, seed, *points, a, b);
        rows.insert(rows.end(), some.begin(), some.end());
        say(fmt::format("{} {} {}: {:.1f} s", scene.name, integrator, seed, cpu_seconds() - start));
      }
    }
  CANDELA_TRY(write_file_atomically(std::filesystem::path(options.out) / "rows.csv", csv_of(rows)));
  return coverage_table(rows);
}

}  // namespace candela::bench
