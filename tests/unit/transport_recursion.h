// The recursion of mis/balance_power.h along a path given by its numbers, to be compared with the oracle's
// products.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "tests/unit/transport_reference.h"
#include "worker/transport/mis/beam_balance.h"

namespace candela::transport {

using reference::Counts;
using reference::PathNumbers;
using reference::Technique;

template <class Heuristic>
constexpr reference::Heuristic kNamed = reference::Heuristic::balance;
template <>
constexpr reference::Heuristic kNamed<Power> = reference::Heuristic::power;

// Without the merges of beams.
template <class Heuristic>
MisFactors factors_of(const Counts& c) {
  return {
      c.hit_light, c.next_event,   c.connect, Heuristic::raise(c.light_image), Heuristic::raise(c.hit_lens),
      nullptr,     c.connect_media};
}
inline MediumMerges merges_in(const Counts& c, std::uint32_t medium) {
  const double r = c.radius_ratio(medium);
  return {r * r * r * c.merge_medium,
          r * r * c.point_beam,
          r * r * c.beam_point,
          r * c.beam_beam,
          Counts::in(c.long_photon_beams, medium),
          Counts::in(c.long_query_beams, medium)};
}
template <class Heuristic>
MergeFactors eta_of(const Counts& c) {
  if constexpr (Heuristic::kMergesBeams) return {c.merge_surface, 1};  // see beam_balance.h
  return {Heuristic::raise(c.merge_surface), Heuristic::raise(c.merge_medium)};
}

// The recursion along a path given by its numbers: the weight of each technique listed.
template <class Heuristic>
std::vector<double> recursive_weights(const PathNumbers& n, const Counts& counts,
                                      const std::vector<Technique>& techniques) {
  const std::size_t k = n.edges;
  const MisFactors factors = factors_of<Heuristic>(counts);
  const MergeFactors eta = eta_of<Heuristic>(counts);
  const auto raise = Heuristic::raise;
  using Departure = typename Heuristic::Departure;
  const auto merged = [&](std::size_t i) {
    if constexpr (Heuristic::kMergesBeams) {
      if (n.in_medium[i]) {
        const MediumMerges merges = merges_in(counts, n.medium[i]);
        return n.beam_sine[i] > 0 ? merges.at(n.factor_to_light[i], n.factor_to_eye[i], n.beam_sine[i],
                                              n.survival[i - 1], n.survival[i])
                                  : merges.point_point;
      }
    }
    return n.in_medium[i] ? eta.medium : eta.surface;
  };
  const auto leave = [&](bool from_light, const MisBlock& block, std::size_t i, double pdf,
                         double pdf_reverse, double factor) {
    Departure left = Heuristic::leave_vertex(block, !n.in_medium[i], n.delta[i], pdf, pdf_reverse, factor);
    if constexpr (Heuristic::kMergesBeams) {
      if (!n.in_medium[i]) return left;
      const MediumMerges merges = merges_in(counts, n.medium[i]);
      Heuristic::add_merges(left, n.beam_sine[i] > 0
                                      ? merges.leaving(from_light, n.factor_to_light[i], n.beam_sine[i],
                                                       from_light ? n.survival[i - 1] : n.survival[i])
                                      : MediumMerges::Leaving{merges.point_point, 0});
    }
    return left;
  };

  std::vector<MisBlock> light(k + 1), eye(k + 1);
  Departure d = Heuristic::leave_end(factors.hit_light, n.light_prob, n.light_can_be_hit, n.pdf_to_eye[0],
                                     n.factor_to_eye[0]);
  light[1] = Heuristic::arrive_from_light(d, factors, n.factor_to_light[1], n.light_density(1),
                                          n.delta[1] ? 0 : n.light_direct, n.light_prob);
  for (std::size_t i = 1; i < k; ++i) {
    d = leave(true, light[i], i, n.pdf_to_eye[i], n.pdf_to_light[i], n.factor_to_eye[i]);
    if (i + 1 < k)
      light[i + 1] = Heuristic::arrive_later(d, factors, n.factor_to_light[i + 1], n.light_density(i + 1),
                                             !n.in_medium[i + 1], n.survival[i]);
  }
  const Departure to_lens = d;
  d = Heuristic::leave_end(factors.hit_lens, n.lens_prob, n.lens_can_be_hit, n.pdf_to_light[k],
                           n.factor_to_light[k]);
  eye[k - 1] =
      Heuristic::arrive_from_eye(d, factors, n.factor_to_eye[k - 1], n.eye_density(k - 1), n.survival[k - 1]);
  for (std::size_t i = k - 1; i > 0; --i) {
    d = leave(false, eye[i], i, n.pdf_to_light[i], n.pdf_to_eye[i], n.factor_to_light[i]);
    eye[i - 1] = Heuristic::arrive_later(d, factors, n.factor_to_eye[i - 1], n.eye_density(i - 1),
                                         i < 2 || !n.in_medium[i - 1], n.survival[i - 1]);
  }

  std::vector<double> weights;
  for (const Technique& t : techniques) {
    const std::size_t s = t.light_vertices;
    double rest = 0;
    switch (t.kind) {
      case Technique::Kind::hit_light: {
        MisBlock block = eye[0];
        block.known = n.delta[1] ? 0 : factors.next_event * raise(n.light_direct / n.eye_density(0));
        rest = Heuristic::sum(block, n.light_prob * n.pdf_to_eye[0], eta);
        break;
      }
      case Technique::Kind::next_event: {
        const double hit = n.light_can_be_hit ? n.eye_density(0) / n.light_direct : 0;
        const double traced = n.light_prob * n.light_density(1) / n.light_direct;
        rest = factors.hit_light * raise(hit) +
               raise(traced) * (merged(1) + Heuristic::sum(eye[1], n.pdf_to_eye[1], eta));
        break;
      }
      case Technique::Kind::connect:
        rest = raise(n.eye_density(s - 1)) *
                   (merged(s - 1) + Heuristic::sum(light[s - 1], n.pdf_to_light[s - 1], eta)) +
               raise(n.light_density(s)) * (merged(s) + Heuristic::sum(eye[s], n.pdf_to_eye[s], eta));
        if (n.in_medium[s - 1] && n.in_medium[s]) rest /= counts.connect_media;
        break;
      case Technique::Kind::light_image: {
        const double met = n.lens_can_be_hit ? n.light_density(k) / n.lens_connect : 0;
        rest = (raise(n.eye_density(k - 1)) *
                    (merged(k - 1) + Heuristic::sum(light[k - 1], n.pdf_to_light[k - 1], eta)) +
                factors.hit_lens * raise(met)) /
               factors.light_image;
        break;
      }
      case Technique::Kind::hit_lens: {
        const double traced =
            n.lens_prob * n.pdf_to_light[k] * n.survival[k - 1] * to_lens.leave / n.factor_to_light[k];
        rest = raise(traced) * Heuristic::sum_departure(to_lens, eta, n.survival[k - 1]);
        if (to_lens.connects > 0) rest += factors.light_image * raise(n.lens_connect / n.light_density(k));
        rest /= factors.hit_lens;
        break;
      }
      case Technique::Kind::merge:
      case Technique::Kind::merge_point_beam:
      case Technique::Kind::merge_beam_point:
      case Technique::Kind::merge_beam_beam:
        if constexpr (Heuristic::kMergesBeams) {
          const MediumMerges merges = merges_in(counts, n.medium[s]);
          const double light_hazard = n.factor_to_light[s] * merges.light_survival(n.survival[s - 1]),
                       eye_hazard = n.factor_to_eye[s] * merges.eye_survival(n.survival[s]);
          const double own = !n.in_medium[s]                               ? eta.surface
                             : t.kind == Technique::Kind::merge            ? merges.point_point
                             : t.kind == Technique::Kind::merge_point_beam ? merges.point_beam / eye_hazard
                             : t.kind == Technique::Kind::merge_beam_point
                                 ? merges.beam_point / light_hazard
                                 : merges.beam_beam * n.beam_sine[s] / (light_hazard * eye_hazard);
          weights.push_back(own / (merged(s) + Heuristic::sum(light[s], n.pdf_to_light[s], eta) +
                                   Heuristic::sum(eye[s], n.pdf_to_eye[s], eta)));
          continue;
        }
        rest = (Heuristic::sum(light[s], n.pdf_to_light[s], eta) +
                Heuristic::sum(eye[s], n.pdf_to_eye[s], eta)) /
               merged(s);
        break;
    }
    weights.push_back(1 / (1 + rest));
  }
  return weights;
}

inline double relative_difference(double a, double b) {
  if (a == b) return 0;
  const double d = std::abs(a - b) / std::max(std::abs(a), std::abs(b));
  return std::isfinite(d) ? d : 1e300;
}

struct Errors {
  std::size_t count = 0, loose = 0;
  double largest = 0;
  std::string worst;
  void add(double error, double tight, const std::string& what) {
    ++count;
    if (!(error <= tight)) ++loose;
    if (!(error <= largest)) {
      largest = error;
      worst = what;
    }
  }
};

inline constexpr double kOfRecursion = 1e-12, kTight = 1e-5, kTightValue = 1e-4;

struct Findings {
  std::size_t paths = 0, lost = 0, media_differ = 0, met_lens = 0;
  double largest_sum_error = 0, largest_recursion_error = 0;
  Errors weight, value, listed, merge_weight, merge_value;
};

inline const char* name_of(Technique::Kind kind) {
  constexpr const char* kNames[] = {"hit_light", "next_event", "connect", "light_image", "hit_lens",
                                    "merge",     "pb2d",       "bp2d",    "bb1d"};
  return kNames[static_cast<int>(kind)];
}

// Parts left out, from path to path.
inline Counts counts_of(std::uint64_t i, bool lens) {
  Counts c;
  c.light_image = 1000;  // light paths
  c.hit_lens = lens ? 1000 : 0;
  switch (i % 6) {
    case 1:
      c.next_event = 0;
      break;
    case 2:
      c.hit_light = 0;
      break;
    case 3:
      c.connect = 0;
      break;
    case 4:
      c.light_image = 0;
      break;
    default:
      break;
  }
  constexpr double kEta[] = {0, 1e-12, 1, 1e12, 1e-3};
  c.merge_surface = kEta[i % 5];
  c.merge_medium = kEta[(i / 5) % 5];
  return c;
}

// eta that differs from place to place on the film, by a factor of about a hundred from corner to corner.
inline Counts counts_there(Counts counts, FilmPosition at) {
  const double factor =
      std::exp(0.05 * (static_cast<double>(at.x) - 32) + 0.02 * (static_cast<double>(at.y) - 32));
  counts.merge_surface *= factor;
  counts.merge_medium /= factor;
  return counts;
}
// The merges of beams left out, from path to path.
inline Counts beam_counts_of(std::uint64_t i, bool lens) {
  Counts c = counts_of(i, lens);
  constexpr double kEta[] = {1, 0, 1e3, 1e-6};
  c.point_beam = kEta[i % 4];
  c.beam_point = kEta[(i / 2) % 4];
  c.beam_beam = kEta[(i / 3) % 4];
  c.radius_ratios = {i % 2 == 0 ? 1.0 : 0.3, 0.5};
  const bool long_photon_beams = i % 5 < 2, long_query_beams = i % 3 < 2;
  c.long_photon_beams = {long_photon_beams, !long_photon_beams};
  c.long_query_beams = {long_query_beams, long_query_beams};
  c.connect_media = i % 7 < 3 ? 1 : 0.4;
  return c;
}
template <class Heuristic>
struct VaryingEta {
  Counts counts;
  MergeFactors at(FilmPosition place) const {
    if constexpr (Heuristic::kMergesBeams) return eta_of<Heuristic>(counts);  // walks know one eta
    return eta_of<Heuristic>(counts_there(counts, place));
  }
};

}  // namespace candela::transport
