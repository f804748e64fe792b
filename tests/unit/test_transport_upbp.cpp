// Points and beams in media: the structures that find what meets, the edges that weights are made from, and
// the four merges against the truth tables of two beams (docs/integrators/upbp.md).
// Deterministic: fixed seeds. Means of simulations alarm falsely with probability below 1e-6 each (5 standard
// errors), were the seeds drawn anew.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <vector>

#include "common/rng/stream.h"
#include "tests/paths.h"
#include "tests/unit/media_fixture.h"
#include "tests/unit/scene_fixture.h"
#include "tests/unit/transport_paths.h"
#include "tests/unit/volume_file.h"
#include "worker/transport/kernels.h"
#include "worker/transport/photon_beams.h"
#include "worker/transport/radius.h"
#include "worker/transport/subpath.h"
#include "worker/transport/technique/merge_medium.h"

namespace candela::transport {
namespace {

using test::direction;
using test::fog;
using test::somewhere;
using test::uniform;

Crossing crossing(Vec3 origin, Vec3 along, double length) {
  return {{{origin, along}, 0, Spectrum(1.0f), 1, 2}, static_cast<float>(length), true};
}

// Claim: each closest approach of a query beam, and each projection of a point, to a photon beam cut into
// pieces is found once.
TEST(TransportUpbp, PiecesOfBeamsAreMetOnce) {
  const auto scene = fog();
  rng::Stream stream(5);
  BeamBuffer buffer;
  for (int i = 0; i < 400; ++i)
    ASSERT_TRUE(buffer.keep(*scene,
                            crossing(somewhere(stream, 1), direction(stream), 0.01 + 2 * uniform(stream)),
                            false, {}, {}));
  const BeamBuffer* const chunks[] = {&buffer};
  PhotonBeams beams;
  const float radius = 0.02f;
  ASSERT_TRUE(beams.build(chunks, {&radius, 1}, 2).ok());
  ASSERT_EQ(beams.size(), 400U);
  std::size_t met = 0;
  for (int query = 0; query < 300; ++query) {
    const QuerySegment s{somewhere(stream, 1), direction(stream), static_cast<float>(uniform(stream) * 2)};
    std::size_t found = 0, found_by_point = 0, expected = 0, expected_by_point = 0;
    beams.near_segment(s, radius, [&](const PhotonBeam&, const Approach&) { ++found; });
    beams.near_point(s.origin, radius, [&](const PhotonBeam&, const Projection&) { ++found_by_point; });
    for (const PhotonBeam& beam : buffer.beams()) {
      const Approach at = closest_approach(s.origin, s.direction, beam.origin, beam.direction);
      const auto r = static_cast<double>(radius), length = static_cast<double>(beam.length);
      expected += at.distance < r && at.along_a >= 0 && at.along_a < static_cast<double>(s.length) &&
                          at.along_b >= 0 && at.along_b < length
                      ? 1
                      : 0;
      const Projection p = project(beam.origin, beam.direction, s.origin);
      expected_by_point += p.distance_squared < r * r && p.along >= 0 && p.along < length ? 1 : 0;
    }
    ASSERT_EQ(found, expected);
    ASSERT_EQ(found_by_point, expected_by_point);
    met += found;
  }
  EXPECT_GT(met, 500U);
}

struct Mean {
  double sum = 0, squares = 0;
  std::size_t count = 0;
  void add(double x) {
    sum += x;
    squares += x * x;
    ++count;
  }
  double mean() const { return sum / static_cast<double>(count); }
  double error() const {
    const auto n = static_cast<double>(count);
    return std::sqrt(std::max(squares / n - mean() * mean(), 0.0) / n);
  }
};

// Claim: two beams that cross at 30 degrees, 1.5 mean free paths from both starts, in a sheet of thickness 2:
// the expectations of the four merges at radius 0.4 to 0.05, constant kernel, sigma_t = 1, in closed form:
//   P-P3D truth 3 (k cosh k - sinh k) / k^3, k = h / sin 15 deg;  P-B2D, B-P2D truth 2 I_1(k) / k,
//   k = h cot 15 deg;  B-B1D truth.
TEST(TransportUpbp, TwoBeamsMeetAsTheClosedFormsSay) {
  const auto scene = fog();
  const double angle = std::numbers::pi / 6, start = 1.5, sheet = 2;
  const Vec3 eye(Vec3d{0, 0, 1}), light(Vec3d{std::sin(angle), 0, std::cos(angle)});
  struct Row {
    double h, pp, pb, bb;
  };
  for (const Row& row :
       {Row{0.4, 0.062739292, 0.065005233, 0.049787068}, Row{0.2, 0.052824101, 0.053335718, 0.049787068},
        Row{0.1, 0.050534273, 0.050658919, 0.049787068}, Row{0.05, 0.049973124, 0.050004084, 0.049787068}}) {
    const auto h = static_cast<float>(row.h);
    const BallKernel ball(Kernel::constant, h);
    const DiscKernel disc(Kernel::constant, h);
    const LineKernel line(Kernel::constant, h);
    Mean pp, pb, bp, bb;
    rng::Stream stream(11);
    for (int batch = 0; batch < 1200; ++batch) {
      constexpr int kLight = 250, kEye = 40;
      // The eye's ray crosses z = 0 at start mean free paths; light's is displaced across both.
      const Vec3 eye_origin = eye * static_cast<float>(-start);
      BeamBuffer buffer;
      std::vector<Vec3> ends;
      for (int i = 0; i < kLight; ++i) {
        const Vec3 origin = light * static_cast<float>(-start) +
                            Vec3{0, static_cast<float>((uniform(stream) - 0.5) * sheet), 0};
        const double length = -std::log(1 - uniform(stream));
        if (!(length > 0)) continue;
        ASSERT_TRUE(buffer.keep(*scene, crossing(origin, light, length), false, {}, {}));
        ends.push_back(origin + light * static_cast<float>(length));
      }
      const BeamBuffer* const chunks[] = {&buffer};
      PhotonBeams beams;
      ASSERT_TRUE(beams.build(chunks, {&h, 1}, 1).ok());
      BoxTree points;
      const auto order = points.build(ends, 1);
      double sum_pp = 0, sum_pb = 0, sum_bp = 0, sum_bb = 0;
      for (int j = 0; j < kEye; ++j) {
        const auto length = static_cast<float>(-std::log(1 - uniform(stream)));
        const Vec3 end = eye_origin + eye * length;
        const QuerySegment s{eye_origin, eye, length};
        const double r2 = row.h * row.h;
        points.near_point(end, h, [&](std::uint32_t slot) {
          if (const double d2 = length_squared(Vec3d(ends[order[slot]]) - Vec3d(end)); d2 < r2)
            sum_pp += static_cast<double>(ball.value(static_cast<float>(d2)));
        });
        points.near_segment(s, h, [&](std::uint32_t slot) {
          const Projection at = project(s.origin, s.direction, ends[order[slot]]);
          if (at.distance_squared < r2 && at.along >= 0 && at.along < static_cast<double>(length))
            sum_pb += static_cast<double>(disc.value(static_cast<float>(at.distance_squared)));
        });
        beams.near_point(end, h, [&](const PhotonBeam&, const Projection& at) {
          sum_bp += static_cast<double>(disc.value(static_cast<float>(at.distance_squared)));
        });
        beams.near_segment(s, h, [&](const PhotonBeam&, const Approach& at) {
          sum_bb += static_cast<double>(line.value(static_cast<float>(at.distance * at.distance))) / at.sine;
        });
      }
      const double pairs = static_cast<double>(kLight) * kEye;
      // The sheet's displacement has density 1 / D; truth is e^-3 for D = 2 in the units of the table:
      // C = D sin(angle).
      const double unit = sheet * std::sin(angle);
      pp.add(sum_pp / pairs * unit);
      pb.add(sum_pb / pairs * unit);
      bp.add(sum_bp / pairs * unit);
      bb.add(sum_bb / pairs * unit);
    }
    EXPECT_NEAR(pp.mean(), row.pp, 5 * pp.error()) << "P-P3D, h = " << row.h;
    EXPECT_NEAR(pb.mean(), row.pb, 5 * pb.error()) << "P-B2D, h = " << row.h;
    EXPECT_NEAR(bp.mean(), row.pb, 5 * bp.error()) << "B-P2D, h = " << row.h;
    EXPECT_NEAR(bb.mean(), row.bb, 5 * bb.error()) << "B-B1D, h = " << row.h;
    for (const Mean* m : {&pp, &pb, &bp, &bb}) EXPECT_LT(m->error(), (row.h < 0.2 ? 0.1 : 0.03) * row.bb);
  }
}

// Claim: at the end of its flight the vertex made from an edge and its crossing has the numbers that the walk
// gives the vertex it makes there, for walks of both kinds.
template <TransportMode kMode>
void expect_edges_make_vertices(const scene::Scene& scene) {
  constexpr bool kLight = kMode == TransportMode::importance;
  MisFactors factors;
  factors.light_image = 100;
  std::vector<MediumMerges> merges(scene.features().media, MediumMerges{0.5, 0.1, 0.3, 0.2});
  for (std::uint32_t m = 0; m < scene.features().media; ++m)
    merges[m].long_photon_beams = merges[m].long_query_beams = scene.medium(m).homogeneous();
  factors.medium = merges.data();
  WalkRules rules;
  rules.max_edges = 8;
  rules.eye_paths = 64 * 64;
  film::SampleCounts sample_counts;
  samplers::Sampler sampler(samplers::SamplerKind::independent, 9);
  std::size_t vertices = 0;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    Crossing last;
    Walk<kMode, EdgeContent::media, BeamBalance, samplers::Sampler, CrossingObserver> walk(
        scene, rules, factors, sampler, sample_counts, CrossingObserver(last));
    using WalkT = decltype(walk);
    if constexpr (kLight) {
      sampler.start_light(0, i, 0);
      if (!walk.start_light()) continue;
    } else {
      sampler.start(0, i, 0, 0);
      float weight = 1;
      const auto [x, y] = sampler.draw_2d(0, true);
      walk.start_eye(scene.camera_ray(x * 64, y * 64, {0.5f, 0.5f}, weight));
    }
    VertexSlot<MisBlock> slot;
    Vertex<MisBlock>& v = slot.vertex;
    for (;;) {
      last.some = false;
      if (walk.advance(v, slot.arena) != WalkT::Event::vertex) break;
      if (v.kind == VertexKind::medium) {
        ASSERT_TRUE(last.some);
        const EdgeStart edge = edge_start(walk, last.segment);
        const Vec3d place = Vec3d(last.segment.ray.origin) +
                            Vec3d(last.segment.ray.direction) * static_cast<double>(last.end);
        const auto hazard = static_cast<double>(v.arrival);
        const EdgeVertex made =
            vertex_on(edge, place, hazard,
                      static_cast<double>(stretch_survival(scene.medium(v.medium), {{}, {}, last.end})));
        // Places are rounded to float, so that short edges lose digits.
        const double tolerance = 1e-5 + 4e-6 / static_cast<double>(last.end);
        EXPECT_NEAR(made.pdf_volume / v.pdf_area, 1, tolerance);
        MisBlock block;
        if constexpr (kLight) {
          double direct = 0;
          if (edge.edges == 1)
            direct = direct_density(scene, walk.origin(), v.hit, {}, v.wo, made.distance_squared);
          block = light_block(edge, factors, made, hazard, direct);
        } else {
          block = eye_block(edge, factors, made, hazard);
        }
        const auto near = [&](double a, double b) {
          return std::abs(a - b) <= tolerance * std::abs(b) + 1e-300;
        };
        EXPECT_TRUE(near(block.known, v.mis.known)) << block.known << " " << v.mis.known;
        EXPECT_TRUE(near(block.pending, v.mis.pending)) << block.pending << " " << v.mis.pending;
        EXPECT_TRUE(near(block.pending_surface, v.mis.pending_surface));
        EXPECT_TRUE(near(block.pending_medium, v.mis.pending_medium));
        ++vertices;
      }
      if (walk.scatter(v) == WalkT::Step::ended) break;
    }
  }
  EXPECT_GT(vertices, 300U);
}
TEST(TransportUpbp, EdgesMakeTheVerticesOfWalks) {
  for (const char* name : {"fog-thin", "fog-glass", "fog-camera", "smoke"}) {
    SCOPED_TRACE(name);
    const auto scene =
        test::load_scene(test::source_path("tests/statistical/transport") / (std::string(name) + ".xml"));
    ASSERT_TRUE(scene.ok()) << scene.error().to_string();
    expect_edges_make_vertices<TransportMode::importance>(**scene);
    expect_edges_make_vertices<TransportMode::radiance>(**scene);
  }
}

// A grid of colors, in [-1, 1]^3, whose extinction grows with z.
std::unique_ptr<scene::Scene> rising_smoke() {
  std::vector<float> values;
  for (int z = 0; z < 8; ++z)
    for (int xy = 0; xy < 4; ++xy)
      for (const float color : {1.0f, 0.5f, 0.2f}) values.push_back(color * static_cast<float>(z));
  auto scene = test::build_scene(
      R"(<shape type="cube"><bsdf type="null"/><medium type="heterogeneous" name="interior">
           <volume type="gridvolume" name="sigma_t"><string name="filename" value="v.vol"/>)" +
          test::matrix({2, 0, 0, -1, 0, 2, 0, -1, 0, 0, 2, -1, 0, 0, 0, 1}) +
          R"(</volume><rgb name="albedo" value="0.9, 0.6, 0.3"/>
           <phase type="hg"><float name="g" value="0.4"/></phase></medium></shape>)",
      {{"v.vol", test::volume_file({2, 2, 8}, 3, values)}});
  EXPECT_TRUE(scene.ok()) << scene.error().to_string();
  return std::move(*scene);
}

