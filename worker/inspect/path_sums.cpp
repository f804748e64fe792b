#include "worker/inspect/path_sums.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/rng/stream.h"
#include "worker/inspect/path_selection.h"
#include "worker/transport/letters/vertex_letter.h"

namespace candela::inspect {

using letters::Letter;
using letters::Side;

namespace {

constexpr unsigned kSideShift = 3, kObjectShift = 5;

bool is_finite(Spectrum s) {
  return std::isfinite(s.r) && std::isfinite(s.g) && std::isfinite(s.b);
}

double luminance_of(Spectrum s) {
  return static_cast<double>(luminance(s));
}

Vec3d as_double(Spectrum s) {
  return {static_cast<double>(s.r), static_cast<double>(s.g), static_cast<double>(s.b)};
}

bool outranks(const KeyPath& a, const KeyPath& b) {
  return a.rank > b.rank;
}

bool same_in(const RecordedPath& path, std::size_t a, std::size_t b) {
  return std::all_of(path.begin(), path.end(), [&](const PathVertex& v) {
    return v.letter[a] == v.letter[b] && v.object[a] == v.object[b];
  });
}

}  // namespace

char32_t code_of(const Token& token) {
  const std::uint32_t object = token.object == letters::kNoObject ? 0 : token.object + 1;
  return static_cast<char32_t>(static_cast<std::uint32_t>(token.letter) |
                               static_cast<std::uint32_t>(token.side) << kSideShift | object << kObjectShift);
}

Token token_of(char32_t code) {
  const auto bits = static_cast<std::uint32_t>(code);
  const std::uint32_t object = bits >> kObjectShift;
  return {static_cast<Letter>(bits & 7), static_cast<Side>(bits >> kSideShift & 3),
          object == 0 ? letters::kNoObject : object - 1};
}

PathString PathSums::string_of(const RecordedPath& path, std::size_t channel) const {
  PathString string;
  string.reserve(path.size());
  for (const PathVertex& v : path) {
    Token token{v.letter[channel], v.side};
    if (rules_.by_object) {
      token.side = Side::none;
      if (token.letter == Letter::glossy || token.letter == Letter::specular) token.letter = Letter::diffuse;
      if (token.letter != Letter::eye) token.object = session_.object_of_name(v.object[channel]);
    }
    string.push_back(code_of(token));
  }
  return string;
}

void PathSums::add(const RecordedPath& path, Spectrum value, std::uint64_t key,
                   const transport::ChannelLabels* /*labels*/) {
  if (!is_finite(value)) {
    ++not_finite_;
    return;
  }
  if (value.is_black()) return;
  const PathVertex& seen = path[path.size() - 2];
  if (rules_.spot && (seen.infinite || !transport::is_inside(*rules_.spot, session_.in_file(seen.p)))) return;
  totals_[0] += luminance_of(value);
  total_ += as_double(value);
  const bool green = same_in(path, 0, 1), blue = same_in(path, 0, 2);
  if (green && blue) return add_part(path, value, 0, key);
  // Parts of a channel each, but for channels with the same string.
  const bool last = !green && !blue && same_in(path, 1, 2);
  add_part(path, {value.r, green ? value.g : 0, blue ? value.b : 0}, 0, key);
  if (!green) add_part(path, {0, value.g, last ? value.b : 0}, 1, rng::combine(key, 1));
  if (!blue && !last) add_part(path, {0, 0, value.b}, 2, rng::combine(key, 2));
}

void PathSums::add_part(const RecordedPath& path, Spectrum value, std::size_t channel, std::uint64_t key) {
  if (value.is_black() || !is_selected(session_, path, channel)) return;
  const double light = luminance_of(value), weight = std::abs(light);
  const bool too_long = path.size() > rules_.max_vertices;
  const PathString string = too_long ? PathString() : string_of(path, channel);
  Cluster& cluster = too_long ? other_ : cluster_of(string);
  cluster.sum += as_double(value);
  cluster.weight += weight;
  cluster.batches[0] += light;
  ++cluster.count;
  if (&cluster == &other_) return;
  cluster.places.resize(path.size());
  for (std::size_t i = 0; i < path.size(); ++i) cluster.places[i] += Vec3d(path[i].p) * weight;
  // log(u) / w grows with u^(1/w).
  const double u = std::max(rng::to_double(rng::combine(key, 0x72616e6bULL)), 0x1p-60);  // "rank"
  const double rank = std::log(u) / std::max(weight, 1e-300);
  const bool is_best = !cluster.best || rank > cluster.best->rank;
  const bool is_kept = kept_.size() < rules_.keep || (!kept_.empty() && rank > kept_.front().rank);
  if (!is_best && !is_kept) return;
  KeyPath entry{rank, value, static_cast<int>(channel), string, path};
  if (is_best) cluster.best = entry;
  if (is_kept) keep(std::move(entry));
}

void PathSums::keep(KeyPath&& path) {
  if (kept_.size() >= rules_.keep) {
    if (kept_.empty() || path.rank <= kept_.front().rank) return;
    std::pop_heap(kept_.begin(), kept_.end(), outranks);
    kept_.pop_back();
  }
  kept_.push_back(std::move(path));
  std::push_heap(kept_.begin(), kept_.end(), outranks);
}

Cluster& PathSums::cluster_of(const PathString& string) {
  const auto found = clusters_.find(string);
  if (found != clusters_.end()) return found->second;
  if (clusters_.size() >= rules_.max_clusters) return other_;
  Cluster& cluster = clusters_[string];
  cluster.batches.resize(totals_.size());
  return cluster;
}

void PathSums::merge(PathSums&& part, std::size_t batch) {
  const auto add = [batch](Cluster& to, Cluster& from) {
    to.sum += from.sum;
    to.weight += from.weight;
    to.count += from.count;
    to.batches[batch] += from.batches[0];
  };
  for (auto& [string, from] : part.clusters_) {
    Cluster& to = cluster_of(string);
    add(to, from);
    if (&to == &other_) continue;
    to.places.resize(from.places.size());
    for (std::size_t i = 0; i < from.places.size(); ++i) to.places[i] += from.places[i];
    if (!to.best || from.best->rank > to.best->rank) to.best = std::move(from.best);
  }
  add(other_, part.other_);
  totals_[batch] += part.totals_[0];
  total_ += part.total_;
  not_finite_ += part.not_finite_;
  for (KeyPath& path : part.kept_) keep(std::move(path));
}

}  // namespace candela::inspect
