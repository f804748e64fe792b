// Decision::bytes: numbers to the last bit, with the kind and form of the decision before them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "common/base/result.h"

namespace candela::integrators {

class DecisionWriter {
 public:
  // kind: four characters, the last of which is the version of what follows.
  explicit DecisionWriter(std::string_view kind) : bytes_(kind) {}
  void count(std::uint64_t value);
  void real(double value);
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

// Reads back what a writer of the same kind was given. After a number that is missing or out of range all are
// the least of theirs, and done() says why.
class DecisionReader {
 public:
  DecisionReader(std::string_view bytes, std::string_view kind);
  std::uint64_t count(std::uint64_t end);      // in [0, end)
  double real(double least, double greatest);  // of these, or between them
  // A fault that the numbers have together; the first fault stays.
  void fail(std::string why) {
    if (fault_.empty()) fault_ = std::move(why);
  }
  // True if bytes are left, and no number was missing or out of range.
  bool more() const { return fault_.empty() && !rest_.empty(); }
  // Fails (input) unless all numbers were there, in their ranges, and no byte is left.
  Result<void> done() const;

 private:
  std::uint64_t word();
  std::string_view rest_;
  std::string fault_;  // the first; empty: none
};

}  // namespace candela::integrators
