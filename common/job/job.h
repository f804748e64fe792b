// A job in plain structures: the part of the wire contract the renderer and the film need, without
// protobuf. Conversions with validation are in common/wire.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace candela {

using SettingsMap = std::map<std::string, std::string>;

// All that the pixels depend on, beside the scene bundle.
// The part of a larger image that a job renders: its size is the job's width and height.
struct Crop {
  std::uint32_t x = 0, y = 0;                       // of its upper left pixel
  std::uint32_t whole_width = 0, whole_height = 0;  // of the image
  bool operator==(const Crop&) const = default;
};

struct JobSettings {
  std::string integrator = "path";
  SettingsMap integrator_settings;
  std::uint32_t width = 0;   // pixels
  std::uint32_t height = 0;  // pixels
  std::string filter = "box";
  SettingsMap filter_settings;
  std::string sampler = "sobol";
  std::uint64_t seed = 0;
  std::string isa = "avx2";  // the ISA Embree may use
  std::string aovs = {};     // "NAME:KIND,..." (common/job/aov.h); empty: none
  std::optional<Crop> crop = {};
  std::string layers = {};  // by light path expressions (common/letters/request.h); empty: none
  std::string edits = {};   // of light transport, JSON (common/edits/edits.h); empty: none
};

struct StopRule {
  std::uint64_t iterations = 0;  // 0: no limit
  double time_seconds = 0;       // 0: no limit
  double relmse = 0;             // 0: no limit
};

// Iteration i of a job belongs to half i % 2 and has sequence index i / 2 in it. The halves are independent
// estimates (each its own scramble of the low-discrepancy sequence), and the image does not depend on how
// iterations are cut into units. A job of N iterations has indices [0, (N+1)/2) in half 0 and [0, N/2) in
// half 1.
// A job of Markov chains has two more kinds: bootstrap samples [begin, end) (half 0), and chain segments,
// whose indices common/chains/chains.h explains.
struct Unit {
  enum class Kind { pilot, iterations, bootstrap, segments };
  Kind kind = Kind::iterations;
  std::uint32_t half = 0;   // 0 or 1
  std::uint64_t begin = 0;  // sequence indices [begin, end) of the half
  std::uint64_t end = 0;
};

// Units of these kinds bring a film.
constexpr bool makes_film(Unit::Kind kind) {
  return kind == Unit::Kind::iterations || kind == Unit::Kind::segments;
}

// The number of an iteration within its job, counted over both halves: what schedules (the radius of
// iteration i) are computed from. Inverse of half i % 2, index i / 2.
constexpr std::uint64_t global_iteration(std::uint32_t half, std::uint64_t index) {
  return 2 * index + half;
}

// State a unit starts from, decided by the pilot unit, the same for the whole job; for a job of Markov chains
// the bootstrap decides the numbers.
struct NamedState {
  int film_scale_log2 = 0;
  double bootstrap_b = 0;    // b0 of a job of chains; 0 for others
  std::string decided = {};  // what the integrator decided in the pilot: its own bytes, for most none
  bool operator==(const NamedState&) const = default;
};

// Work that a job of Markov chains asks of the farm beside iterations. Decided by its settings alone.
struct ChainPlan {
  std::uint32_t chains = 0;  // even
  std::uint64_t bootstrap_samples = 0;
  std::uint64_t segment_mutations = 0;  // of one chain in one segment
};

// Limits that both ends enforce.
struct Limits {
  static constexpr std::uint32_t max_extent = 65536;       // pixels a side
  static constexpr std::uint64_t max_pixels = 1ULL << 28;  // 268 million
  static constexpr std::uint64_t max_iterations = 1ULL << 40;
  static constexpr std::uint64_t max_bundle_files = 100000;
  static constexpr std::uint64_t max_blob_bytes = 1ULL << 36;  // 64 GiB
  static constexpr std::uint64_t max_bundle_bytes = 1ULL << 40;
  static constexpr std::uint32_t max_chunk_bytes = 1U << 20;
  static constexpr std::uint32_t max_name_bytes = 256;
  static constexpr std::uint32_t max_settings = 256;
  static constexpr std::uint32_t max_setting_bytes = 4096;
  static constexpr std::uint32_t max_path_bytes = 4096;
  static constexpr std::uint32_t max_decided_bytes = 4096;  // NamedState::decided
};

}  // namespace candela
