// Random paths as the kernels make them, each compared with the oracle: weight and value of every technique.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>
#include <utility>

#include "tests/unit/transport_paths.h"
#include "tests/unit/transport_recursion.h"
#include "worker/transport/technique/merge.h"
#include "worker/transport/technique_list.h"

namespace candela::transport {

using reference::Evaluation;
using reference::FullPath;
using reference::Scaled;
using test::Slot;
using test::Slots;

using WeightedVertex = Vertex<MisBlock>;

// As TechniqueList wants to see a subpath.
struct Chain {
  const Slots& slots;
  const WeightedVertex& operator[](std::size_t i) const { return slots[i]->v; }
};

template <EdgeContent kEdgeContent, class Heuristic>
class PathTest {
 public:
  using EyeWalk = Walk<TransportMode::radiance, kEdgeContent, Heuristic>;
  using LightWalk = Walk<TransportMode::importance, kEdgeContent, Heuristic>;

  // every: ends of subpaths that are looked at, those with a multiple of so many edges.
  PathTest(const scene::Scene& scene, const WalkRules& rules, Findings& findings, std::uint32_t every = 1)
      : scene_(scene), rules_(rules), light_rules_(rules), findings_(findings), every_(every) {
    --light_rules_.max_edges;
  }

  // One eye and one light subpath, and all that can be made of them.
  void run(std::uint64_t index) {
    counts_ = Heuristic::kMergesBeams ? beam_counts_of(index, rules_.meets_lens)
                                      : counts_of(index, rules_.meets_lens);
    for (std::uint32_t m = 0; m < scene_.features().media; ++m) {
      if (scene_.medium(m).homogeneous()) continue;
      for (std::vector<bool>* are_long : {&counts_.long_photon_beams, &counts_.long_query_beams})
        if (m < are_long->size()) (*are_long)[m] = false;
    }
    factors_ = factors_of<Heuristic>(counts_);
    merges_.clear();
    for (std::uint32_t m = 0; m < scene_.features().media; ++m) merges_.push_back(merges_in(counts_, m));
    factors_.medium = merges_.data();
    eta_field_.counts = counts_;
    const ConnectContext c{scene_, factors_, rules_, sample_counts_};
    samplers::Sampler eye_sampler(samplers::SamplerKind::independent, 7);
    samplers::Sampler light_sampler(samplers::SamplerKind::independent, 7);
    eye_sampler.start(0, index, 0, 0);
    light_sampler.start_light(0, index, 0);
    Slots eye, light;
    walk_eye(c, eye_sampler, index, eye);
    walk_light(c, light_sampler, light);
    for (std::size_t j = 0; j < light.size(); ++j)
      for (std::size_t i = 0; i < eye.size(); ++i) connect_pair(c, light, j, eye, i);
  }

 private:
  void walk_eye(const ConnectContext& c, samplers::Sampler& sampler, std::uint64_t index, Slots& slots) {
    rng::Stream stream(rng::key(11, index));
    const float x = stream.next_float() * test::kFilmSize, y = stream.next_float() * test::kFilmSize;
    const Vec2 u_lens{stream.next_float(), stream.next_float()};
    const Ray ray = scene_.camera_ray(x, y, u_lens, response_);
    if (!scene_.pdf_camera(ray.origin, ray.direction, camera_, rules_.film_border)) return;
    lens_near_ = ray.origin;
    eta_ = eta_field_.at({x, y});
    EyeWalk walk(scene_, rules_, factors_, sampler, sample_counts_);
    walk.start_eye(ray);
    std::uint32_t parent = scene::kNone;
    for (;;) {
      auto slot = std::make_unique<Slot>();
      const auto event = walk.advance(slot->v, slot->arena);
      if (event == EyeWalk::Event::ended) return;
      note(walk, *slot, parent);
      slot->left = event == EyeWalk::Event::left;
      slots.push_back(std::move(slot));
      Slot& here = *slots.back();
      test::edit(scene_, here, parent == scene::kNone ? nullptr : slots[parent].get(), nullptr);
      const auto index_here = static_cast<std::uint32_t>(slots.size() - 1);
      const WeightedVertex* before = parent == scene::kNone ? nullptr : &slots[parent]->v;
      Contribution found;
      if (counts_.hit_light > 0 && wanted(here.v) &&
          hit_light<Heuristic>(c, here.v, here.left, before, eta_, found, &terms_)) {
        list_.clear();
        if (here.v.edges > 1) {
          list_.add(terms_.next);
          list_.add_side(Chain{slots}, here.v, terms_.eye_step, terms_.eye_reverse, true);
        }
        check_hit_light(slots, index_here, found);
      }
      if (here.left) return;
      if (counts_.next_event > 0 && wanted(here.v) && here.v.connectible && here.v.edges < rules_.max_edges)
        light_directly(c, sampler, slots, index_here);
      const auto step = walk.scatter(here.v);
      if (step == EyeWalk::Step::ended) return;
      if (step == EyeWalk::Step::scattered) {
        if (here.v.left_by_delta) here.delta_prob = walk.departure().pdf;
        parent = index_here;
      }
    }
  }

