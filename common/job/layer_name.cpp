#include "common/job/layer_name.h"

#include <fmt/format.h>

#include <algorithm>

namespace candela {
namespace {

bool is_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
}

}  // namespace

std::string fault_of_layer_name(std::string_view name) {
  if (name.empty()) return "it is empty";
  if (name.size() > kMaxLayerNameBytes) return fmt::format("it is longer than {} bytes", kMaxLayerNameBytes);
  const bool plain = std::all_of(name.begin(), name.end(), [](char c) {
    return is_letter(c) || (c >= '0' && c <= '9') || c == '_' || c == '-' || c == '.';
  });
  if (!plain) return "it has other characters than letters, digits, '_', '-' and '.'";
  if (!is_letter(name.front())) return "it does not begin with a letter";
  if (name.back() == '.' || name.find("..") != std::string_view::npos)
    return "a part between its dots is empty";
  if (name == kErrorLayer) return "the error estimate has that name";
  if (name == kVarianceLayer) return "the estimate of the variance has that name";
  return {};
}

std::string printable_layer_name(std::string_view name) {
  std::string out = "'";
  for (const char c : name.substr(0, kMaxLayerNameBytes)) out += c >= ' ' && c <= '~' ? c : '?';
  return out + (name.size() > kMaxLayerNameBytes ? "...'" : "'");
}

}  // namespace candela
