#include "tests/bench/candela_study/kept.h"

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/base/files.h"

namespace candela::study {
namespace {

using Json = nlohmann::ordered_json;

// JSON has no NaN.
Json number_json(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}
double number_of(const Json& json) {
  return json.is_null() ? kNone : json.get<double>();
}

std::string text_of(const std::string& key, const Results& results) {
  Json rows = Json::array(), maps = Json::array();
  for (const Row& row : results.rows)
    rows.push_back({row.part, row.problem, row.method, number_json(row.alpha), number_json(row.n),
                    row.quantity, number_json(row.value), number_json(row.standard_error)});
  for (const Map& map : results.maps) maps.push_back({map.name, map.width, map.height, map.values});
  return Json{{"key", key}, {"rows", std::move(rows)}, {"maps", std::move(maps)}}.dump();
}

// Nothing if the text has another key or another form.
std::optional<Results> results_of(const std::string& text, const std::string& key) {
  try {
    const Json json = Json::parse(text);
    if (json.at("key").get<std::string>() != key) return {};
    Results results;
    for (const Json& row : json.at("rows"))
      results.rows.push_back({row.at(0), row.at(1), row.at(2), number_of(row.at(3)), number_of(row.at(4)),
                              row.at(5), number_of(row.at(6)), number_of(row.at(7))});
    for (const Json& map : json.at("maps"))
      results.maps.push_back({map.at(0), map.at(1), map.at(2), map.at(3)});
    return results;
  } catch (const Json::exception&) {
    return {};
  }
}

}  // namespace

Result<Results> kept_results(const std::filesystem::path& folder, const std::string& name,
                             const std::string& key, const std::function<Result<Results>()>& make) {
  if (folder.empty()) return make();
  const std::filesystem::path file = folder / (name + ".json");
  if (const auto text = read_file(file, std::uint64_t{1} << 30); text.ok())
    if (std::optional<Results> results = results_of(*text, key)) return std::move(*results);
  CANDELA_ASSIGN(Results results, make());
  CANDELA_TRY(make_directories(folder));
  CANDELA_TRY(write_file_atomically(file, text_of(key, results)));
  return results;
}

Result<Image> kept_image(const std::filesystem::path& folder, const std::string& name, std::size_t values,
                         const std::function<Result<Image>()>& make) {
  if (folder.empty()) return make();
  const std::filesystem::path file = folder / (name + ".f32");
  const std::size_t bytes = values * sizeof(float);
  if (const auto text = read_file(file, bytes); text.ok() && text->size() == bytes) {
    Image image(values);
    std::memcpy(image.data(), text->data(), bytes);
    return image;
  }
  CANDELA_ASSIGN(Image image, make());
  CANDELA_TRY(make_directories(folder));
  CANDELA_TRY(write_file_atomically(file, {reinterpret_cast<const char*>(image.data()), bytes}));
  return image;
}

}  // namespace candela::study