  void set_eye_end(FullPath& path) const {
    path.lens = camera_.p;
    path.lens_infinite = camera_.delta_direction;
    path.lens_near = lens_near_;
  }

  void check_hit_light(const Slots& slots, std::uint32_t last, const Contribution& found) {
    FullPath path;
    const Slot& here = *slots[last];
    path.light = here.v.hit;
    path.light_infinite = here.left;
    if (here.left) path.light.emitter = scene::kNone;
    path.along.push_back(here.v.wo);
    fill(path, {}, chain(slots, here.v.parent), nullptr);
    set_eye_end(path);
    check(path, Technique::Kind::hit_light, 0, found);
  }

  void light_directly(const ConnectContext& c, samplers::Sampler& sampler, const Slots& slots,
                      std::uint32_t last) {
    const Slot& here = *slots[last];
    Contribution found;
    if (!next_event<kEdgeContent, Heuristic>(c, test::draws_of(here, sampler), here.v, eta_, found, &terms_))
      return;
    list_.clear();
    list_.add(terms_.next);
    list_.add_side(Chain{slots}, here.v, terms_.eye_step, terms_.eye_reverse);
    scene::DirectSample light;
    ASSERT_EQ(scene_.sample_direct(here.v.hit, here.v.front,
                                   sampler.draw_1d(here.block + kEmitterChoice, here.stratified),
                                   sampler.draw_2d(here.block + kEmitterPoint, here.stratified), light),
              scene::DirectOutcome::sampled);
    FullPath path;
    path.light_infinite = light.infinite;
    path.light.emitter = light.emitter;
    path.light.p = light.p;
    if (light.delta) {
      path.light_delta_direction = light.infinite;
      path.light_delta_position = !light.infinite;
      const double squared = light.infinite ? 1 : length_squared(Vec3d(light.p) - Vec3d(here.v.hit.p));
      path.light_delta_radiance = light.radiance * static_cast<float>(squared);
    } else if (!light.infinite) {
      const float back = 1e-3f * static_cast<float>(length(Vec3d(light.p) - Vec3d(here.v.hit.p)));
      if (!scene_.intersect({light.p - light.wi * back, light.wi}, path.light) ||
          path.light.emitter != light.emitter) {
        ++findings_.lost;
        return;
      }
    }
    const Vec3 between = -light.wi;
    fill(path, {}, chain(slots, last), &between);
    set_eye_end(path);
    check(path, Technique::Kind::next_event, 1, found);
  }

