#include "worker/inspect/paths.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "worker/inspect/parallel.h"
#include "worker/inspect/path_groups.h"
#include "worker/inspect/path_sampling.h"

namespace candela::inspect {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

class PathsRun {
 public:
  PathsRun(const Session& session, const PathsRequest& request, const PathSampling& sampling)
      : session_(session), request_(request), sampling_(sampling) {
    rules_.by_object = request.by_object;
    rules_.spot = request.spot;
    rules_.keep = request.keep;
  }

  PathsReport run() const {
    PathSums all(session_, rules_, sampling_.batches());
    for_each_in_order(
        sampling_.task_count(), request_.threads,
        [&](std::uint64_t task) {
          PathSums sums(session_, rules_, 1);
          sampling_.run(task, sums);
          return sums;
        },
        [&](std::uint64_t task, PathSums&& part) { all.merge(std::move(part), sampling_.batch_of(task)); });
    return report(all);
  }

 private:
  PathsReport report(const PathSums& sums) const {
    PathsReport out;
    out.pixels = request_.pixels.count();
    out.spp = request_.spp;
    const double samples = static_cast<double>(out.pixels) * static_cast<double>(out.spp);
    out.mean = sums.total() * (1 / samples);
    std::vector<double> samples_in;
    for (std::size_t b = 0; b < sampling_.batches(); ++b)
      samples_in.push_back(static_cast<double>(out.pixels * sampling_.samples_in(b)));
    out.luminance = ratio_of(sums.totals(), samples_in);
    out.other = ratio_of(sums.other().batches, sums.totals());
    out.other_count = sums.other().count;
    out.not_finite = sums.not_finite();
    std::vector<double> selected = sums.other().batches;
    for (const StringGroup& group : group_strings(sums.clusters(), request_.from_light, request_.rows))
      out.groups.push_back(group_of(group, sums, samples, selected));
    out.selected = ratio_of(selected, sums.totals());
    return out;
  }

  PathGroup group_of(const StringGroup& strings, const PathSums& sums, double samples,
                     std::vector<double>& selected) const {
    PathGroup out;
    out.expression = expression_of(strings, request_.from_light, session_);
    out.common = strings.common;
    std::vector<double> batches(selected.size());
    const Cluster* brightest = nullptr;
    for (const auto* member : strings.members) {
      const Cluster& cluster = member->second;
      out.mean += cluster.sum * (1 / samples);
      out.count += cluster.count;
      for (std::size_t b = 0; b < batches.size(); ++b) batches[b] += cluster.batches[b];
      if (brightest == nullptr || cluster.weight > brightest->weight) brightest = &cluster;
      for (const KeyPath& path : sums.kept())
        if (path.string == member->first) out.key_paths.push_back(path);
    }
    for (std::size_t b = 0; b < batches.size(); ++b) selected[b] += batches[b];
    out.share = ratio_of(batches, sums.totals());
    for (const Vec3d& place : brightest->places)
      out.mean_path.push_back(Vec3(place * (1 / std::max(brightest->weight, 1e-300))));
    // One at least, of the string with most light.
    if (out.key_paths.empty() && request_.keep > 0) out.key_paths.push_back(*brightest->best);
    std::sort(out.key_paths.begin(), out.key_paths.end(),
              [](const KeyPath& a, const KeyPath& b) { return a.rank > b.rank; });
    return out;
  }

  const Session& session_;
  const PathsRequest& request_;
  const PathSampling& sampling_;
  SumRules rules_;
};

}  // namespace

Estimate ratio_of(const std::vector<double>& parts, const std::vector<double>& wholes) {
  double part = 0, whole = 0;
  for (const double v : parts) part += v;
  for (const double v : wholes) whole += v;
  if (whole == 0) return {kUnknown, kUnknown};
  const double ratio = part / whole;
  const std::size_t n = parts.size();
  if (n < 2) return {ratio, kUnknown};
  double residuals = 0;
  for (std::size_t b = 0; b < n; ++b) {
    const double residual = parts[b] - ratio * wholes[b];
    residuals += residual * residual;
  }
  const auto count = static_cast<double>(n);
  return {ratio, std::sqrt(residuals * count / (count - 1)) / std::abs(whole)};
}

Result<PathsReport> inspect_paths(const Session& session, const PathsRequest& request) {
  CANDELA_ASSIGN(const PathSampling sampling, PathSampling::create(session, request.pixels, request.spp));
  return PathsRun(session, request, sampling).run();
}

}  // namespace candela::inspect
