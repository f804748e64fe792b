// The sum of the weights that the techniques' own code gives one path (test_transport_sums.cpp).
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "tests/unit/led_walk.h"
#include "tests/unit/transport_paths.h"
#include "worker/estimators/options.h"
#include "worker/transport/technique/merge.h"
#include "worker/transport/technique/merge_medium.h"

namespace candela::transport {

using estimators::Techniques;
using test::LedSampler;

inline constexpr double kPaths = 4096;
// Distance that floats may move places, over the length of an edge: what that does to its direction and
// density.
inline constexpr double kOfPlaces = 1e-6;
inline constexpr float kSameRadius = 0.01f;  // of searches for the one photon or beam; weights do not know it

// eta as an integrator has it; slope: how it differs from place to place on the film.
struct Field {
  MergeFactors whole;
  double slope = 0;
  MergeFactors at(FilmPosition place) const {
    const double factor = slope == 0 ? 1 : std::exp(slope * (static_cast<double>(place.x + place.y) - 64));
    return {whole.surface * factor, whole.medium * factor};
  }
};

// Weights of an integrator.
struct Weighing {
  std::string name;
  Techniques techniques;
  Field field;
  std::vector<MediumMerges> merges;  // of upbp, by medium
  double connect_media = 1;
};

struct PathEdge {
  Crossing crossing;  // the last stretch of the edge to the vertex, if that is in a medium
  EdgeStart start;
};

struct Sums {
  std::size_t paths = 0, lost = 0, mixed = 0, met_lens = 0, beyond = 0;
  double largest = 0;
  std::string worst;
};

template <class Mis>
class SumTest {
 public:
  static constexpr EdgeContent kEdgeContent = EdgeContent::media;
  using EyeWalk = Walk<TransportMode::radiance, kEdgeContent, Mis, samplers::Sampler, CrossingObserver>;
  using LightWalk = Walk<TransportMode::importance, kEdgeContent, Mis, LedSampler, test::FlightLeader>;

  SumTest(const scene::Scene& scene, const Weighing& weighing, std::uint32_t max_edges, double tolerance,
          Sums& sums)
      : scene_(scene),
        w_(weighing),
        counts_{double{test::kFilmSize} * test::kFilmSize, kPaths, 1, weighing.merges.data(),
                weighing.connect_media},
        factors_(estimators::mis_factors<Mis>(weighing.techniques, counts_)),
        tolerance_(tolerance),
        sums_(sums) {
    estimators::PathOptions options;
    options.max_depth = max_edges;
    options.rr_depth = 1u << 30;
    eye_rules_ = estimators::eye_rules(options, w_.techniques, counts_);
    light_rules_ = estimators::light_rules(options, w_.techniques, counts_);
  }

  // All paths that one eye's walk makes: those that end at light it meets, and those to a point light.
  void run(std::uint64_t index) {
    const ConnectContext c{scene_, factors_, eye_rules_, sample_counts_};
    samplers::Sampler sampler(samplers::SamplerKind::independent, 19);
    sampler.start(0, index, 0, 0);
    rng::Stream stream(rng::key(23, index));
    const float x = stream.next_float() * test::kFilmSize, y = stream.next_float() * test::kFilmSize;
    const Vec2 u_lens{stream.next_float(), stream.next_float()};
    float response = 1;
    const Ray ray = scene_.camera_ray(x, y, u_lens, response);
    ASSERT_TRUE(scene_.pdf_camera(ray.origin, ray.direction, camera_, eye_rules_.film_border));
    u_lens_ = u_lens;
    eta_ = w_.field.at({x, y});
    Crossing last;
    EyeWalk walk(scene_, eye_rules_, factors_, sampler, sample_counts_, CrossingObserver(last));
    walk.start_eye(ray);
    eye_.clear();
    eye_edges_.clear();
    for (;;) {
      auto slot = std::make_unique<test::Slot>();
      last.some = false;
      if (walk.advance(slot->v, slot->arena) != EyeWalk::Event::vertex) return;
      const Vertex<MisBlock>& v = slot->v;
      eye_edges_.push_back(edge_of(walk, last));
      eye_.push_back(std::move(slot));
      const Vertex<MisBlock>* before = eye_.size() < 2 ? nullptr : &eye_[eye_.size() - 2]->v;
      if (v.on_surface() && v.hit.emitter != scene::kNone && v.edges > 1 &&
          !scene_.emitted(v.hit, v.wo).is_black()) {
        Contribution met;
        const double weight =
            w_.techniques.hit_light && hit_light<Mis>(c, v, false, before, eta_, met) ? met.weight : 0;
        follow({Vec3d(v.hit.p), v.hit.emitter, false}, v.edges, weight);
      } else if (v.connectible && v.edges < eye_rules_.max_edges) {
        scene::DirectSample light;
        if (scene_.sample_direct(v.hit, v.front, 0.999f, {0.5f, 0.5f}, light) ==
                scene::DirectOutcome::sampled &&
            light.delta && !light.infinite)
          follow({Vec3d(light.p), light.emitter, true}, v.edges + 1, 0);
      }
      switch (walk.scatter(eye_.back()->v)) {
        case EyeWalk::Step::ended:
          return;
        case EyeWalk::Step::passed:  // no vertex
          eye_.pop_back();
          eye_edges_.pop_back();
          break;
        case EyeWalk::Step::scattered:
          break;
      }
    }
  }

