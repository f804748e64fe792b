// Tables for people: columns as wide as their widest cell.
#pragma once

#include <string>
#include <vector>

namespace candela::client {

class Table {
 public:
  // A title that begins with '>' is of a column of numbers, aligned right.
  explicit Table(std::vector<std::string> titles);
  // Precondition: one cell for each title; printable texts.
  void add(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }
  std::string text() const;  // the last column is not padded

 private:
  std::vector<bool> right_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace candela::client
