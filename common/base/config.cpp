// Configuration files (TOML) and environment, flattened to "section.key" -> text with where it was written.
#include "common/base/config.h"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "common/base/files.h"
#include "common/base/nearest_name.h"

namespace candela {
namespace {

constexpr std::uint64_t kFileLimitBytes = 1 << 20;

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

// "worker.cache-size" -> "CANDELA_WORKER_CACHE_SIZE"
std::string variable_name(const std::string& key) {
  std::string name = "CANDELA_";
  for (const char c : key) {
    if (c == '.' || c == '-')
      name += '_';
    else
      name += static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
  }
  return name;
}

int line_of(const toml::node& node) {
  return static_cast<int>(node.source().begin.line);
}

Result<std::string> scalar_text(const toml::node& node, const std::string& key, const std::string& file) {
  if (const auto* text = node.as_string()) return text->get();
  if (const auto* number = node.as_integer()) return fmt::format("{}", number->get());
  if (const auto* number = node.as_floating_point()) return fmt::format("{}", number->get());
  if (const auto* flag = node.as_boolean()) return std::string(flag->get() ? "true" : "false");
  return input_error(fmt::format("'{}' must be a string, a number or a boolean", key))
      .at(file, line_of(node));
}

// Debian builds the library with exceptions; they end here.
Result<toml::table> parse_toml(const std::string& text, const std::string& file) {
  try {
    return toml::table(toml::parse(text, file));
  } catch (const toml::parse_error& error) {
    std::string description(error.description());
    for (char& c : description) c = c == '\n' || c == '\r' ? ' ' : c;
    return input_error(description).at(file, static_cast<int>(error.source().begin.line));
  }
}

// An error at `origin` ("file:line") with the nearest of `known`.
Error unknown_name(std::string message, const std::string& origin, const std::string& name,
                   const std::vector<std::string>& known) {
  const auto colon = origin.rfind(':');
  Error error =
      input_error(std::move(message)).at(origin.substr(0, colon), std::atoi(origin.c_str() + colon + 1));
  const std::vector<std::string_view> names(known.begin(), known.end());
  error.mend = did_you_mean(nearest_name(name, names));
  return error;
}

}  // namespace

Result<Config> Config::load() {
  std::vector<std::filesystem::path> files;  // the weakest first
  const std::string only = environment("CANDELA_CONFIG");
  if (!only.empty()) {
    files.emplace_back(only);
  } else {
    files.emplace_back("/etc/candela/config.toml");
    std::string home = environment("XDG_CONFIG_HOME");
    if (home.empty() && !environment("HOME").empty()) home = environment("HOME") + "/.config";
    if (!home.empty()) files.push_back(std::filesystem::path(home) / "candela" / "config.toml");
  }

  Config config;
  const auto read = [&config](const std::filesystem::path& path) -> Result<void> {
    CANDELA_ASSIGN(const std::string text, read_file(path, kFileLimitBytes));
    const std::string file = path.string();
    CANDELA_ASSIGN(const toml::table parsed, parse_toml(text, file));
    for (const auto& [name, node] : parsed) {
      const std::string key(name.str());
      if (const toml::table* section = node.as_table()) {
        for (const auto& [inner_name, inner] : *section) {
          const std::string inner_key = key + "." + std::string(inner_name.str());
          CANDELA_ASSIGN(std::string value, scalar_text(inner, inner_key, file));
          config.entries_[inner_key] = {std::move(value), fmt::format("{}:{}", file, line_of(inner))};
        }
      } else {
        CANDELA_ASSIGN(std::string value, scalar_text(node, key, file));
        config.entries_[key] = {std::move(value), fmt::format("{}:{}", file, line_of(node))};
      }
    }
    return {};
  };
  for (const auto& path : files) {
    std::error_code code;
    if (only.empty() && !std::filesystem::exists(path, code)) continue;
    if (auto done = read(path); !done.ok()) {
      Error error = std::move(done).error();
      if (!only.empty()) error.field = "$CANDELA_CONFIG";
      return error;
    }
  }
  return config;
}

std::optional<std::string> Config::get(const std::string& key) const {
  if (std::string value = environment(variable_name(key).c_str()); !value.empty()) return value;
  if (const auto found = entries_.find(key); found != entries_.end()) return found->second.value;
  return std::nullopt;
}

std::string Config::origin(const std::string& key) const {
  const std::string variable = variable_name(key);
  if (!environment(variable.c_str()).empty()) return "$" + variable;
  if (const auto found = entries_.find(key); found != entries_.end()) return found->second.origin;
  return {};
}

Result<void> Config::check_section(const std::string& section, const std::vector<std::string>& known) const {
  for (const auto& [key, entry] : entries_) {
    if (!key.starts_with(section + ".")) continue;
    const std::string name = key.substr(section.size() + 1);
    if (std::find(known.begin(), known.end(), name) == known.end())
      return unknown_name(fmt::format("unknown key '{}' in [{}]", name, section), entry.origin, name, known);
  }
  return {};
}

Result<void> Config::check_shared() const {
  const std::vector<std::string> sections = {"client", "master", "worker"};
  const std::vector<std::string> keys = {
      "cache",     "cache-size", "data",     "give-up",      "insecure",  "listen",         "log-format",
      "log-level", "master",     "name",     "scene-memory", "scratch",   "texture-memory", "threads",
      "timeout",   "tls-ca",     "tls-cert", "tls-key",      "token-file"};
  for (const auto& [key, entry] : entries_) {
    const std::size_t dot = key.find('.');
    const std::string name = key.substr(0, dot);
    const bool section = dot != std::string::npos;
    const std::vector<std::string>& known = section ? sections : keys;
    if (std::find(known.begin(), known.end(), name) == known.end())
      return unknown_name(
          section ? fmt::format("unknown section [{}]", name) : fmt::format("unknown key '{}'", name),
          entry.origin, name, known);
  }
  return {};
}

}  // namespace candela
