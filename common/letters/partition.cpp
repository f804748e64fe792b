#include "common/letters/partition.h"

#include <algorithm>

#include "common/letters/request.h"

namespace candela::letters {

std::vector<std::string> partition_of(std::string_view request, std::span<const std::string> layers) {
  const Result<LayerRequest> read = parse_layer_request(request);
  if (!read || (!read->partition && !read->light_groups)) return {};
  std::vector<std::string> names;
  for (const std::string& layer : layers) {
    const bool written = std::any_of(read->layers.begin(), read->layers.end(),
                                     [&](const NamedExpression& one) { return one.name == layer; });
    const bool group = read->light_groups && !written && layer.starts_with(kLightGroupPrefix);
    if (group || (written && read->partition)) names.push_back(layer);
  }
  return names;
}

}  // namespace candela::letters
