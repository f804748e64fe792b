#include "common/description/obj_outline.h"

#include <algorithm>
#include <cstring>
#include <unordered_map>
#include <unordered_set>

#include "common/base/work_monitor.h"
#include "common/description/text.h"

namespace candela::description {
namespace {

constexpr std::string_view kBlanks = " \t\r\v\f";

std::string_view trimmed(std::string_view text) {
  const std::size_t begin = text.find_first_not_of(kBlanks);
  if (begin == text.npos) return {};
  return text.substr(begin, text.find_last_not_of(kBlanks) + 1 - begin);
}

// The words behind a keyword at the beginning of a line; body(words) for each such line.
template <class Body>
void for_lines_of(std::string_view bytes, std::string_view keyword, const Body& body) {
  const char* const end = bytes.data() + bytes.size();
  const char* at = bytes.data();
  while (at < end) {
    const auto* const found = static_cast<const char*>(
        ::memmem(at, static_cast<std::size_t>(end - at), keyword.data(), keyword.size()));
    if (found == nullptr) return;
    work_step(static_cast<std::size_t>(found - bytes.data()));
    at = found + keyword.size();
    const char* before = found;
    while (before > bytes.data() && kBlanks.find(before[-1]) != kBlanks.npos) --before;
    const bool begins_line = before == bytes.data() || before[-1] == '\n' || before[-1] == '\xbf';
    if (!begins_line || at == end || kBlanks.find(*at) == kBlanks.npos) continue;
    const auto* const stop =
        static_cast<const char*>(std::memchr(at, '\n', static_cast<std::size_t>(end - at)));
    const char* const line_end = stop != nullptr ? stop : end;
    body(trimmed({at, static_cast<std::size_t>(line_end - at)}));
    at = line_end;
  }
}

std::array<double, 3> color_of(std::string_view words) {
  std::array<double, 3> color{};
  const std::vector<std::string_view> numbers = text::tokens(words);
  for (std::size_t i = 0; i < 3 && i < numbers.size(); ++i)
    color[i] = text::to_number(numbers[i]).value_or(0);
  return color;
}

double number_of(std::string_view words) {
  const std::vector<std::string_view> numbers = text::tokens(words);
  return numbers.empty() ? 0 : text::to_number(numbers[0]).value_or(0);
}

// The name of an image, behind options such as "-bm 0.3", if there are any.
std::string image_of(std::string_view words) {
  if (words.starts_with('-')) words = words.substr(words.find_last_of(kBlanks) + 1);
  std::string name(words);
  std::replace(name.begin(), name.end(), '\\', '/');
  return name;
}

void read_statement(std::string_view keyword, std::string_view words, ObjMaterial& material) {
  if (keyword == "Kd") material.diffuse = color_of(words);
  if (keyword == "Ks") material.specular = color_of(words);
  if (keyword == "Ns") material.exponent = number_of(words);
  if (keyword == "illum") material.illumination = static_cast<int>(std::clamp(number_of(words), 0.0, 99.0));
  if (keyword == "map_Kd") material.diffuse_map = image_of(words);
  if (keyword == "map_Ks") material.specular_map = image_of(words);
  if (keyword == "bump") material.bump_map = image_of(words);
  if (keyword == "map_d") material.opacity_map = image_of(words);
  if (keyword != "d") return;
  material.opacity_map.clear();
  material.opacity = number_of(words);
  if (*material.opacity == 1) material.opacity.reset();
}

}  // namespace

ObjOutline outline_of_obj(std::string_view bytes) {
  ObjOutline outline;
  std::unordered_set<std::string_view> known;
  for_lines_of(bytes, "mtllib", [&](std::string_view words) { outline.library = words; });
  for_lines_of(bytes, "usemtl", [&](std::string_view words) {
    if (outline.last_material == words && !outline.materials.empty()) return;
    outline.last_material = words;
    if (known.insert(words).second) outline.materials.emplace_back(words);
  });
  return outline;
}

std::vector<ObjMaterial> read_obj_materials(std::string_view bytes) {
  std::vector<ObjMaterial> materials;
  std::unordered_map<std::string_view, std::size_t> places;
  if (bytes.starts_with("\xef\xbb\xbf")) bytes.remove_prefix(3);
  ObjMaterial* current = nullptr;
  for (int line = 1; !bytes.empty(); ++line) {
    const std::size_t end = std::min(bytes.find('\n'), bytes.size());
    const std::string_view text = trimmed(bytes.substr(0, end));
    bytes.remove_prefix(std::min(end + 1, bytes.size()));
    const std::size_t gap = std::min(text.find_first_of(kBlanks), text.size());
    const std::string_view keyword = text.substr(0, gap), words = trimmed(text.substr(gap));
    if (keyword == "newmtl") {
      const auto [place, is_new] = places.emplace(words, materials.size());
      if (is_new) materials.emplace_back();
      current = &materials[place->second];
      *current = {};
      current->name = words;
      current->line = line;
    } else if (current != nullptr) {
      read_statement(keyword, words, *current);
    }
  }
  return materials;
}

}  // namespace candela::description
