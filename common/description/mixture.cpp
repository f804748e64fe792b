#include "common/description/mixture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "common/description/check.h"
#include "common/description/text.h"

namespace candela::description::legacy {
namespace {

// The weights, taken out of the properties: not negative, their sum not above 1.
Result<std::vector<double>> take_weights(Object& object, std::size_t bsdfs, std::vector<Note>& notes) {
  const auto found = std::find_if(object.properties.begin(), object.properties.end(),
                                  [](const Property& property) { return property.name == "weights"; });
  if (found == object.properties.end() || !std::holds_alternative<std::string>(found->value))
    return error_at(object.where, "bsdf 'mixturebsdf' lacks the string 'weights'");
  const Property property = std::move(*found);
  object.properties.erase(found);
  std::vector<double> weights;
  for (const std::string_view word : text::tokens(std::get<std::string>(property.value))) {
    const std::optional<double> weight = text::to_number(word);
    if (!weight || *weight < 0)
      return error_at(property.where, fmt::format("{} is no weight of a bsdf", text::quote(word)));
    weights.push_back(*weight);
  }
  if (weights.size() != bsdfs || weights.empty())
    return error_at(property.where,
                    fmt::format("bsdf 'mixturebsdf' has {} bsdfs but {} weights", bsdfs, weights.size()));
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  if (!std::isfinite(sum)) return error_at(property.where, "the weights are too large");
  if (sum <= 1) return weights;
  if (sum > 1 + 1e-6)
    notes.push_back(
        {property.where, fmt::format("the weights' sum {} is above 1: they are divided by it", sum)});
  for (double& weight : weights) weight /= sum;
  return weights;
}

// A new draft of a bsdf at the end, linked to.
Link add_bsdf(std::vector<Draft>& drafts, std::string_view plugin, const Location& where) {
  auto object = std::make_shared<Object>();
  object->category = "bsdf";
  object->plugin = std::string(plugin);
  object->where = where;
  drafts.push_back({std::move(object), {}});
  return {{}, where, drafts.size() - 1, false, {}};
}

}  // namespace

Result<void> split_mixture(std::vector<Draft>& drafts, std::size_t index, std::vector<Note>& notes) {
  constexpr std::size_t most = 100;  // each nests one deeper
  if (drafts[index].links.size() > most)
    return error_at(drafts[index].object->where, fmt::format("bsdf 'mixturebsdf' has {} bsdfs, more than {}",
                                                             drafts[index].links.size(), most));
  std::vector<Link> links = std::move(drafts[index].links);
  drafts[index].links.clear();
  CANDELA_ASSIGN(std::vector<double> weights, take_weights(*drafts[index].object, links.size(), notes));
  const Location where = drafts[index].object->where;
  const double missing = 1 - std::accumulate(weights.begin(), weights.end(), 0.0);
  if (missing > 1e-6 || weights.size() == 1) {
    links.push_back(add_bsdf(drafts, "diffuse", where));
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
    const Link next = last ? links[i + 1] : add_bsdf(drafts, "blendbsdf", where);
    drafts[blend].links.push_back(next);
    blend = next.target;
  }
  return {};
}

}  // namespace candela::description::legacy
