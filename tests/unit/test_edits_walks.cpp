// Walks whose edits select by more of the path than the vertex (path_edited.h).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "common/rng/stream.h"
#include "edits_fixture.h"
#include "worker/scene/bsdfs/path_edited.h"
#include "worker/transport/technique/merge_edits.h"

namespace candela::scene {
namespace {

// Three objects: a lamp, the panel, and the floor, which is not edited. Edits of light act at the panel if
// the light came by the floor, those of the eye if the eye sees the panel by the floor.
struct Walks {
  std::unique_ptr<Edited> e;
  SceneObjects objects;
  std::unique_ptr<PathEdits> all;

  Walks(const std::string& bsdf, const std::string& light, const std::string& eye, bool bumpy) {
    std::string list = light;
    list.replace(list.find("LX*X"), 4, "LX{floor}X{panel}");
    std::string gather = eye;
    gather.replace(gather.find("XX*E"), 4, "X{panel}X{floor}E");
    e = make({"", bsdf, list + "," + gather, bumpy});
    objects.names = {{"lamp"}, {"panel"}, {"floor"}};
    objects.uses = {letters::kLampObject, letters::kSurfaceObject, letters::kSurfaceObject};
    objects.of_shape = {1, 2};
    objects.of_emitter = {0};
    const auto states = [&](edits::Edit::Direction direction) {
      return *edits::PathStates::compile(e->list, direction, objects.names, objects.uses);
    };
    all = std::make_unique<PathEdits>(PathEdits{states(edits::Edit::Direction::light),
                                                states(edits::Edit::Direction::eye),
                                                &e->scene,
                                                &objects,
                                                {true, true}});
  }
};

// A walk up to the panel.
struct AtPanel {
  EditedWalk walk;
  ClosureArena arena, floor_arena;
  Closure closure;
  float floor_throughput = 1;