  void walk_light(const ConnectContext& c, samplers::Sampler& sampler, Slots& slots) {
    LightWalk walk(scene_, light_rules_, factors_, sampler, sample_counts_);
    if (!walk.start_light()) return;
    origin_ = walk.origin();
    std::uint32_t parent = scene::kNone;
    for (;;) {
      auto slot = std::make_unique<Slot>();
      const auto event = walk.advance(slot->v, slot->arena);
      if (walk.lens().met && counts_.hit_lens > 0 && every_ == 1)
        check_hit_lens(c, walk, slots, parent, slot->v.wo);
      if (event != LightWalk::Event::vertex) return;
      note(walk, *slot, parent);
      slots.push_back(std::move(slot));
      Slot& here = *slots.back();
      test::edit(scene_, here, parent == scene::kNone ? nullptr : slots[parent].get(),
                 &origin_.vertex.emitter);
      const auto index_here = static_cast<std::uint32_t>(slots.size() - 1);
      if (counts_.light_image > 0 && wanted(here.v) && here.v.connectible && here.v.edges < rules_.max_edges)
        to_lens(c, sampler, slots, index_here);
      const auto step = walk.scatter(here.v);
      if (step == LightWalk::Step::ended) return;
      if (step == LightWalk::Step::scattered) {
        if (here.v.left_by_delta) here.delta_prob = walk.departure().pdf;
        parent = index_here;
      }
    }
  }

  void check_hit_lens(const ConnectContext& c, const LightWalk& walk, const Slots& slots, std::uint32_t last,
                      Vec3 wo) {
    FilmPosition film;
    const Contribution found = hit_lens(c, walk, eta_field_, film, &terms_);
    if (!(found.weight > 0)) return;
    list_.clear();
    list_.add(terms_.next);
    const WeightedVertex& before = slots[last]->v;
    list_.add_side(Chain{slots}, before, terms_.light_step, before.pdf_reverse, before.left_by_delta);
    FullPath path;
    test::set_light(path, origin_);
    fill(path, chain(slots, last), {}, nullptr);
    path.along.push_back(-wo);
    path.lens = walk.lens().camera.p;
    float distance = 0;
    scene::CameraDensity density;
    const Ray ray = scene::spawn_ray(slots[last]->v.hit, -wo);
    scene::SurfaceHit next;  // a meter is a surface of the scene
    if (!scene_.meets_camera(ray, nullptr, distance, density, rules_.film_border) &&
        !(scene_.intersect(ray, next) &&
          scene_.meets_camera(ray, &next, distance, density, rules_.film_border))) {
      ++findings_.lost;
      return;
    }
    path.lens_near = ray.origin - wo * distance;
    check(path, Technique::Kind::hit_lens, path.edge_count() + 1, found);
  }

  void to_lens(const ConnectContext& c, samplers::Sampler& sampler, const Slots& slots, std::uint32_t last) {
    const Slot& here = *slots[last];
    FilmPosition film;
    Contribution found;
    if (!connect_lens<kEdgeContent, Heuristic>(c, test::draws_of(here, sampler), here.v, eta_field_, film,
                                               found, &terms_))
      return;
    list_.clear();
    list_.add(terms_.next);
    list_.add_side(Chain{slots}, here.v, terms_.light_step, terms_.light_reverse);
    scene::CameraSample camera;
    const Vec2 u =
        scene_.reads_lens() ? sampler.draw_2d(here.block + kLens, here.stratified) : Vec2{0.5f, 0.5f};
    ASSERT_TRUE(scene_.sample_camera(here.v.hit, u, camera, rules_.film_border));
    FullPath path;
    test::set_light(path, origin_);
    fill(path, chain(slots, last), {}, &camera.wi);
    path.lens = camera.p;
    path.lens_infinite = camera.delta_direction;
    path.lens_near = camera.shadow_ray.origin + camera.shadow_ray.direction * camera.shadow_ray.t_max;
    check(path, Technique::Kind::light_image, path.edge_count(), found);
  }