// A homogeneous medium of colors around everything.
std::unique_ptr<scene::Scene> colored_fog() {
  auto scene = test::build_scene(
      R"(<shape type="cube"><bsdf type="null"/><medium type="homogeneous" name="interior">
           <rgb name="sigma_t" value="0.5, 1.5, 4"/><rgb name="albedo" value="0.9, 0.6, 0.3"/>
           <phase type="hg"><float name="g" value="0.4"/></phase></medium></shape>)");
  EXPECT_TRUE(scene.ok()) << scene.error().to_string();
  return std::move(*scene);
}

// Two beams of 0.6 that pass each other at a distance of 0.2, light's after 0.3 and the eye's after 0.4, and
// the points at these two places: the values of the four merges of eta against
//   eta_v / (eta_PP + eta_PB / e + eta_BP / l + eta_BB sin / (e l) + both sides' sums),
// in which merges on surfaces count,
// e and l: the hazard at the place, times the survival of the edge where beams are long. light_step and
// eye_step: the flights' weights there, in a grid.
void expect_values_of_merges(const scene::Scene& scene, const MediumMerges& eta, Spectrum light_step,
                             Spectrum eye_step) {
  const scene::Medium& medium = scene.medium(0);
  const Vec3 light_place{0.1f, 0.05f, -0.4f}, eye_place{0.1f, 0.05f, -0.6f};
  const Vec3 a{1, 0, 0}, b = normalize(Vec3{0.5f, 0.8f, 0});
  const double sine = sine_between(a, b), distance = 0.2;
  const auto hazard = [&](Vec3 p) { return static_cast<double>(hazard_of(medium.sigma_t(p))); };
  const auto passed = [&](float length) {
    rng::Stream unread(0);
    return medium.homogeneous() ? medium.transmittance({{}, a, length}, unread) : Spectrum(1.0f);
  };
  const auto survives = [&](float length) {
    const Spectrum t = passed(length);
    return static_cast<double>((t.r + t.g + t.b) / 3);
  };
  const double light_hazard = hazard(light_place), eye_hazard = hazard(eye_place);
  const double light_edge = survives(0.3f), eye_edge = survives(0.4f);
  const double l = light_hazard * (eta.long_photon_beams ? light_edge : 1),
               e = eye_hazard * (eta.long_query_beams ? eye_edge : 1);

  MisFactors factors;
  factors.medium = &eta;
  EdgeStart light_start, eye_start;
  light_start.edges = eye_start.edges = 2;
  light_start.departure = {{0.7, 1.2, 1, {0, 0.3, 0.4, 0.2}}, true, eta.long_query_beams ? 0.15 : 0};
  eye_start.departure = {{0.4, 0.8, 1, {0, 0.1, 0.5, 0.6}}, true, eta.long_photon_beams ? 0.25 : 0};
  light_start.from = light_place - a * 0.3f;
  eye_start.from = eye_place - b * 0.4f;
  const MisBlock light_block_there =
      light_block(light_start, factors, vertex_on(light_start, Vec3d(light_place), light_hazard, light_edge),
                  light_hazard, 0);
  const MisBlock eye_block_there =
      eye_block(eye_start, factors, vertex_on(eye_start, Vec3d(eye_place), eye_hazard, eye_edge), eye_hazard);
  // Each walk's edge is 0.3 and 0.4 long. What its start's merges leave open is divided by its survival.
  EXPECT_NEAR(light_block_there.known * 0.7 * light_hazard * light_edge / (0.3 * 0.3), 1, 1e-5);
  EXPECT_NEAR(eye_block_there.known * 0.4 * eye_hazard * eye_edge / (0.4 * 0.4), 1, 1e-5);
  EXPECT_NEAR(light_block_there.pending_medium * light_hazard / 1.2,
              0.2 + light_start.departure.long_beams / light_edge, 1e-5);
  EXPECT_NEAR(eye_block_there.pending_medium * eye_hazard / 0.8,
              0.6 + eye_start.departure.long_beams / eye_edge, 1e-5);
  const auto phase = [&](Vec3 from, Vec3 to) {
    return static_cast<double>(medium.phase().pdf_solid_angle(from, to));
  };
  const MergeFactors with_surfaces{0.7, 1};
  const double sums = BeamBalance::sum(light_block_there, phase(-b, -a), with_surfaces) +
                      BeamBalance::sum(eye_block_there, phase(-a, -b), with_surfaces);
  const double all =
      eta.point_point + eta.point_beam / e + eta.beam_point / l + eta.beam_beam * sine / (e * l) + sums;

  const auto sigma_s = [&](Vec3 p) { return medium.sigma_t(p) * medium.albedo(p); };
  Vertex<MisBlock> light_end, eye_end;
  for (auto* v : {&light_end, &eye_end}) {
    v->kind = VertexKind::medium;
    v->connectible = true;
    v->medium = 0;
    v->edges = 2;
  }
  light_end.hit.p = light_place;
  light_end.wo = -a;
  light_end.throughput = sigma_s(light_place);  // a flux of 1
  light_end.arrival = static_cast<float>(light_hazard);
  light_end.survival = static_cast<float>(light_edge);
  light_end.mis = light_block_there;
  eye_end.hit.p = eye_place;
  eye_end.wo = -b;
  eye_end.throughput = sigma_s(eye_place);
  eye_end.arrival = static_cast<float>(eye_hazard);
  eye_end.survival = static_cast<float>(eye_edge);
  eye_end.mis = eye_block_there;
  // A long beam goes on behind the end of its flight.
  const auto flight = [&](const EdgeStart& start, Vec3 along, Spectrum weight, bool is_long) {
    const float end = is_long ? 0.05f : 0.6f;
    Crossing crossed{{{start.from, along, 0.6f}, 0, Spectrum(1.0f), 1, 2}, end, true};
    if (!medium.homogeneous()) crossed.steps = {{0.1f, Spectrum(7)}, {0.2f, weight}, {0.5f, Spectrum(9)}};
    return crossed;
  };
  const auto carried = [&](bool is_long, float length, Spectrum step) {
    if (!medium.homogeneous()) return step;
    return is_long ? passed(length) : passed(length) * static_cast<float>(1 / survives(length));
  };
  const Spectrum light_carrier = carried(eta.long_photon_beams, 0.3f, light_step),
                 eye_carrier = carried(eta.long_query_beams, 0.4f, eye_step);
  const bool is_long = eta.long_photon_beams;
  BeamBuffer beam_buffer;
  ASSERT_TRUE(beam_buffer.keep(scene, flight(light_start, Vec3{0, 0, 1}, Spectrum(3), is_long), is_long,
                               light_start, {}));
  ASSERT_TRUE(beam_buffer.keep(scene, flight(light_start, a, light_step, is_long), is_long, light_start, {}));
  PhotonBuffer<MisBlock> photon_buffer;
  ASSERT_TRUE(photon_buffer.keep(scene, light_end, is_long));
  const MediumKernels kernels(Kernel::constant, {0.25, 0.26, 0.27, 0.28});
  const float beam_radius = 0.28f;
  const BeamBuffer* const beam_chunks[] = {&beam_buffer};
  const PhotonBuffer<MisBlock>* const photon_chunks[] = {&photon_buffer};
  PhotonBeams beams;
  PhotonPoints points;
  ASSERT_TRUE(beams.build(beam_chunks, {&beam_radius, 1}, 1).ok());
  const float ball_radius = 0.25f;
  ASSERT_TRUE(points.build(photon_chunks, {{&ball_radius, 1}, true, &scene}, 1).ok());
  MediumMaps maps;
  maps.points = &points;
  maps.beams = &beams;
  maps.kernels = {&kernels, 1};
  maps.factors = factors;

  MediumGather gather(scene, maps);
  gather.begin(with_surfaces);
  MediumShares found;
  gather.prefetch(eye_end);
  gather.start(eye_end);
  Spectrum sum;
  found.point_point = gather.finish(sum);
  found.beam_point = gather.beams_at(eye_end, sum);
  gather.along(flight(eye_start, b, eye_step, eta.long_query_beams), eye_start, found, sum);
  const auto expect = [&](Spectrum got, double own, double kernel, Spectrum carried_here, const char* what) {
    const Spectrum expected =
        sigma_s(eye_place) * carried_here * static_cast<float>(own / all * kernel * phase(-b, -a));
    const auto relative = [](float x, float y) { return std::abs(x / y - 1); };
    EXPECT_LT(relative(got.r, expected.r), 1e-5f) << what;
    EXPECT_LT(relative(got.g, expected.g), 1e-5f) << what;
    EXPECT_LT(relative(got.b, expected.b), 1e-5f) << what;
  };
  const auto d2 = static_cast<float>(distance * distance);
  const auto kernel = [&](const auto& k) { return static_cast<double>(k.value(d2)); };
  expect(found.point_point, eta.point_point, kernel(kernels.ball), Spectrum(1), "pp3d");
  expect(found.point_beam, eta.point_beam / e, kernel(kernels.point_beam), eye_carrier, "pb2d");
  expect(found.beam_point, eta.beam_point / l, kernel(kernels.beam_point), light_carrier, "bp2d");
  expect(found.beam_beam, eta.beam_beam * sine / (e * l), kernel(kernels.beam_beam) / sine,
         light_carrier * eye_carrier, "bb1d");
}

