#include "common/film/layers.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace candela::film {

Result<void> validate_layer_names(const std::vector<std::string>& names) {
  if (names.size() > kMaxLayers - 1)
    return usage_error(
               fmt::format("{} layers beside the image are more than {}", names.size(), kMaxLayers - 1))
        .with_field("layers")
        .with_mend("ask for fewer, with shorter paths or a choice of techniques");
  std::set<std::string_view> seen;
  for (const std::string& name : names) {
    if (const std::string fault = fault_of_layer_name(name); !fault.empty())
      return usage_error(fmt::format("a layer cannot be called {}: {}", printable_layer_name(name), fault))
          .with_field("layers");
    if (!seen.insert(name).second)
      return usage_error(fmt::format("two layers are called '{}'", name)).with_field("layers");
  }
  return {};
}

Result<Layout> make_layout(std::uint32_t width, std::uint32_t height, const std::vector<std::string>& names) {
  CANDELA_TRY(validate_layer_names(names));
  const Layout layout{width, height, 1 + static_cast<std::uint32_t>(names.size())};
  if (!names.empty() && layout.pixel_count() * layout.layers > kMaxLayerPixels)
    return usage_error(fmt::format("a film of {} x {} pixels cannot have {} layers beside the image", width,
                                   height, names.size()))
        .with_field("layers")
        .with_mend(fmt::format("at most {} fit: ask for fewer, or for a smaller image",
                               kMaxLayerPixels / std::max<std::uint64_t>(1, layout.pixel_count()) - 1));
  return layout;
}

}  // namespace candela::film
