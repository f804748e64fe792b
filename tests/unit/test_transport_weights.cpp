// Claims, on random paths through every scene of tests/statistical/transport and gallery, and
// ../shared/scenes where it is there. The oracle is worker/transport/reference.h: literal products in double.
// - The weights of the recursion (mis.h), driven with the numbers of one path, are those of the literal
//   products, and over all techniques that can make the path they sum to one: both to 1e-12, for the balance
//   and the power heuristic, any technique left out, eta from 1e-12 to 1e12.
// - The weights and values that the kernels' functions return (connect.h, emission.h) are those of the oracle
//   for the path they made: weights to 1e-5, values to 1e-4, besides what floats are known to lose
//   (Evaluation::rounding). The oracle finds surfaces passed and lights by rays of its own, and its
//   directions differ in the last bit: one path in a thousand may differ more in its weight (narrow lobes),
//   one in fifty in its value (opacity and radiance from textures at places found anew), by at most what is
//   stated below.
// - Weights stay numbers on paths of a thousand vertices.
// Deterministic: nothing is random but the paths, which have fixed seeds.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "tests/unit/transport_paths.h"

namespace candela::transport {
namespace {

namespace fs = std::filesystem;
using reference::Counts;
using reference::Evaluation;
using reference::FullPath;
using reference::PathNumbers;
using reference::Technique;
using test::Slot;
using test::Slots;

template <class Heuristic>
constexpr reference::Heuristic kNamed = reference::Heuristic::balance;
template <>
constexpr reference::Heuristic kNamed<Power> = reference::Heuristic::power;

template <class Heuristic>
MisFactors factors_of(const Counts& c) {
  return {c.hit_light, c.next_event, c.connect, Heuristic::raise(c.light_image),
          Heuristic::raise(c.hit_lens)};
}
template <class Heuristic>
MergeFactors eta_of(const Counts& c) {
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
  const auto merged = [&](std::size_t i) { return n.in_medium[i] ? eta.medium : eta.surface; };

  std::vector<MisBlock> light(k + 1), eye(k + 1);
  Departure d = leave_end<Heuristic>(factors.hit_light, n.light_prob, n.light_can_be_hit, n.pdf_to_eye[0],
                                     n.factor_to_eye[0]);
  light[1] = arrive_from_light<Heuristic>(d, factors, n.factor_to_light[1], n.light_density(1),
                                          n.delta[1] ? 0 : n.light_direct, n.light_prob);
  for (std::size_t i = 1; i < k; ++i) {
    d = leave_vertex<Heuristic>(light[i], !n.in_medium[i], n.delta[i], n.pdf_to_eye[i], n.pdf_to_light[i],
                                n.factor_to_eye[i]);
    if (i + 1 < k)
      light[i + 1] = arrive_later<Heuristic>(d, factors, n.factor_to_light[i + 1], n.light_density(i + 1));
  }
  const Departure to_lens = d;
  d = leave_end<Heuristic>(factors.hit_lens, n.lens_prob, n.lens_can_be_hit, n.pdf_to_light[k],
                           n.factor_to_light[k]);
  eye[k - 1] =
      arrive_from_eye<Heuristic>(d, factors, n.factor_to_eye[k - 1], n.eye_density(k - 1), n.survival[k - 1]);
  for (std::size_t i = k - 1; i > 0; --i) {
    d = leave_vertex<Heuristic>(eye[i], !n.in_medium[i], n.delta[i], n.pdf_to_light[i], n.pdf_to_eye[i],
                                n.factor_to_light[i]);
    eye[i - 1] = arrive_later<Heuristic>(d, factors, n.factor_to_eye[i - 1], n.eye_density(i - 1));
  }

  std::vector<double> weights;
  for (const Technique& t : techniques) {
    const std::size_t s = t.light_vertices;
    double rest = 0;
    switch (t.kind) {
      case Technique::Kind::hit_light: {
        MisBlock block = eye[0];
        block.known = n.delta[1] ? 0 : factors.next_event * raise(n.light_direct / n.eye_density(0));
        rest = sum_of<Heuristic>(block, n.light_prob * n.pdf_to_eye[0], eta);
        break;
      }
      case Technique::Kind::next_event: {
        const double hit = n.light_can_be_hit ? n.eye_density(0) / n.light_direct : 0;
        const double traced = n.light_prob * n.light_density(1) / n.light_direct;
        rest = factors.hit_light * raise(hit) +
               raise(traced) * (merged(1) + sum_of<Heuristic>(eye[1], n.pdf_to_eye[1], eta));
        break;
      }
      case Technique::Kind::connect:
        rest = raise(n.eye_density(s - 1)) *
                   (merged(s - 1) + sum_of<Heuristic>(light[s - 1], n.pdf_to_light[s - 1], eta)) +
               raise(n.light_density(s)) * (merged(s) + sum_of<Heuristic>(eye[s], n.pdf_to_eye[s], eta));
        break;
      case Technique::Kind::light_image: {
        const double met = n.lens_can_be_hit ? n.light_density(k) / n.lens_connect : 0;
        rest = (raise(n.eye_density(k - 1)) *
                    (merged(k - 1) + sum_of<Heuristic>(light[k - 1], n.pdf_to_light[k - 1], eta)) +
                factors.hit_lens * raise(met)) /
               factors.light_image;
        break;
      }
      case Technique::Kind::hit_lens: {
        const double traced =
            n.lens_prob * n.pdf_to_light[k] * n.survival[k - 1] * to_lens.leave / n.factor_to_light[k];
        rest = raise(traced) * (to_lens.carried.pending + to_lens.carried.pending_surface * eta.surface +
                                to_lens.carried.pending_medium * eta.medium);
        if (to_lens.connects > 0) rest += factors.light_image * raise(n.lens_connect / n.light_density(k));
        rest /= factors.hit_lens;
        break;
      }
      case Technique::Kind::merge:
        rest = (sum_of<Heuristic>(light[s], n.pdf_to_light[s], eta) +
                sum_of<Heuristic>(eye[s], n.pdf_to_eye[s], eta)) /
               merged(s);
        break;
    }
    weights.push_back(1 / (1 + rest));
  }
  return weights;
}

double relative_difference(double a, double b) {
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

constexpr double kOfRecursion = 1e-12, kTight = 1e-5, kTightValue = 1e-4;

struct Findings {
  std::size_t paths = 0, lost = 0, media_differ = 0, replayed = 0;
  double largest_sum_error = 0, largest_recursion_error = 0;
  Errors weight, value;
};

const char* name_of(Technique::Kind kind) {
  constexpr const char* kNames[] = {"hit_light", "next_event", "connect", "light_image", "hit_lens", "merge"};
  return kNames[static_cast<int>(kind)];
}

// What is left out, from path to path.
Counts counts_of(std::uint64_t i, bool lens) {
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

template <Between kBetween, class Heuristic>
class PathTest {
 public:
  using EyeWalk = Walk<TransportMode::radiance, kBetween, Heuristic>;
  using LightWalk = Walk<TransportMode::importance, kBetween, Heuristic>;

  PathTest(const scene::Scene& scene, const WalkRules& rules, Findings& findings)
      : scene_(scene), rules_(rules), light_rules_(rules), findings_(findings) {
    --light_rules_.max_edges;
  }

  // One eye and one light subpath, and all that can be made of them.
  void run(std::uint64_t index) {
    counts_ = counts_of(index, rules_.meets_lens);
    factors_ = factors_of<Heuristic>(counts_);
    eta_ = eta_of<Heuristic>(counts_);
    const ConnectContext c{scene_, factors_, rules_, tallies_};
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
    float response = 1;
    const float x = stream.next_float() * test::kFilmSize, y = stream.next_float() * test::kFilmSize;
    const Vec2 u_lens{stream.next_float(), stream.next_float()};
    const Ray ray = scene_.camera_ray(x, y, u_lens, response);
    if (!scene_.pdf_camera(ray.origin, ray.direction, camera_, rules_.film_border)) return;
    lens_near_ = ray.origin;
    EyeWalk walk(scene_, rules_, factors_, sampler, tallies_);
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
      const auto index_here = static_cast<std::uint32_t>(slots.size() - 1);
      const Vertex* before = parent == scene::kNone ? nullptr : &slots[parent]->v;
      Contribution found;
      if (counts_.hit_light > 0 && hit_light<Heuristic>(c, here.v, here.left, before, eta_, found))
        check_hit_light(slots, index_here, found);
      if (here.left) return;
      if (counts_.next_event > 0 && here.v.connects && here.v.edges < rules_.max_edges)
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
    if (!next_event<kBetween, Heuristic>(c, sampler, here.block, here.stratified, true, here.v, eta_, found))
      return;
    scene::DirectSample light;
    ASSERT_TRUE(scene_.sample_direct(here.v.hit, here.v.front,
                                     sampler.draw_1d(here.block + kEmitterChoice, here.stratified),
                                     sampler.draw_2d(here.block + kEmitterPoint, here.stratified), light));
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
    LightWalk walk(scene_, light_rules_, factors_, sampler, tallies_);
    if (!walk.start_light()) return;
    origin_ = walk.origin();
    std::uint32_t parent = scene::kNone;
    for (;;) {
      auto slot = std::make_unique<Slot>();
      const auto event = walk.advance(slot->v, slot->arena);
      if (walk.lens().met && counts_.hit_lens > 0) check_hit_lens(c, walk, slots, parent, slot->v.wo);
      if (event != LightWalk::Event::vertex) return;
      note(walk, *slot, parent);
      slots.push_back(std::move(slot));
      Slot& here = *slots.back();
      const auto index_here = static_cast<std::uint32_t>(slots.size() - 1);
      if (counts_.light_image > 0 && here.v.connects && here.v.edges < rules_.max_edges)
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
    const Contribution found = hit_lens<Heuristic>(c, walk, eta_, film);
    if (!(found.weight > 0)) return;
    FullPath path;
    test::set_light(path, origin_);
    fill(path, chain(slots, last), {}, nullptr);
    path.along.push_back(-wo);
    path.lens = walk.lens().camera.p;
    float distance = 0;
    scene::CameraDensity density;
    const Vec3 p = slots[last]->v.hit.p;
    if (!scene_.intersect_camera({p, -wo}, distance, density, rules_.film_border)) {
      ++findings_.lost;
      return;
    }
    path.lens_near = p - wo * distance;
    check(path, Technique::Kind::hit_lens, path.edge_count() + 1, found);
  }

  void to_lens(const ConnectContext& c, samplers::Sampler& sampler, const Slots& slots, std::uint32_t last) {
    const Slot& here = *slots[last];
    FilmPosition film;
    Contribution found;
    if (!connect_lens<kBetween, Heuristic>(c, sampler, here.block, here.stratified, here.v, eta_, film,
                                           found))
      return;
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
    const Vertex &z = light[j]->v, &y = eye[i]->v;
    if (counts_.connect == 0 || eye[i]->left || !z.connects || !y.connects ||
        z.edges + y.edges + 1 > rules_.max_edges)
      return;
    Contribution found;
    if (!connect<kBetween, Heuristic>(c, z, y, 13, eta_, found)) return;
    const Vec3d difference = Vec3d(z.hit.p) - Vec3d(y.hit.p);
    const Vec3 between = -Vec3(difference / std::sqrt(length_squared(difference)));
    FullPath path;
    test::set_light(path, origin_);
    fill(path, chain(light, static_cast<std::uint32_t>(j)), chain(eye, static_cast<std::uint32_t>(i)),
         &between);
    set_eye_end(path);
    check(path, Technique::Kind::connect, z.edges + 1, found);
  }

  void check(const FullPath& path, Technique::Kind kind, std::size_t s, const Contribution& found) {
    ++findings_.paths;
    const Evaluation evaluation(scene_, path,
                                {rules_.film_border, rules_.eye_paths, rules_.max_edges,
                                 rules_.meets_lens ? std::size_t{1} << 30 : light_rules_.max_edges});
    if (!evaluation.valid()) {
      ++findings_.lost;
      return;
    }
    if (!evaluation.media_agree()) ++findings_.media_differ;
    const auto techniques = reference::list_techniques(evaluation.numbers(), counts_);
    const auto weights = reference::weigh(techniques, kNamed<Heuristic>);
    const std::size_t edges = path.edge_count();
    std::string what = std::string(name_of(kind)) + " s=" + std::to_string(s) +
                       " k=" + std::to_string(edges) + " light" + (path.light_infinite ? "(far)" : "");
    for (const auto& v : path.inner)
      what += v.delta ? " delta" : v.kind == Vertex::Kind::medium ? " medium" : " surface";
    bool listed = false;
    for (std::size_t i = 0; i < techniques.size(); ++i) {
      if (techniques[i].kind != kind || techniques[i].light_vertices != s) continue;
      listed = true;
      findings_.weight.add(
          relative_difference(weights[i], found.weight) - evaluation.rounding(), kTight,
          what + " weight " + std::to_string(found.weight) + " oracle " + std::to_string(weights[i]));
      if (evaluation.closed_form()) {
        const auto value = evaluation.estimator_value(techniques[i]);
        const double got[] = {static_cast<double>(found.value.r), static_cast<double>(found.value.g),
                              static_cast<double>(found.value.b)};
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
    if (edges == 1) return;
    const auto recursive = recursive_weights<Heuristic>(evaluation.numbers(), counts_, techniques);
    double sum = 0;
    for (std::size_t i = 0; i < techniques.size(); ++i) {
      sum += recursive[i];
      // Weights far below one are compared as far as they matter.
      const double error = std::abs(recursive[i] - weights[i]) / std::max(weights[i], 1e-200);
      if (!(error <= findings_.largest_recursion_error)) findings_.largest_recursion_error = error;
    }
    ++findings_.replayed;
    if (!(std::abs(sum - 1) <= findings_.largest_sum_error)) findings_.largest_sum_error = std::abs(sum - 1);
  }

  const scene::Scene& scene_;
  const WalkRules& rules_;
  WalkRules light_rules_;
  Findings& findings_;
  Counts counts_;
  MisFactors factors_;
  MergeFactors eta_;
  film::Tallies tallies_;
  scene::CameraDensity camera_;
  Vec3 lens_near_;
  scene::EmissionSample origin_;
};

template <Between kBetween>
void run_all(const scene::Scene& scene, const WalkRules& rules, std::uint64_t pairs, Findings& findings) {
  PathTest<kBetween, Balance> balance(scene, rules, findings);
  PathTest<kBetween, Power> power(scene, rules, findings);
  for (std::uint64_t i = 0; i < pairs; ++i) {
    if (i % 2 == 0)
      balance.run(i / 2);
    else
      power.run(i / 2);
  }
}

std::vector<fs::path> scene_files() {
  std::vector<fs::path> files;
  for (const char* folder : {"transport", "gallery"})
    for (const auto& entry :
         fs::directory_iterator(fs::path(CANDELA_SOURCE_DIR "/tests/statistical") / folder))
      if (entry.path().extension() == ".xml") files.push_back(entry.path());
  const char* given = std::getenv("CANDELA_SHARED");
  const fs::path shared = fs::path(given != nullptr ? given : CANDELA_SOURCE_DIR "/../shared") / "scenes";
  if (fs::is_directory(shared))
    for (const auto& entry : fs::directory_iterator(shared))
      if (fs::exists(entry.path() / "scene.xml")) files.push_back(entry.path() / "scene.xml");
  std::sort(files.begin(), files.end());
  return files;
}

std::string label(const fs::path& file) {
  std::string text = file.stem() == "scene" ? file.parent_path().stem().string()
                                            : file.parent_path().stem().string() + "_" + file.stem().string();
  for (char& c : text)
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  return text;
}

double uniform(rng::Stream& stream) {
  return static_cast<double>(stream.next_float());
}

// The numbers of a path that no scene has: densities over `decades` orders of magnitude.
PathNumbers invented_path(rng::Stream& stream, std::size_t k, double decades) {
  const auto any = [&] { return std::pow(10.0, decades * (uniform(stream) - 0.5)); };
  PathNumbers n;
  n.edges = k;
  n.light_can_be_hit = uniform(stream) < 0.7;
  n.lens_can_be_hit = uniform(stream) < 0.7;
  n.light_prob = any();
  n.light_direct = any();
  n.lens_prob = any();
  n.lens_connect = n.lens_prob;
  for (std::size_t i = 0; i <= k; ++i) {
    const bool end = i == 0 || i == k;
    n.pdf_to_eye.push_back(any());
    n.pdf_to_light.push_back(any());
    n.factor_to_eye.push_back(end ? 1 : uniform(stream) + 1e-6);
    n.factor_to_light.push_back(end ? 1 : uniform(stream) + 1e-6);
    n.delta.push_back(!end && uniform(stream) < 0.3);
    n.in_medium.push_back(!end && !n.delta.back() && uniform(stream) < 0.3);
    if (i == k) break;
    n.survival.push_back(uniform(stream) + 1e-3);
    n.distance_squared.push_back(any());
  }
  return n;
}

template <class Heuristic>
void expect_recursion_holds(std::size_t k, double decades, std::uint64_t paths, bool finite_only = false) {
  for (std::uint64_t i = 0; i < paths; ++i) {
    rng::Stream stream(rng::key(17, i));
    const PathNumbers n = invented_path(stream, k, decades);
    const Counts counts = counts_of(i, true);
    const auto techniques = reference::list_techniques(n, counts);
    const auto weights = reference::weigh(techniques, kNamed<Heuristic>);
    const auto recursive = recursive_weights<Heuristic>(n, counts, techniques);
    double sum = 0;
    for (std::size_t t = 0; t < techniques.size(); ++t) {
      ASSERT_TRUE(recursive[t] >= 0 && recursive[t] <= 1) << recursive[t] << " path " << i;
      if (finite_only) continue;
      ASSERT_LE(std::abs(recursive[t] - weights[t]), 1e-9 * weights[t] + 1e-200) << "path " << i;
      sum += recursive[t];
    }
    const double expected = techniques.empty() || finite_only ? 0 : 1;
    ASSERT_LE(std::abs(sum - expected), 1e-9) << "path " << i;
  }
}

TEST(TransportWeights, HoldForAnyDensities) {
  for (const std::size_t k : {2u, 3u, 5u, 20u}) {
    expect_recursion_holds<Balance>(k, 8, 500);
    expect_recursion_holds<Power>(k, 8, 500);
  }
}

TEST(TransportWeights, HoldOnPathsOfAThousandVertices) {
  expect_recursion_holds<Balance>(1000, 1, 12);
  expect_recursion_holds<Power>(1000, 1, 12);
  // Here the densities of techniques differ by more than doubles can say.
  expect_recursion_holds<Balance>(1000, 8, 60, true);
  expect_recursion_holds<Power>(1000, 8, 60, true);
}

class SceneWeights : public testing::TestWithParam<fs::path> {};

TEST_P(SceneWeights, AreThoseOfTheLiteralFormulas) {
  const auto scene = test::load_scene(GetParam());
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  const scene::SceneFeatures& features = (*scene)->features();
  WalkRules rules;
  rules.max_edges = 8;
  rules.rr_depth = 1u << 30;
  rules.meets_lens = features.finite_lens;
  rules.film_border = 1;
  rules.eye_paths = static_cast<double>(test::kFilmSize) * test::kFilmSize;
  Findings f;
  constexpr std::uint64_t kPairs = 400;
  if (features.media > 0)
    run_all<Between::media>(**scene, rules, kPairs, f);
  else if (features.any_straight)
    run_all<Between::surfaces>(**scene, rules, kPairs, f);
  else
    run_all<Between::nothing>(**scene, rules, kPairs, f);
  const std::string name = label(GetParam());
  std::printf(
      "%zu paths, %zu lost; recursion %.1e, sum %.1e; weights: %zu loose, up to %.1e; %zu values: %zu loose, "
      "up to %.1e\n",
      f.paths, f.lost, f.largest_recursion_error, f.largest_sum_error, f.weight.loose, f.weight.largest,
      f.value.count, f.value.loose, f.value.largest);
  EXPECT_GE(f.paths, 200u);
  EXPECT_LE(f.lost, f.paths / 200);
  EXPECT_EQ(f.media_differ, 0u) << "a medium is another one from the light than from the eye";
  EXPECT_LE(f.largest_recursion_error, kOfRecursion);
  EXPECT_LE(f.largest_sum_error, kOfRecursion);
  // Narrow lobes make much of the last bits of a direction: of roughness 0.003, or refracted by 1.01.
  const bool narrow = name == "transport_near_delta" || name == "transport_index_matched";
  EXPECT_LE(f.weight.loose, 1 + f.weight.count * (narrow ? 50 : 1) / 1000) << f.weight.worst;
  EXPECT_LE(f.weight.largest, narrow ? 5e-3 : 5e-4) << f.weight.worst;
  EXPECT_LE(f.value.loose, 1 + f.value.count * 20 / 1000) << f.value.worst;
  EXPECT_LE(f.value.largest, 1e-2) << f.value.worst;
}

INSTANTIATE_TEST_SUITE_P(Scenes, SceneWeights, testing::ValuesIn(scene_files()),
                         [](const auto& test) { return label(test.param); });

}  // namespace
}  // namespace candela::transport
