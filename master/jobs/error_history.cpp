#include "master/jobs/error_history.h"

#include <bit>

#include "common/film/codec.h"

namespace candela::master {
namespace {

constexpr std::uint32_t kMaxPrefixes = 1 << 12;  // 2^40 rounds have 600

}  // namespace

void ErrorHistory::decide(const DecidedPrefix& prefix) {
  while (!prefixes.empty() && prefixes.back().rounds >= prefix.rounds) prefixes.pop_back();
  prefixes.push_back(prefix);
}

// The number of prefixes (u32), each with its rounds (u64) and the error's upper end (a double's bits, u64).
std::string ErrorHistory::serialise() const {
  std::string out;
  film::put_u32(out, static_cast<std::uint32_t>(prefixes.size()));
  for (const DecidedPrefix& prefix : prefixes) {
    film::put_u64(out, prefix.rounds);
    film::put_u64(out, std::bit_cast<std::uint64_t>(prefix.relmse_upper));
  }
  return out;
}

Result<ErrorHistory> ErrorHistory::parse(std::string_view bytes) {
  const auto bad = [](std::string_view text) {
    return input_error("the history of the error " + std::string(text)).with_field("error_history");
  };
  ErrorHistory out;
  film::Reader reader(bytes);
  const std::uint32_t count = reader.u32();
  if (!reader.ok() || count > kMaxPrefixes) return bad("ends before its prefixes");
  for (std::uint32_t i = 0; i < count; ++i) {
    DecidedPrefix prefix;
    prefix.rounds = reader.u64();
    prefix.relmse_upper = std::bit_cast<double>(reader.u64());
    if (!reader.ok()) return bad("ends in its prefixes");
    if (i > 0 && prefix.rounds <= out.prefixes.back().rounds) return bad("has prefixes out of order");
    out.prefixes.push_back(prefix);
  }
  return out;
}

ErrorHistory ErrorHistory::of(const std::string* bytes) {
  if (bytes == nullptr) return {};
  Result<ErrorHistory> history = parse(*bytes);
  return history.ok() ? std::move(*history) : ErrorHistory();
}

}  // namespace candela::master
