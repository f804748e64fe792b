#include "client/json.h"

#include "common/base/version.h"
#include "common/wire/json_values.h"

namespace candela::client {

using wire::finite;
using wire::Json;
using wire::json_text;

std::string submitted_json(const std::string& id, bool existed, std::uint64_t uploaded_bytes) {
  return json_text({{"id", id}, {"existed", existed}, {"uploaded_bytes", uploaded_bytes}});
}

std::string submitted_group_json(const std::string& id, std::size_t frames, std::size_t existed,
                                 std::uint64_t uploaded_bytes) {
  return json_text(
      {{"id", id}, {"frames", frames}, {"existed", existed}, {"uploaded_bytes", uploaded_bytes}});
}

std::string comparison_json(const stats::ImageComparison& c, const stats::ImageDifference* d,
                            KnownVariance variance, KnownVariance reference) {
  const auto rgb = [](const auto& v) { return Json{finite(v[0]), finite(v[1]), finite(v[2])}; };
  Json worst = Json::array();
  for (const auto& pixel : c.worst)
    worst.push_back({{"x", pixel.x},
                     {"y", pixel.y},
                     {"relative_squared_error", finite(pixel.relative_squared_error)},
                     {"value", rgb(pixel.a)},
                     {"reference", rgb(pixel.b)}});
  Json noise = nullptr;
  if (d != nullptr) {
    const stats::ComparisonNoise& n = d->noise;
    const auto figure = [](double value, double error) {
      constexpr double kNormal = 1.96;
      return Json{{"standard_error", finite(error)},
                  {"interval", {finite(value - kNormal * error), finite(value + kNormal * error)}}};
    };
    Json blocks = Json::array();
    for (const stats::BlockDifference& block : d->differing)
      blocks.push_back({{"x", block.x},
                        {"y", block.y},
                        {"width", block.width},
                        {"height", block.height},
                        {"p", block.p},
                        {"mean", rgb(block.a)},
                        {"mean_reference", rgb(block.b)}});
    noise = {{"variance_known", variance.known},
             {"reference_variance_known", reference.known},
             {"invalid_variances", variance.invalid},
             {"invalid_reference_variances", reference.invalid},
             {"mean", figure(c.mean_a, n.mean_a)},
             {"mean_reference", figure(c.mean_b, n.mean_b)},
             {"mean_ratio", figure(c.mean_ratio, n.mean_ratio)},
             {"rmse", figure(c.rmse, n.rmse)},
             {"relmse", figure(c.relmse, n.relmse)},
             {"expected_relmse", finite(n.expected_relmse)},
             {"blocks", d->blocks},
             {"differing_blocks", blocks}};
  }
  return json_text({{"mean", finite(c.mean_a)},
                    {"mean_reference", finite(c.mean_b)},
                    {"mean_ratio", finite(c.mean_ratio)},
                    {"rmse", finite(c.rmse)},
                    {"relmse", finite(c.relmse)},
                    {"relmse_trimmed", finite(c.relmse_trimmed)},
                    {"worst", worst},
                    {"noise", noise}});
}

std::string version_json() {
  return json_text(
      {{"version", std::string(version())}, {"build_id", std::string(build_id())}, {"protocol", kProtocol}});
}

std::string plan_json(const std::string& integrator, const std::map<std::string, std::string>& settings,
                      const std::string& plan) {
  Json values = Json::object();
  for (const auto& [key, value] : settings) values[key] = value;
  return json_text({{"integrator", integrator}, {"integrator_settings", values}, {"plan", plan}});
}

std::string objects_json(const description::ObjectList& objects) {
  const auto rows = [](const std::vector<description::NamedObjects>& list) {
    Json result = Json::array();
    for (const description::NamedObjects& row : list) {
      Json bounds = nullptr;
      if (row.bounds) {
        const auto point = [](const description::Vec3& p) {
          return Json{finite(p[0]), finite(p[1]), finite(p[2])};
        };
        bounds = {{"low", point(row.bounds->low)}, {"high", point(row.bounds->high)}};
      }
      result.push_back({{"name", row.name.empty() ? Json(nullptr) : Json(row.name)},
                        {"count", row.count()},
                        {"kinds", row.kinds},
                        {"bounds", bounds}});
    }
    return result;
  };
  return json_text(
      {{"surfaces", rows(objects.surfaces)}, {"lamps", rows(objects.lamps)}, {"media", rows(objects.media)}});
}

}  // namespace candela::client
