#include "common/film/layers.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace candela::film {
namespace {

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

// Why the name cannot name a layer; empty if it can.
std::string fault_of(const std::string& name) {
  if (name.empty()) return "it is empty";
  if (name.size() > kMaxLayerNameBytes) return fmt::format("it is longer than {} bytes", kMaxLayerNameBytes);
  const bool plain = std::all_of(name.begin(), name.end(), [](char c) {
    return is_letter(c) || (c >= '0' && c <= '9') || c == '_' || c == '-' || c == '.';
  });
  if (!plain) return "it has other characters than letters, digits, '_', '-' and '.'";
  if (!is_letter(name.front())) return "it does not begin with a letter";
  if (name.back() == '.' || name.find("..") != std::string::npos) return "a part between its dots is empty";
  if (name == kErrorLayer) return "the error estimate has that name";
  return {};
}

// The name for a message: it may come from a peer, and be anything.
std::string printable(const std::string& name) {
  std::string out = "'";
  for (const char c : name.substr(0, kMaxLayerNameBytes)) out += c >= ' ' && c <= '~' ? c : '?';
  return out + (name.size() > kMaxLayerNameBytes ? "...'" : "'");
}

}  // namespace

Result<void> validate_layer_names(const std::vector<std::string>& names) {
  if (names.size() > kMaxLayers - 1)
    return usage_error(
               fmt::format("{} layers beside the image are more than {}", names.size(), kMaxLayers - 1))
        .with_field("layers")
        .with_mend("ask for fewer, with shorter paths or a choice of techniques");
  std::set<std::string_view> seen;
  for (const std::string& name : names) {
    if (const std::string fault = fault_of(name); !fault.empty())
      return usage_error(fmt::format("a layer cannot be called {}: {}", printable(name), fault))
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
