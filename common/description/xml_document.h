// One XML file, parsed by pugixml, with the lines of its nodes.
#pragma once

#include <cstddef>
#include <memory>
#include <pugixml.hpp>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/description/object.h"
#include "common/description/reading_budget.h"

namespace candela::description {

class XmlDocument {
 public:
  static constexpr std::size_t max_bytes = std::size_t{256} << 20;

  // Errors name the file by its key, and the line of what is not well-formed. UTF-8 only.
  // The tree counts in the budget, which outlives the document.
  static Result<std::unique_ptr<XmlDocument>> parse(const std::string& key, std::string_view bytes,
                                                    ReadingBudget& budget);

  const std::string& key() const { return key_; }
  pugi::xml_node root() const { return root_; }  // the one root element
  Location where(const pugi::xml_node& node) const;

 private:
  int line_at(std::ptrdiff_t offset) const;

  std::string key_;
  Charge charge_;
  std::vector<std::size_t> line_ends_;  // offsets of '\n'
  pugi::xml_document document_;
  pugi::xml_node root_;
};

}  // namespace candela::description