 private:
  struct Light {
    Vec3d p;
    std::uint32_t emitter;
    bool delta;
  };

  // The eye's copy of x_i on a path of k edges.
  const Vertex<MisBlock>& eye_at(std::size_t i) const { return eye_[k_ - i - 1]->v; }
  const PathEdge& eye_edge(std::size_t i) const { return eye_edges_[k_ - i - 1]; }
  const Vertex<MisBlock>& light_at(std::size_t i) const { return light_[i - 1]->v; }
  double shortest_edge(const Light& light) const {
    double shortest = length(light.p - Vec3d(eye_at(1).hit.p));
    for (std::size_t i = 2; i < k_; ++i)
      shortest = std::min(shortest, length(Vec3d(eye_at(i).hit.p) - Vec3d(eye_at(i - 1).hit.p)));
    return shortest;
  }

  template <class WalkT>
  static PathEdge edge_of(const WalkT& walk, const Crossing& last) {
    if constexpr (Mis::kMergesBeams)
      if (last.some) return {last, edge_start(walk, last.segment)};
    return {last, {}};
  }

  void follow(const Light& light, std::uint32_t edges, double met) {
    k_ = edges;
    // Which vertices the eye's walk left by a delta lobe; it has not left the last of a path to a point
    // light.
    delta_.assign(k_, false);
    for (std::size_t i = 1; i < k_; ++i) delta_[i] = !(light.delta && i == 1) && eye_at(i).left_by_delta;
    std::string what = fmt::format("{} k={}:", w_.name, k_);
    bool surface = false, medium = false;
    for (std::size_t i = 1; i < k_; ++i) {
      what += delta_[i] ? " delta" : eye_at(i).on_surface() ? " surface" : " medium";
      surface = surface || (!delta_[i] && eye_at(i).on_surface());
      medium = medium || !eye_at(i).on_surface();
    }
    double sum = met;
    joints_ = w_.techniques.hit_light && !light.delta ? 1 : 0;
    if (!(trace_light(light, sum, what) && add_joints(light, sum, what))) {
      ++sums_.lost;
      return;
    }
    if (joints_ == 0) return;  // no technique that is run makes it
    ++sums_.paths;
    sums_.mixed += surface && medium ? 1 : 0;
    const double error = std::abs(sum - 1);
    if (error > tolerance_ + kOfPlaces / shortest_edge(light)) ++sums_.beyond;
    if (!(error <= sums_.largest)) {
      sums_.largest = error;
      sums_.worst = what + fmt::format(" sum {:.9f}", sum);
    }
  }

