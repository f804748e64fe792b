#include "common/base/shell_words.h"

namespace candela {
namespace {

constexpr std::string_view kPlain =
    "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./:,@%";

}  // namespace

std::string shell_quote(std::string_view word) {
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string_view::npos) return std::string(word);
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return quoted + "'";
}

std::string shell_line(const std::vector<std::string>& words) {
  std::string line;
  for (const std::string& word : words) {
    if (!line.empty()) line += ' ';
    line += shell_quote(word);
  }
  return line;
}

Result<std::vector<std::string>> split_shell_line(std::string_view line) {
  std::vector<std::string> words;
  bool inside = false;  // a word
  for (std::size_t at = 0; at < line.size(); ++at) {
    const char c = line[at];
    if (c == ' ') {
      inside = false;
      continue;
    }
    if (!inside) words.emplace_back();
    inside = true;
    if (c == '\'') {
      const std::size_t end = line.find('\'', at + 1);
      if (end == std::string_view::npos) return input_error("a quote does not end");
      words.back() += line.substr(at + 1, end - at - 1);
      at = end;
    } else if (c == '\\' && at + 1 < line.size() && line[at + 1] == '\'') {
      words.back() += '\'';
      ++at;
    } else if (kPlain.find(c) != std::string_view::npos) {
      words.back() += c;
    } else {
      return input_error("a character is not quoted that means something to a shell");
    }
  }
  return words;
}

}  // namespace candela