// Claim: in a grid, where light's and the eye's copy of a vertex have hazards l and e of their own, each of
// the four merges has the weight of its eta over all eta and both sides' sums, whichever structure finds it,
// so that the weights of all techniques of the path add up to 1; and its value is that of its estimator, with
// sigma_s at the eye's place and the steps of both flights. The two beams pass each other across the
// gradient: the nearest places of all four are the same two.
TEST(TransportUpbp, WeightsInAGridCountBothHazards) {
  const auto scene = rising_smoke();
  const scene::Medium& medium = scene->medium(0);
  ASSERT_GT(hazard_of(medium.sigma_t({0.1f, 0.05f, -0.4f})),
            1.3f * hazard_of(medium.sigma_t({0.1f, 0.05f, -0.6f})));
  expect_values_of_merges(*scene, {0.5, 0.1, 0.3, 0.2}, Spectrum(0.5f, 0.7f, 1.2f),
                          Spectrum(0.9f, 1.1f, 0.3f));
}

// Claim: the same of beams of either kind, short or long, in a homogeneous medium of colors, where a long one
// carries the transmittance and its merges count the survival of its edge.
TEST(TransportUpbp, WeightsOfLongBeamsCountSurvivals) {
  const auto scene = colored_fog();
  for (const bool photon_beams : {false, true})
    for (const bool query_beams : {false, true}) {
      SCOPED_TRACE(::testing::Message()
                   << "long: photon beams " << photon_beams << ", query beams " << query_beams);
      expect_values_of_merges(*scene, {0.5, 0.1, 0.3, 0.2, photon_beams, query_beams}, {}, {});
    }
}

