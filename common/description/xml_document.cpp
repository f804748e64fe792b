#include "common/description/xml_document.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/description/text.h"

namespace candela::description {

namespace {

// Counts the places where `second` or `third` follows `first`; blanks may stand between them.
std::size_t count_pairs(std::string_view bytes, char first, char second, char third) {
  std::size_t count = 0;
  for (std::size_t at = bytes.find(first); at != std::string_view::npos; at = bytes.find(first, at + 1)) {
    const std::size_t next = bytes.find_first_not_of(" \t\r\n", at + 1);
    if (next == std::string_view::npos) break;
    if (bytes[next] == second || bytes[next] == third) ++count;
    if (bytes[next] != first) at = next - 1;
  }
  return count;
}

// pugixml keeps a copy of the text, and for each element, text and attribute a record of this size.
constexpr std::size_t node_bytes = 64, attribute_bytes = 40;

std::uint64_t tree_bytes(std::string_view bytes, std::size_t lines) {
  const auto tags = static_cast<std::size_t>(std::count(bytes.begin(), bytes.end(), '<'));
  return bytes.size() + lines * sizeof(std::size_t) + tags * node_bytes +
         count_pairs(bytes, '=', '"', '\'') * attribute_bytes;
}

}  // namespace

Result<std::unique_ptr<XmlDocument>> XmlDocument::parse(const std::string& key, std::string_view bytes,
                                                        ReadingBudget& budget) {
  if (bytes.size() > max_bytes)
    return input_error(
               fmt::format("the file has {} bytes, more than the limit of {}", bytes.size(), max_bytes))
        .at(key, 0);
  if (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF"))
    return input_error("the file is UTF-16").at(key, 1).with_mend("save it as UTF-8");

  auto document = std::make_unique<XmlDocument>();
  document->key_ = key;
  const auto lines = static_cast<std::size_t>(std::count(bytes.begin(), bytes.end(), '\n'));
  document->charge_ = Charge(budget);
  CANDELA_TRY(document->charge_.add(tree_bytes(bytes, lines), {key, 0}, "the file's elements"));
  document->line_ends_.reserve(lines);
  for (std::size_t at = bytes.find('\n'); at != std::string_view::npos; at = bytes.find('\n', at + 1))
    document->line_ends_.push_back(at);
  if (const std::size_t nul = bytes.find('\0'); nul != std::string_view::npos)
    return input_error("the file has a zero byte, so it is not XML")
        .at(key, document->line_at(static_cast<std::ptrdiff_t>(nul)));

  const pugi::xml_parse_result result =
      document->document_.load_buffer(bytes.data(), bytes.size(), pugi::parse_default, pugi::encoding_utf8);
  if (result.status == pugi::status_out_of_memory)
    return resource_error("not enough memory to parse").at(key, 0);
  if (!result) {
    std::string what = text::lower(result.description());
    return input_error(fmt::format("not well-formed XML: {}", what))
        .at(key, document->line_at(result.offset));
  }
  for (const pugi::xml_node& node : document->document_.children()) {
    if (node.type() != pugi::node_element) continue;
    if (document->root_) {
      const Location where = document->where(node);
      return input_error(fmt::format("a second root element <{}>", node.name())).at(where.file, where.line);
    }
    document->root_ = node;
  }
  if (!document->root_) return input_error("not well-formed XML: no root element").at(key, 1);
  return document;
}

int XmlDocument::line_at(std::ptrdiff_t offset) const {
  const auto before = std::lower_bound(line_ends_.begin(), line_ends_.end(),
                                       static_cast<std::size_t>(std::max<std::ptrdiff_t>(offset, 0)));
  return static_cast<int>(before - line_ends_.begin()) + 1;
}

Location XmlDocument::where(const pugi::xml_node& node) const {
  return {key_, line_at(node.offset_debug())};
}

}  // namespace candela::description