  void connect_pair(const ConnectContext& c, const Slots& light, std::size_t j, const Slots& eye,
                    std::size_t i) {
    const WeightedVertex &z = light[j]->v, &y = eye[i]->v;
    if (counts_.connect == 0 || eye[i]->left || !wanted(z) || !wanted(y) || !z.connectible ||
        !y.connectible || z.edges + y.edges + 1 > rules_.max_edges)
      return;
    Contribution found;
    if (!connect<kEdgeContent, Heuristic>(c, z, y, 13, eta_, found, &terms_)) return;
    list_.clear();
    list_.add_side(Chain{light}, z, terms_.light_step, terms_.light_reverse);
    list_.add_side(Chain{eye}, y, terms_.eye_step, terms_.eye_reverse);
    const Vec3d difference = Vec3d(z.hit.p) - Vec3d(y.hit.p);
    const Vec3 between = -Vec3(difference / std::sqrt(length_squared(difference)));
    FullPath path;
    test::set_light(path, origin_);
    fill(path, chain(light, static_cast<std::uint32_t>(j)), chain(eye, static_cast<std::uint32_t>(i)),
         &between);
    set_eye_end(path);
    check(path, Technique::Kind::connect, z.edges + 1, found);
    if constexpr (!Heuristic::kMergesBeams) {
      if (every_ == 1) check_merge(path, z, y, -between);
    }
  }

  // The light's walk goes on from z to the very place of y, and is merged there.
  void check_merge(const FullPath& path, const WeightedVertex& z, const WeightedVertex& y, Vec3 to_light) {
    const bool surface = y.kind == VertexKind::surface;
    if (by_path_) return;  // no merges with such edits
    if ((surface ? counts_.merge_surface : counts_.merge_medium) == 0) return;
    const Evaluation evaluation(scene_, path, {rules_.film_border, rules_.eye_paths});
    if (!evaluation.valid()) return;
    const std::size_t s = z.edges + 1;
    float pdf = 0;
    const Spectrum scattered = scatter_value(scene_, z, z.wo, -to_light, TransportMode::importance, pdf);
    const auto reverse =
        static_cast<double>(pdf_scatter_solid_angle(scene_, z, -to_light, z.wo, TransportMode::radiance));
    const PathNumbers& n = evaluation.numbers();
    WeightedVertex arrived = y;
    arrived.wo = to_light;
    arrived.edges = z.edges + 1;
    arrived.arrival = y.density_factor(to_light);
    arrived.throughput = z.throughput * scattered * (1 / pdf);
    const typename Heuristic::Departure d =
        Heuristic::leave_vertex(z.mis, z.kind == VertexKind::surface, false, static_cast<double>(pdf),
                                reverse, static_cast<double>(z.density_factor(-to_light)));
    arrived.mis =
        Heuristic::arrive_later(d, factors_, static_cast<double>(arrived.arrival),
                                static_cast<double>(pdf) * n.survival[z.edges] / n.distance_squared[z.edges] *
                                    static_cast<double>(arrived.arrival),
                                surface);
    PhotonBuffer<MisBlock> buffer;
    if (!buffer.keep(scene_, arrived)) return;
    PhotonMap<MisBlock> map;
    const PhotonBuffer<MisBlock>* const chunks[] = {&buffer};
    constexpr float kRadius = 1e-2f;
    ASSERT_TRUE(map.build(chunks, kRadius, 1).ok());
    const MergeScale scale(Kernel::constant, kRadius, kRadius, eta_);
    MergeMaps<MisBlock> maps;
    maps.surface = maps.medium = &map;
    const Spectrum weighted = merge<Heuristic>(scene_, maps, scale, y) * response_;
    const Spectrum whole = merge<Unweighted>(scene_, maps, scale, y) * response_;
    const auto largest = static_cast<double>(whole.max_component());
    if (!(largest > 0)) return;
    const auto techniques = reference::list_techniques(n, counts_at(path));
    const auto weights = reference::weigh(techniques, kNamed<Heuristic>);
    for (std::size_t i = 0; i < techniques.size(); ++i) {
      if (techniques[i].kind != Technique::Kind::merge || techniques[i].light_vertices != s) continue;
      const double weight = static_cast<double>(weighted.max_component()) / largest;
      // Photons and what they add are floats: the smallest numbers are lost.
      if (weights[i] * largest > 1e-30)
        findings_.merge_weight.add(relative_difference(weights[i], weight) - evaluation.rounding(), kTight,
                                   fmt::format("merge s={} k={} weight {:.9g} oracle {:.9g}", s,
                                               path.edge_count(), weight, weights[i]));
      if (kEdgeContent != EdgeContent::nothing)
        return;  // what a medium or a surface takes is not in the photon
      const auto value = evaluation.estimator_value(techniques[i]);
      const auto kernel = static_cast<double>(scale.disc.value(0));
      const double error = std::max({std::abs(value[0] * kernel - static_cast<double>(whole.r)),
                                     std::abs(value[1] * kernel - static_cast<double>(whole.g)),
                                     std::abs(value[2] * kernel - static_cast<double>(whole.b))}) /
                           largest;
      findings_.merge_value.add(error - evaluation.rounding(), kTightValue,
                                fmt::format("merge s={} k={} value {:.7g} oracle {:.7g}", s,
                                            path.edge_count(), whole.r, value[0] * kernel));
    }
  }