// Claim: a long beam ends with its medium, in one without an end where no channel that scatters has anything
// left, and short ones where their flight ends.
TEST(TransportUpbp, LongBeamsEndWithTheirMedium) {
  const auto scene = colored_fog();
  const scene::Medium& medium = scene->medium(0);
  const auto to = [](float t_max) {
    return Crossing{{{{}, {0, 0, 1}, t_max}, 0, Spectrum(1.0f), 1, 2}, 0.5f, true};
  };
  EXPECT_EQ(beam_end(to(2), medium, false), 0.5f);
  EXPECT_EQ(beam_end(to(2), medium, true), 2);
  EXPECT_FLOAT_EQ(beam_end(to(std::numeric_limits<float>::infinity()), medium, true), 60 / 0.5f);
}

// Claim: beams in a grid that ends nowhere else end beside it, and none is kept that does not come near it.
TEST(TransportUpbp, BeamsEndBesideTheirGrid) {
  const auto scene = rising_smoke();
  BeamBuffer buffer;
  const auto endless = [](Vec3 origin, Vec3 along) { return crossing(origin, along, 3e38); };
  EXPECT_TRUE(buffer.keep(*scene, endless({-5, 0, 0}, {1, 0, 0}), false, {}, {}));
  EXPECT_TRUE(buffer.keep(*scene, endless({-5, 0, 0}, {-1, 0, 0}), false, {}, {}));
  ASSERT_EQ(buffer.beams().size(), 1U);
  EXPECT_FLOAT_EQ(buffer.beams()[0].length, 8);
}

// Claim: radii follow the power law of their dimension, whatever ran before.
TEST(TransportUpbp, RadiiFollowTheirPowerLaws) {
  EXPECT_EQ(blur_radius(0.5, 0, 1), 0.5);
  EXPECT_NEAR(blur_radius(1, 31, 1), 0.5, 1e-12);
  EXPECT_NEAR(blur_radius(1, 63, 2), 0.5, 1e-12);
  EXPECT_NEAR(blur_radius(1, 127, 3), 0.5, 1e-12);
}

}  // namespace
}  // namespace candela::transport
