#include "worker/integrators/decision_bytes.h"

#include <fmt/format.h>

#include <bit>

#include "common/film/codec.h"

namespace candela::integrators {

void DecisionWriter::count(std::uint64_t value) {
  film::put_u64(bytes_, value);
}

void DecisionWriter::real(double value) {
  count(std::bit_cast<std::uint64_t>(value));
}

DecisionReader::DecisionReader(std::string_view bytes, std::string_view kind) : rest_(bytes) {
  if (bytes.empty())
    fault_ = "it is missing: the pilot was of a build that kept none";
  else if (!bytes.starts_with(kind))
    fault_ = fmt::format("it is not of the kind {}, but of another integrator or build", kind);
  else
    rest_.remove_prefix(kind.size());
}

std::uint64_t DecisionReader::word() {
  if (!fault_.empty()) return 0;
  film::Reader reader(rest_);
  const std::uint64_t value = reader.u64();
  if (!reader.ok()) {
    fault_ = "it is cut short";
    return 0;
  }
  rest_ = reader.rest();
  return value;
}

std::uint64_t DecisionReader::count(std::uint64_t end) {
  const std::uint64_t value = word();
  if (!fault_.empty()) return 0;
  if (value < end) return value;
  fault_ = fmt::format("{} is not below {}", value, end);
  return 0;
}

double DecisionReader::real(double least, double greatest) {
  const auto value = std::bit_cast<double>(word());
  if (!fault_.empty()) return least;
  if (value >= least && value <= greatest) return value;
  fault_ = fmt::format("{} is not within {} and {}", value, least, greatest);
  return least;
}

Result<void> DecisionReader::done() const {
  std::string why = fault_;
  if (why.empty() && !rest_.empty()) why = fmt::format("{} bytes too many", rest_.size());
  if (why.empty()) return {};
  return input_error("the pilot's decision cannot be used: " + why)
      .with_field("named_state.decided")
      .with_mend("install one build on all machines, and submit the job again");
}

}  // namespace candela::integrators