  // TechniqueList's weights, of blocks that know no merging.
  void check_list(const PathNumbers& numbers, Technique::Kind kind, std::size_t s, double rounding,
                  const std::string& what) {
    Counts counts = counts_;
    counts.merge_surface = counts.merge_medium = 0;
    const auto techniques = reference::list_techniques(numbers, counts);
    std::size_t here = techniques.size();
    for (std::size_t i = 0; i < techniques.size(); ++i)
      if (techniques[i].kind == kind && techniques[i].light_vertices == s) here = i;
    ASSERT_LT(here, techniques.size());
    // Not where rounding decides: two that are the largest, or one at the brink of being left out.
    Scaled largest = 0;
    for (const Technique& t : techniques)
      if (largest < t.density) largest = t.density;
    int ties = 0;
    bool near_cutoff = false;
    for (const Technique& t : techniques) {
      const double ratio = (t.density / largest).value();
      ties += ratio > 0.99 ? 1 : 0;
      near_cutoff = near_cutoff || std::abs(ratio / TechniqueList::kCutoff - 1) < 0.01;
    }
    constexpr std::pair<MisHeuristic, reference::Heuristic> kPairs[] = {
        {MisHeuristic::balance, reference::Heuristic::balance},
        {MisHeuristic::power, reference::Heuristic::power},
        {MisHeuristic::maximum, reference::Heuristic::maximum},
        {MisHeuristic::cutoff, reference::Heuristic::cutoff}};
    for (const auto& [fast, slow] : kPairs) {
      if ((fast == MisHeuristic::maximum && ties > 1) || (fast == MisHeuristic::cutoff && near_cutoff))
        continue;
      const double weight = list_.weight(fast),
                   expected = reference::weigh(techniques, slow, TechniqueList::kCutoff)[here];
      findings_.listed.add(relative_difference(weight, expected) - 2 * rounding, kTight,
                           fmt::format("{} heuristic {} list {:.9g} oracle {:.9g}", what,
                                       static_cast<int>(fast), weight, expected));
    }
  }

  // With eta where the path's last edge meets the film, found from the path alone.
  Counts counts_at(const FullPath& path) const {
    scene::CameraDensity camera;
    EXPECT_TRUE(scene_.pdf_camera(path.lens_near, -path.along.back(), camera, rules_.film_border));
    if constexpr (Heuristic::kMergesBeams) return counts_;
    return counts_there(counts_, {camera.film_x, camera.film_y});
  }

  bool wanted(const WeightedVertex& v) const { return v.edges % every_ == 0; }