  // Leads a light walk along the path up to x_{k-1}, and on to the lens if that can be met. False: it went
  // elsewhere.
  bool trace_light(const Light& light, double& sum, std::string& what) {
    light_.clear();
    light_edges_.clear();
    LedSampler sampler;
    if (test::lead_start(scene_, light.emitter, light.p, Vec3d(eye_at(1).hit.p), sampler) > 1e-5)
      return false;
    Vec3d target;
    bool in_medium = false;
    Crossing last;
    LightWalk walk(scene_, light_rules_, factors_, sampler, sample_counts_,
                   test::FlightLeader(scene_, sampler, last, target, in_medium));
    if (!walk.start_light()) return false;
    origin_ = walk.origin();
    for (std::size_t i = 1; i < k_; ++i) {
      target = Vec3d(eye_at(i).hit.p);
      in_medium = !eye_at(i).on_surface();
      auto slot = std::make_unique<test::Slot>();
      for (int passes = 0;; ++passes) {
        last.some = false;
        if (walk.advance(slot->v, slot->arena) != LightWalk::Event::vertex || passes > 8) return false;
        if (slot->v.kind == eye_at(i).kind && length(Vec3d(slot->v.hit.p) - target) < 1e-4) break;
        if (!slot->v.on_surface() || walk.scatter(slot->v) != LightWalk::Step::passed) return false;
      }
      light_edges_.push_back(edge_of(walk, last));
      light_.push_back(std::move(slot));
      Vertex<MisBlock>& v = light_.back()->v;
      if (v.edges != i) return false;
      const bool ends = i + 1 == k_;
      if (ends && !(w_.techniques.hit_lens && light_rules_.meets_lens)) return true;
      const Vec3d next = ends ? Vec3d(camera_.p) : Vec3d(eye_at(i + 1).hit.p);
      const Vec3d to = (next - Vec3d(v.hit.p)) * (1 / length(next - Vec3d(v.hit.p)));
      if (test::lead_scattering(scene_, v, to, delta_[i], TransportMode::importance, sampler) >
          (delta_[i] ? 1e-4 : 1e-6))
        return false;
      if (walk.scatter(v) != LightWalk::Step::scattered) return ends;
    }
    test::Slot beyond;
    target = Vec3d(camera_.p);
    in_medium = false;
    for (int passes = 0; passes < 8; ++passes) {
      const auto event = walk.advance(beyond.v, beyond.arena);
      if (walk.lens().met) {
        const ConnectContext c{scene_, factors_, light_rules_, sample_counts_};
        FilmPosition film;
        const double weight = hit_lens(c, walk, w_.field, film).weight;
        sum += weight;
        ++joints_;
        what += fmt::format(" met the lens {:.4g}", weight);
        ++sums_.met_lens;
        return true;
      }
      if (event != LightWalk::Event::vertex || walk.scatter(beyond.v) != LightWalk::Step::passed) break;
    }
    return false;
  }

  bool add_joints(const Light& light, double& sum, std::string& what) {
    const Techniques& t = w_.techniques;
    const ConnectContext eye{scene_, factors_, eye_rules_, sample_counts_},
        from_light{scene_, factors_, light_rules_, sample_counts_};
    Contribution found;
    LedSampler sampler;
    const auto add = [&](const char* name, double weight) {
      sum += weight;
      ++joints_;
      what += fmt::format(" {} {:.4g}", name, weight);
    };
    if (t.next_event && !delta_[1] && eye_at(1).connectible) {
      if (test::lead_direct(scene_, eye_at(1), light.emitter, light.p, sampler) > 1e-5) return false;
      if (!next_event<kEdgeContent, Mis>(eye, test::draws_of(sampler), eye_at(1), eta_, found)) return false;
      add("next_event", found.weight);
    }
    for (std::size_t s = 2; s < k_ && t.connect; ++s) {
      if (delta_[s - 1] || delta_[s]) continue;
      std::uint64_t key = 1;
      // Few connections in media are drawn by the key.
      while (key < 200 && !connect<kEdgeContent, Mis>(eye, light_at(s - 1), eye_at(s), key, eta_, found))
        ++key;
      if (key == 200) return false;
      add("connect", found.weight);
    }
    if (t.light_image && !delta_[k_ - 1]) {
      sampler.point = u_lens_;
      FilmPosition film;
      if (!connect_lens<kEdgeContent, Mis>(from_light, test::draws_of(sampler), light_at(k_ - 1), w_.field,
                                           film, found))
        return false;
      add("light_image", found.weight);
    }
    for (std::size_t i = 1; i < k_; ++i) {
      if (delta_[i]) continue;
      if constexpr (Mis::kMergesBeams) {
        if (!eye_at(i).on_surface()) {
          const std::array<double, 4> weights = weights_in_medium(i);
          constexpr const char* kNames[] = {"pp3d", "pb2d", "bp2d", "bb1d"};
          for (std::size_t m = 0; m < 4; ++m) {
            if (std::isnan(weights[m])) return false;
            if (weights[m] > 0) add(kNames[m], weights[m]);
          }
          continue;
        }
      }
      if (eye_at(i).on_surface() ? t.merge_surface : t.merge_medium) add("merge", weight_of_merge(i));
    }
    return !std::isnan(sum);
  }

