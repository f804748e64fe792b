// Sums of contributions by the strings of their paths, and the paths that stand for them.
//
// Key paths are a sample without replacement, by contribution: of all paths those with the largest u^(1/w), u
// a uniform number of the path, w its contribution [Efraimidis and Spirakis 2006]. So neither threads nor
// the order of tasks change the sample.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/letters/request.h"
#include "worker/inspect/session.h"

namespace candela::inspect {

// A path's vertices as numbers, from the light to the eye: token_of().
using PathString = std::u32string;

struct Token {
  letters::Letter letter = letters::Letter::lamp;  // by objects: diffuse stands for all surfaces
  letters::Side side = letters::Side::none;        // by objects: none
  std::uint32_t object = letters::kNoObject;       // by objects alone
};
char32_t code_of(const Token& token);
Token token_of(char32_t code);

struct KeyPath {
  double rank = 0;  // the larger, the sooner it is kept
  Spectrum value;   // that it brings to the sum over pixels and samples
  int channel = 0;  // whose letters count
  PathString string;
  RecordedPath vertices;
};

// Sums over all paths of one string.
struct Cluster {
  Vec3d sum;                    // of values
  double weight = 0;            // of absolute luminances
  std::uint64_t count = 0;      // of contributions
  std::vector<double> batches;  // luminance by batch
  std::vector<Vec3d> places;    // of vertices, times the contribution's weight
  std::optional<KeyPath> best;
};

struct SumRules {
  bool by_object = false;
  std::optional<letters::Region> spot;  // the vertex next to the eye is in it
  std::size_t max_clusters = 4096;      // the rest is `other`
  std::size_t max_vertices = 64;        // of a path; longer ones are of `other`
  std::size_t keep = 64;                // key paths
};

class PathSums final : public PathConsumer {
 public:
  PathSums(const Session& session, const SumRules& rules, std::size_t batches)
      : session_(session), rules_(rules), totals_(batches) {
    other_.batches.resize(batches);
  }

  // Contributions count in batch 0 until merge().
  void add(const RecordedPath& path, Spectrum value, std::uint64_t key,
           const transport::ChannelLabels* labels) override;
  // Adds sums of one batch.
  void merge(PathSums&& part, std::size_t batch);

  const std::map<PathString, Cluster>& clusters() const { return clusters_; }
  const Cluster& other() const { return other_; }
  const std::vector<double>& totals() const { return totals_; }  // luminance by batch, not only the selected
  Vec3d total() const { return total_; }
  std::uint64_t not_finite() const { return not_finite_; }
  const std::vector<KeyPath>& kept() const { return kept_; }  // in no order

 private:
  PathString string_of(const RecordedPath& path, std::size_t channel) const;
  void add_part(const RecordedPath& path, Spectrum value, std::size_t channel, std::uint64_t key);
  void keep(KeyPath&& path);
  Cluster& cluster_of(const PathString& string);

  const Session& session_;
  const SumRules& rules_;
  std::map<PathString, Cluster> clusters_;
  std::vector<double> totals_;
  Cluster other_;
  Vec3d total_;
  std::uint64_t not_finite_ = 0;
  std::vector<KeyPath> kept_;  // a heap, the lowest rank first
};

}  // namespace candela::inspect