  void check(const FullPath& path, Technique::Kind kind, std::size_t s, const Contribution& found) {
    ++findings_.paths;
    if (kind == Technique::Kind::hit_lens) ++findings_.met_lens;
    const Evaluation evaluation(scene_, path,
                                {rules_.film_border, rules_.eye_paths, rules_.max_edges,
                                 rules_.meets_lens ? std::size_t{1} << 30 : light_rules_.max_edges});
    if (!evaluation.valid()) {
      ++findings_.lost;
      return;
    }
    if (!evaluation.media_agree()) ++findings_.media_differ;
    const Counts counts = counts_at(path);
    const auto techniques = reference::list_techniques(evaluation.numbers(), counts);
    const auto weights = reference::weigh(techniques, kNamed<Heuristic>);
    const std::size_t edges = path.edge_count();
    std::string what = std::string(name_of(kind)) + " s=" + std::to_string(s) +
                       " k=" + std::to_string(edges) + " light" + (path.light_infinite ? "(far)" : "");
    for (const auto& v : path.inner)
      what += v.delta ? " delta" : v.kind == VertexKind::medium ? " medium" : " surface";
    bool listed = false;
    for (std::size_t i = 0; i < techniques.size(); ++i) {
      if (techniques[i].kind != kind || techniques[i].light_vertices != s) continue;
      listed = true;
      findings_.weight.add(
          relative_difference(weights[i], found.weight) - evaluation.rounding(), kTight,
          what + " weight " + std::to_string(found.weight) + " oracle " + std::to_string(weights[i]));
      if (evaluation.closed_form() && !by_path_) {
        auto value = evaluation.estimator_value(techniques[i]);
        // connect() divides by the share of pairs in media that are connected.
        const auto& in_medium = evaluation.numbers().in_medium;
        if (kind == Technique::Kind::connect && in_medium[s - 1] && in_medium[s])
          for (double& v : value) v /= counts.connect_media;
        const bool from_eye = kind != Technique::Kind::light_image && kind != Technique::Kind::hit_lens;
        const Spectrum here = found.value * (from_eye ? response_ : 1.0f);
        const double got[] = {static_cast<double>(here.r), static_cast<double>(here.g),
                              static_cast<double>(here.b)};
        const double largest = std::max({got[0], got[1], got[2]});
        double error = 0;
        for (int k = 0; k < 3; ++k)
          error = std::max(error, std::abs(value[static_cast<std::size_t>(k)] - got[k]) / largest);
        findings_.value.add(error - evaluation.rounding(), kTightValue,
                            what + fmt::format(" value {:.7g} {:.7g} {:.7g} oracle {:.7g} {:.7g} {:.7g}",
                                               got[0], got[1], got[2], value[0], value[1], value[2]));
      }
    }
    if (!listed) findings_.weight.add(1, kTight, what + " not listed");
    if constexpr (std::is_same_v<Heuristic, Balance>)
      check_list(evaluation.numbers(), kind, s, evaluation.rounding(), what);
    if (edges == 1) return;
    const auto recursive = recursive_weights<Heuristic>(evaluation.numbers(), counts, techniques);
    double sum = 0;
    for (std::size_t i = 0; i < techniques.size(); ++i) {
      sum += recursive[i];
      // Weights far below one are compared as far as they matter.
      const double error = std::abs(recursive[i] - weights[i]) / std::max(weights[i], 1e-200);
      if (!(error <= findings_.largest_recursion_error)) findings_.largest_recursion_error = error;
    }
    if (!(std::abs(sum - 1) <= findings_.largest_sum_error)) findings_.largest_sum_error = std::abs(sum - 1);
  }

  const scene::Scene& scene_;
  const WalkRules& rules_;
  WalkRules light_rules_;
  Findings& findings_;
  Counts counts_;
  MisFactors factors_;
  std::vector<MediumMerges> merges_;
  VaryingEta<Heuristic> eta_field_;
  MergeFactors eta_;  // along the eye path
  std::uint32_t every_;
  const bool by_path_ =
      scene_.objects().path_edits != nullptr;  // edits whose values the oracle does not know
  film::SampleCounts sample_counts_;
  TechniqueList list_;
  WeightTerms terms_;
  scene::CameraDensity camera_;
  Vec3 lens_near_;
  float response_ = 1;  // of the sensor to the eye path's ray, which estimators multiply with
  scene::EmissionSample origin_;
};

}  // namespace candela::transport