  AtPanel(const Walks& w, bool from_light, bool by_floor, Vec3 wo) : walk(*w.all, true) {
    if (from_light)
      walk.begin_at_lamp(0);
    else
      walk.begin_at_eye();
    Closure plain;
    if (by_floor) {
      const auto floor = make({"", kDiffuse, kTurn});
      SurfaceHit hit = floor->hit;
      hit.shape = 1;
      floor->bsdfs[0].prepare(hit, {0, 0, 1}, floor_arena, plain);
      const Closure on_floor = walk.surface(hit, plain);
      BsdfSample s;
      EXPECT_TRUE(on_floor.sample({0, 0, 1}, 0.5f, {0.3f, 0.4f}, from_light ? kImportance : kRadiance, s));
    }
    SurfaceHit hit = w.e->hit;
    hit.shape = 0;
    w.e->bsdfs[0].prepare(hit, wo, arena, plain);
    closure = walk.surface(hit, plain);
  }
};

// The end that a walk at the panel is connected to: a walk at the floor, or none.
void meet(AtPanel& at, const Walks& w, bool from_light, bool by_floor) {
  if (!by_floor) {
    if (from_light)
      at.walk.towards_eye();
    else
      at.walk.towards_lamp(0);
    return;
  }
  EditedWalk end(*w.all, true);
  if (from_light)
    end.begin_at_eye();
  else
    end.begin_at_lamp(0);
  const auto floor = make({"", kDiffuse, kTurn});
  SurfaceHit hit = floor->hit;
  hit.shape = 1;
  ClosureArena arena;
  Closure plain;
  floor->bsdfs[0].prepare(hit, {0, 0, 1}, arena, plain);
  static_cast<void>(end.surface(hit, plain));
  at.walk.towards(end, floor->hit.shading.to_world({0, 0, 1}),
                  -floor->hit.shading.to_world(normalize(Vec3{0.3f, 0, 1})));
}

// Claim: an edit acts if both ends say so, whichever walk knows which end; walks from both ends see one
// value, that of the closure with the edits that act, and tell one density of each walk, whatever acts: so
// weights are one function of the path, and sum to one.
TEST(EditedWalks, AreOneBsdfFromBothEnds) {
  for (const auto& [bsdf, light, eye, bumpy] :
       {std::tuple{kRough, kHighlight, kGather, false}, std::tuple{kDiffuse, kMove, kGather, true},
        std::tuple{kPlastic, kTurn, kGather, false}, std::tuple{kGlass, kTurn, kGather, false}}) {
    const Walks w(bsdf, light, eye, bumpy);
    rng::Stream stream(rng::key(81));
    int compared = 0, told = 0;
    for (int i = 0; i < 800; ++i) {
      const Vec3 o = test::uniform_direction(stream), l = test::uniform_direction(stream);
      float densities[2] = {-1, -1};
      for (const bool lit : {false, true})
        for (const bool seen : {false, true}) {
          AtPanel from_eye(w, false, seen, o), from_light(w, true, lit, l);
          meet(from_eye, w, false, lit);
          meet(from_light, w, true, seen);
          SurfaceEdits::Treatments treatments;
          for (auto& lobe : treatments)
            for (auto& t : lobe)
              t = {static_cast<std::uint16_t>(lit ? 1 : 0), static_cast<std::uint16_t>(seen ? 2 : 0)};
          const At eye_at(*w.e, o), light_at(*w.e, l);
          const Frame frame = w.e->hit.shading;
          const EditedClosure expected{
              &eye_at.plain, &w.e->scene,
              &treatments,   frame,
              w.e->hit.p,    w.e->hit.ng == frame.n ? Vec3{0, 0, 1} : frame.to_local(w.e->hit.ng)};
          float pdf = 0, unused = 0;
          const Spectrum by_eye = from_eye.closure.eval_pdf(o, l, kRadiance, pdf);
          const Spectrum wanted = eval_pdf(expected, o, l, kRadiance, unused);
          EXPECT_NEAR(by_eye.g, wanted.g, 1e-5f + 1e-4f * wanted.g) << lit << seen;
          const Spectrum by_light =
              from_light.closure.eval_pdf(l, o, kImportance, unused) * light_at.correction(l, o);
          const double a = static_cast<double>(by_eye.g) * eye_at.geometric(o),
                       b = static_cast<double>(by_light.g) * eye_at.geometric(l);
          EXPECT_NEAR(a, b, 2e-3 * (a + b) + 1e-5) << lit << seen;
          compared += a > 0;
          // For the eye's walk and the light's, as each of the two tells it.
          EXPECT_EQ(pdf, from_light.closure.pdf_solid_angle(o, l, kRadiance));
          EXPECT_EQ(unused, from_eye.closure.pdf_solid_angle(l, o, kImportance));
          if (densities[0] >= 0) {
            EXPECT_EQ(pdf, densities[0]);
            EXPECT_EQ(unused, densities[1]);
            ++told;
          }
          densities[0] = pdf;
          densities[1] = unused;
          EXPECT_TRUE(by_eye.g == 0 || pdf > 0);
          EXPECT_TRUE(by_light.g == 0 || unused > 0);
        }
    }
    EXPECT_GT(compared, 300) << bsdf;
    EXPECT_GT(told, 2000) << bsdf;
  }
}

// The floor as the last vertex of a walk that comes from the panel.
class LastAtFloor {
 public:
  explicit LastAtFloor(bool from_light)
      : from_light_(from_light), mode_(from_light ? kImportance : kRadiance) {
    floor_->hit.shape = 1;
    floor_->bsdfs[0].prepare(floor_->hit, wo_, arena_, plain_);
    float pdf = 0;
    all_ = plain_.eval_pdf(wo_, wi_, mode_, pdf).r;
  }
  // The share of the walk's light for the end behind the floor.
  float share(const EditedWalk& at_panel) const {
    EditedWalk walk(at_panel);
    const Closure closure = walk.surface(floor_->hit, plain_);
    if (from_light_)
      walk.towards_eye();
    else
      walk.towards_lamp(0);
    float pdf = 0;
    return closure.eval_pdf(wo_, wi_, mode_, pdf).r / all_;
  }

