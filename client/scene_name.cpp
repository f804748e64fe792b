#include "client/scene_name.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>

#include "client/values.h"
#include "common/base/text.h"
#include "common/job/job.h"

namespace candela::client {
namespace {

std::string lower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// Without what tells versions and frames apart: scene_v3, scene-2, scene.0001.
std::string_view without_number(std::string_view text) {
  const auto end = text.find_last_not_of("0123456789");
  text = text.substr(0, end == std::string_view::npos ? 0 : end + 1);
  if (text.size() > 1 && text.ends_with('v') &&
      !std::isalnum(static_cast<unsigned char>(text[text.size() - 2])))
    text.remove_suffix(1);
  while (!text.empty() && (text.back() == '.' || text.back() == '_' || text.back() == '-'))
    text.remove_suffix(1);
  return text;
}

bool says_nothing(const std::string& name, auto& generic) {
  const std::string base(without_number(lower(name)));
  return std::find(generic.begin(), generic.end(), base) != generic.end();
}

constexpr std::array<std::string_view, 8> kGenericFiles = {"scene", "main",     "index", "default",
                                                           "input", "untitled", "test",  ""};
constexpr std::array<std::string_view, 9> kGenericFolders = {"scene", "scenes", "tmp",    "temp", "xml",
                                                             "pbrt",  "data",   "render", ""};

}  // namespace

std::string scene_name(const std::filesystem::path& scene_file) {
  const std::string stem = scene_file.stem().string();
  std::error_code code;
  const std::filesystem::path whole = std::filesystem::absolute(scene_file, code).lexically_normal();
  const std::string folder = whole.parent_path().filename().string();
  std::string name =
      says_nothing(stem, kGenericFiles) && !says_nothing(folder, kGenericFolders) ? folder : stem;
  if (name.empty() || !is_utf8(name)) name = "scene";
  name = std::string(name.substr(0, Limits::max_name_bytes));
  while (!is_utf8(name)) name.pop_back();
  return name;
}

std::string file_name_of(std::string_view name) {
  std::string out;
  for (const char c : name) out += c == '/' || static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '_' : c;
  if (out.empty() || out.starts_with('.') || out.starts_with('-')) out.insert(out.begin(), '_');
  return out;
}

bool has_frame(std::string_view pattern) {
  return pattern.find("{frame}") != std::string_view::npos ||
         pattern.find("{frame:") != std::string_view::npos;
}

Result<std::string> fill_pattern(std::string_view pattern, const std::map<std::string, std::string>& words,
                                 std::optional<std::int64_t> frame, std::string_view option) {
  constexpr std::uint64_t kMaxDigits = 20;
  std::string out;
  for (std::size_t at = 0; at < pattern.size();) {
    const std::size_t close = pattern[at] == '{' ? pattern.find('}', at) : std::string_view::npos;
    const std::string_view word =
        close == std::string_view::npos ? std::string_view() : pattern.substr(at + 1, close - at - 1);
    const auto found = words.find(std::string(word));
    if (found != words.end() && !word.empty()) {
      out += found->second;
    } else if (frame && word == "frame") {
      out += fmt::format("{}", *frame);
    } else if (frame && word.starts_with("frame:")) {
      const auto digits = parse_count(word.substr(6), option, 1, kMaxDigits);
      if (!digits.ok())
        return usage_error(fmt::format("'{{{}}}' has no number of digits", printable(word)))
            .with_field(std::string(option))
            .with_mend("write {frame:4} for 0001");
      out += fmt::format("{:0{}}", *frame, *digits + (*frame < 0 ? 1 : 0));
    } else {
      out += pattern[at++];
      continue;
    }
    at = close + 1;
  }
  return out;
}

}  // namespace candela::client
