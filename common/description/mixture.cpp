#include "common/description/mixture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/description/check.h"
#include "common/description/text.h"

namespace candela::description::legacy {
namespace {

std::string old_name(const Object& object) {
  return fmt::format("{} 'mixture{}'", object.category, object.category);
}

// The weights, taken out of the properties: not negative, their sum not above 1; of phase functions 1.
Result<std::vector<double>> take_weights(Object& object, std::size_t parts, std::vector<Note>& notes) {
  const auto found = std::find_if(object.properties.begin(), object.properties.end(),
                                  [](const Property& property) { return property.name == "weights"; });
  if (found == object.properties.end() || !std::holds_alternative<std::string>(found->value))
    return error_at(object.where, old_name(object) + " lacks the string 'weights'");
  const Property property = std::move(*found);
  object.properties.erase(found);
  std::vector<double> weights;
  for (const std::string_view word : text::tokens(std::get<std::string>(property.value))) {
    const std::optional<double> weight = text::to_number(word);
    if (!weight || *weight < 0)
      return error_at(property.where,
                      fmt::format("{} is no weight of a {}", text::quote(word), object.category));
    weights.push_back(*weight);
  }
  if (weights.size() != parts || weights.empty())
    return error_at(property.where, fmt::format("{} has {} {}s but {} weights", old_name(object), parts,
                                                object.category, weights.size()));
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  if (!std::isfinite(sum)) return error_at(property.where, "the weights are too large");
  const bool must_be_one = object.category == "phase";
  if (must_be_one && !(sum > 0)) return error_at(property.where, "the weights are all 0");
  if (sum <= 1 && !must_be_one) return weights;
  if (sum > 1 + 1e-6 || (must_be_one && sum < 1 - 1e-6))
    notes.push_back({property.where, fmt::format("the weights' sum {} is {} 1: they are divided by it", sum,
                                                 sum > 1 ? "above" : "below")});
  for (double& weight : weights) weight /= sum;
  return weights;
}

// A new draft at the end, linked to.
Link add_part(std::vector<Draft>& drafts, std::string_view category, std::string_view plugin,
              const Location& where) {
  auto object = std::make_shared<Object>();
  object->category = std::string(category);
  object->plugin = std::string(plugin);
  object->where = where;
  drafts.push_back({std::move(object), {}});
  return {{}, where, drafts.size() - 1, false, {}};
}

}  // namespace

Result<void> split_mixture(std::vector<Draft>& drafts, std::size_t index, std::vector<Note>& notes) {
  constexpr std::size_t most = 100;  // each nests one deeper
  if (drafts[index].links.size() > most)
    return error_at(drafts[index].object->where,
                    fmt::format("{} has {} {}s, more than {}", old_name(*drafts[index].object),
                                drafts[index].links.size(), drafts[index].object->category, most));
  std::vector<Link> links = std::move(drafts[index].links);
  drafts[index].links.clear();
  CANDELA_ASSIGN(std::vector<double> weights, take_weights(*drafts[index].object, links.size(), notes));
  const Location where = drafts[index].object->where;
  const std::string category = drafts[index].object->category, blend_name = drafts[index].object->plugin;
  const double missing = 1 - std::accumulate(weights.begin(), weights.end(), 0.0);
  if (category == "phase" && weights.size() == 1) {
    links.push_back(add_part(drafts, category, "isotropic", where));
    weights.push_back(0);
  } else if (category == "bsdf" && (missing > 1e-6 || weights.size() == 1)) {
    links.push_back(add_part(drafts, category, "diffuse", where));
    drafts.back().object->properties.push_back({"reflectance", PropertyType::rgb, Rgb{}, where});
    weights.push_back(std::max(0.0, missing));
  }
  std::size_t blend = index;
  for (std::size_t i = 0; i + 1 < links.size(); ++i) {
    const double later =
        std::accumulate(weights.begin() + static_cast<std::ptrdiff_t>(i) + 1, weights.end(), 0.0);
    const double all = later + weights[i];
    drafts[blend].object->properties.push_back(
        {"weight", PropertyType::number, all > 0 ? later / all : 0.0, where});
    drafts[blend].links.push_back(links[i]);
    const bool last = i + 2 == links.size();
    const Link next = last ? links[i + 1] : add_part(drafts, category, blend_name, where);
    drafts[blend].links.push_back(next);
    blend = next.target;
  }
  return {};
}

}  // namespace candela::description::legacy