 private:
  const bool from_light_;
  const TransportMode mode_;
  const Vec3 wo_{0, 0, 1}, wi_ = normalize(Vec3{0.3f, 0, 1});
  const std::unique_ptr<Edited> floor_ = make({"", kDiffuse, kTurn});
  ClosureArena arena_;
  Closure plain_;
  float all_ = 0;
};

// Claim: sums over what a walk draws, by the share of each end that it may come to, are the integrals of the
// value for that end: an end next to the panel, and one behind the floor, for which other edits act. Fails by
// chance with probability below 1e-5 for each of the 96 sums.
TEST(EditedWalks, DrawForAllEndsAtOnce) {
  constexpr int kSamples = 12000;
  for (const auto& [bsdf, light] :
       {std::pair{kRough, kHighlight}, std::pair{kDiffuse, kMove}, std::pair{kPlastic, kTurn}})
    for (const bool from_light : {false, true})
      for (const bool by_floor : {false, true}) {
        const Walks w(bsdf, light, kGather, false);
        const TransportMode mode = from_light ? kImportance : kRadiance;
        const Vec3 wo = directions_from()[0];
        AtPanel at(w, from_light, by_floor, wo);
        std::array<Sums, 2> exact;  // by whether the other end is the floor
        for (const bool end_by_floor : {false, true}) {
          meet(at, w, from_light, end_by_floor);
          over_sphere([&](Vec3 wi, double area) {
            float pdf = 0;
            exact[end_by_floor].add(wi, static_cast<double>(at.closure.eval_pdf(wo, wi, mode, pdf).r), 0,
                                    area);
          });
          EXPECT_GT(exact[end_by_floor].value[0], 0.1);
        }
        const LastAtFloor floor(from_light);
        rng::Stream stream(rng::key(91));
        std::array<std::array<double, kTests>, 2> mean{}, squares{};
        for (int i = 0; i < kSamples; ++i) {
          const float u_lobe = stream.next_float(), u = stream.next_float(), v = stream.next_float();
          BsdfSample s;
          if (!at.closure.sample(wo, u_lobe, {u, v}, mode, s)) continue;
          const std::array<float, 2> share = {
              from_light ? at.walk.share_at_eye().r : at.walk.share_at_lamp(0).r, floor.share(at.walk)};
          const auto t = tests_of(s.wi);
          for (std::size_t end = 0; end < 2; ++end)
            for (std::size_t k = 0; k < kTests; ++k) {
              const double x = static_cast<double>(s.weight.r * share[end]) * t[k];
              mean[end][k] += x / kSamples;
              squares[end][k] += x * x / kSamples;
            }
        }
        for (std::size_t end = 0; end < 2; ++end)
          for (std::size_t k = 0; k < kTests; ++k)
            EXPECT_NEAR(
                mean[end][k], exact[end].value[k],
                4.5 * std::sqrt(std::max(0.0, squares[end][k] - mean[end][k] * mean[end][k]) / kSamples) +
                    6e-3 * exact[end].value[0])
                << bsdf << light << from_light << by_floor << end << k;
      }
}

// Claim: of delta lobes, too, a walk draws for all ends that it may come to: sums by the share of each end
// are those of the closure that knows its edits. (Other lobes reach all directions, whatever direction they
// are drawn from.) Fails by chance with probability below 1e-5 for each of the 64 sums.
TEST(EditedWalks, DrawDeltaLobesForAllEnds) {
  constexpr int kSamples = 6000;
  const std::string mirror = "<bsdf type='conductor'/>", glass = "<bsdf type='dielectric'/>";
  for (const auto& [bsdf, light] : {std::pair{mirror, kTurn}, std::pair{glass, kMove}})
    for (const bool from_light : {false, true}) {
      const Walks w(bsdf, light, kGather, false);
      const TransportMode mode = from_light ? kImportance : kRadiance;
      const LastAtFloor floor(from_light);
      // Towards what kGather gathers, and elsewhere.
      for (const Vec3 wo : {normalize(Vec3{-0.9f, 0.1f, 0.7f}), directions_from()[0]}) {
        AtPanel at(w, from_light, false, wo);
        const At here(*w.e, wo);
        std::array<std::array<double, kTests>, 4> mean{}, squares{};  // by end: drawn, then of the closure
        const auto count = [&](std::size_t row, const BsdfSample& s, float share) {
          const auto t = tests_of(s.wi);
          for (std::size_t k = 0; k < kTests; ++k) {
            const double x = static_cast<double>(s.weight.g * share) * t[k];
            mean[row][k] += x / kSamples;
            squares[row][k] += x * x / kSamples;
          }
        };
        rng::Stream stream(rng::key(17));
        for (int i = 0; i < kSamples; ++i) {
          BsdfSample s;
          if (at.closure.sample(wo, stream.next_float(), {0.5f, 0.5f}, mode, s)) {
            count(0, s, from_light ? at.walk.share_at_eye().g : at.walk.share_at_lamp(0).g);
            count(1, s, floor.share(at.walk));
          }
          for (const bool end_by_floor : {false, true}) {
            // The walk's own end is next to the panel: the edits of that end do not act.
            const auto bits = static_cast<std::uint16_t>(end_by_floor ? (from_light ? 2 : 1) : 0);
            SurfaceEdits::Treatments treatments;
            for (auto& lobe : treatments)
              for (auto& t : lobe)
                t = from_light ? SurfaceEdits::Treatment{0, bits} : SurfaceEdits::Treatment{bits, 0};
            const Frame frame = w.e->hit.shading;
            const EditedClosure expected{&here.plain, &w.e->scene, &treatments, frame, w.e->hit.p, {0, 0, 1}};
            BsdfSample known;
            if (sample(expected, wo, stream.next_float(), {0.5f, 0.5f}, mode, known))
              count(2 + (end_by_floor ? 1 : 0), known, 1);
          }
        }
        for (std::size_t end = 0; end < 2; ++end)
          for (std::size_t k = 0; k < kTests; ++k) {
            const auto variance = [&](std::size_t row) {
              return std::max(0.0, squares[row][k] - mean[row][k] * mean[row][k]) / kSamples;
            };
            EXPECT_NEAR(mean[end][k], mean[2 + end][k],
                        4.5 * std::sqrt(variance(end) + variance(2 + end)) + 1e-4)
                << bsdf << from_light << wo.x << end << k;
          }
        EXPECT_GT(mean[2][0], 0.1);
      }
    }
}

// Claim: a photon merges with the eye's vertex at its place as its light path would be connected to the eye
// from there: its light takes the share of the eye's state behind the vertex, and the vertex scatters by the
// state of the lamp's end before it.
TEST(EditedWalks, MergeAsTheyConnect) {
  const Walks w(kDiffuse, kMove, kGather, false);
  const Vec3 down{0, 0, 1}, wi = normalize(Vec3{0.3f, 0, 1});
  const auto floor = make({"", kDiffuse, kTurn});
  floor->hit.shape = 1;
  ClosureArena arena;
  Closure plain;
  floor->bsdfs[0].prepare(floor->hit, down, arena, plain);
  transport::ScatterPoint v;
  v.kind = transport::VertexKind::surface;
  // Light that leaves the panel, and is merged at the floor: the eye's edit acts, as it sees the panel by the
  // floor.
  rng::Stream stream(rng::key(21));
  const Vec3 gathered = normalize(Vec3{-0.9f, 0.1f, 0.7f});  // towards what kGather gathers
  const LastAtFloor connected(true);
  int told = 0;
  for (int i = 0; i < 400; ++i) {
    AtPanel at(w, true, true, gathered);
    BsdfSample s;
    if (!at.closure.sample(gathered, stream.next_float(), {stream.next_float(), stream.next_float()},
                           kImportance, s))
      continue;
    EditedWalk light(at.walk), eye(*w.all, true);
    static_cast<void>(light.surface(floor->hit, plain));
    eye.begin_at_eye();
    static_cast<void>(eye.surface(floor->hit, plain));
    EditedArrivals kept;
    kept.keep(light);
    transport::MergeEdits merge(kept, kept);
    merge.start(eye);
    merge.meet(v, 0);
    EXPECT_NEAR(merge.share(down, wi).r, connected.share(at.walk), 1e-6f);
    const auto shares = kept.shares(0);
    told += std::any_of(shares.begin(), shares.end(), [&](const Spectrum& one) { return one != shares[0]; });
  }
  EXPECT_GT(told, 50);
  // Light that is merged at the panel: the edit of light acts if it came by the floor.
  const Vec3 o = directions_from()[0];
  int compared = 0;
  for (int i = 0; i < 200; ++i) {
    const Vec3 l = test::uniform_direction(stream);
    for (const bool lit : {false, true}) {
      AtPanel light(w, true, lit, l), eye(w, false, false, o), known(w, false, false, o);
      EditedArrivals kept;
      kept.keep(light.walk);
      transport::MergeEdits merge(kept, kept);
      merge.start(eye.walk);
      merge.meet(v, 0);
      meet(known, w, false, lit);
      float pdf = 0, as_connected = 0;
      const Spectrum value = eye.closure.eval_pdf(o, l, kRadiance, pdf) * merge.share(o, l);
      const Spectrum wanted = known.closure.eval_pdf(o, l, kRadiance, as_connected);
      EXPECT_EQ(value.g, wanted.g) << lit;
      EXPECT_EQ(pdf, as_connected);
      compared += wanted.g > 0;
    }
  }
  EXPECT_GT(compared, 100);
}

}  // namespace
}  // namespace candela::scene