  // Merges of the one photon at x_i: what they give over what they would give unweighted.
  double weight_of_merge(std::size_t i) const {
    PhotonBuffer<MisBlock> buffer;
    EXPECT_TRUE(buffer.keep(scene_, light_at(i)));
    PhotonMap<MisBlock> map;
    const PhotonBuffer<MisBlock>* const chunks[] = {&buffer};
    EXPECT_TRUE(map.build(chunks, kSameRadius, 1).ok());
    MergeMaps<MisBlock> maps;
    maps.surface = maps.medium = &map;
    const MergeScale scale(Kernel::constant, kSameRadius, kSameRadius, eta_);
    return ratio(merge<Mis>(scene_, maps, scale, eye_at(i)),
                 merge<Unweighted>(scene_, maps, scale, eye_at(i)));
  }
  static double ratio(Spectrum weighted, Spectrum whole) {
    const auto largest = static_cast<double>(whole.max_component());
    return largest > 0 ? static_cast<double>(weighted.max_component()) / largest : std::nan("");
  }

  // The four merges in media at x_i. Unweighted: one technique at a time, of subpaths that could not have
  // been made otherwise.
  std::array<double, 4> weights_in_medium(std::size_t i) const {
    const MediumMerges& m = w_.merges[eye_at(i).medium];
    const std::array<double, 4> counts = {m.point_point, m.point_beam, m.beam_point, m.beam_beam};
    const std::array<Spectrum, 4> weighted = merges_in_medium(i, w_.merges, true);
    std::array<double, 4> weights{};
    for (std::size_t kind = 0; kind < 4; ++kind) {
      if (!(counts[kind] > 0)) continue;
      std::vector<MediumMerges> alone = w_.merges;
      for (MediumMerges& merges : alone) {
        if (kind != 0) merges.point_point = 0;
        if (kind != 1) merges.point_beam = 0;
        if (kind != 2) merges.beam_point = 0;
        if (kind != 3) merges.beam_beam = 0;
      }
      weights[kind] = ratio(weighted[kind], merges_in_medium(i, alone, false)[kind]);
    }
    return weights;
  }
  std::array<Spectrum, 4> merges_in_medium(std::size_t i, const std::vector<MediumMerges>& merges,
                                           bool known) const {
    PhotonBuffer<MisBlock> buffer;
    Vertex<MisBlock> z = light_at(i), y = eye_at(i);
    PathEdge light = light_edges_[i - 1], eye = eye_edge(i);
    if (!known) {
      z.mis = y.mis = {};
      light.start.departure.pdf = eye.start.departure.pdf = 0;
    }
    for (PathEdge* edge : {&light, &eye}) {  // the beams pass x_i
      const float end = edge->crossing.segment.ray.t_max;
      edge->crossing.end = std::min(0.5f * (edge->crossing.end + end), 1.5f * edge->crossing.end);
    }
    const MediumMerges& m = merges[y.medium];
    EXPECT_TRUE(buffer.keep(scene_, z, m.long_photon_beams));
    BeamBuffer beam_buffer;
    EXPECT_TRUE(beam_buffer.keep(scene_, light.crossing, m.long_photon_beams, light.start, origin_));
    const std::vector<float> radii(merges.size(), kSameRadius);
    const PhotonBuffer<MisBlock>* const photon_chunks[] = {&buffer};
    const BeamBuffer* const beam_chunks[] = {&beam_buffer};
    PhotonPoints points;
    PhotonBeams beams;
    EXPECT_TRUE(points.build(photon_chunks, {radii, true, &scene_}, 1).ok());
    EXPECT_TRUE(beams.build(beam_chunks, radii, 1).ok());
    const double r = static_cast<double>(kSameRadius);
    const std::vector<MediumKernels> kernels(merges.size(), MediumKernels(Kernel::constant, {r, r, r, r}));
    MediumMaps maps;
    maps.points = &points;
    maps.beams = &beams;
    maps.kernels = kernels;
    maps.factors = factors_;
    maps.factors.medium = merges.data();
    MediumGather gather(scene_, maps);
    gather.begin(eta_);
    MediumShares found;
    gather.prefetch(y);
    gather.start(y);
    Spectrum sum;
    found.point_point = gather.finish(sum);
    found.beam_point = gather.beams_at(y, sum);
    gather.along(eye.crossing, eye.start, found, sum);
    return {found.point_point, found.point_beam, found.beam_point, found.beam_beam};
  }

  const scene::Scene& scene_;
  const Weighing& w_;
  const estimators::PathCounts counts_;
  const MisFactors factors_;
  WalkRules eye_rules_, light_rules_;
  const double tolerance_;
  Sums& sums_;
  film::SampleCounts sample_counts_;
  MergeFactors eta_;
  scene::CameraDensity camera_;
  Vec2 u_lens_;
  scene::EmissionSample origin_;
  test::Slots eye_, light_;  // from the eye, from the light
  std::vector<PathEdge> eye_edges_, light_edges_;
  std::size_t k_ = 0, joints_ = 0;
  std::vector<bool> delta_;
};

}  // namespace candela::transport
