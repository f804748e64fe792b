// Photon maps and what merging makes of them: against sums written out, at the limits of radii, and with
// what must not get in.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "tests/unit/scene_fixture.h"
#include "worker/integrators/merging/first_radius.h"
#include "worker/integrators/merging/neighbor_radius.h"
#include "worker/transport/light_vertices.h"
#include "worker/transport/technique/merge.h"

namespace candela::transport {
namespace {

using WeightedVertex = Vertex<MisBlock>;

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

std::unique_ptr<scene::Scene> floor_scene(const std::string& more = "") {
  // A floor at z = 5, facing the camera at the origin, which looks along +z.
  auto scene = test::build_scene(
      "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"100\"/><rotate x=\"1\" "
      "angle=\"180\"/><translate z=\"5\"/></transform><bsdf type=\"diffuse\"><rgb name=\"reflectance\" "
      "value=\"0.5, 0.25, 0.125\"/></bsdf></shape>" +
      more);
  if (!scene.ok()) throw std::runtime_error(scene.error().to_string());
  return std::move(*scene);
}

// The eye's vertex where a ray from the camera meets the scene.
WeightedVertex vertex_at(const scene::Scene& scene, Vec3 direction, scene::ClosureArena& arena) {
  WeightedVertex v;
  if (!scene.intersect({{0, 0, 0}, direction}, v.hit)) throw std::runtime_error("nothing there");
  v.wo = -direction;
  v.connectible = true;
  v.edges = 1;
  v.throughput = Spectrum(2.0f);
  v.closure = scene.closure(v.hit, v.hit.shading.to_local(v.wo), arena);
  return v;
}

WeightedVertex light_vertex(Vec3 p, Vec3 wo, float flux) {
  WeightedVertex v;
  v.hit.p = p;
  v.hit.ng = {0, 0, -1};
  v.hit.shading = make_frame(v.hit.ng);
  v.wo = wo;
  v.arrival = v.density_factor(wo);
  v.throughput = Spectrum(flux);
  v.edges = 3;
  return v;
}

MergeMaps<MisBlock> maps_of(const PhotonMap<MisBlock>& map) {
  MergeMaps<MisBlock> maps;
  maps.surface = &map;
  maps.per_path = 0.1f;
  return maps;
}

// Claim: a merge is throughput times bsdf times flux times kernel over the number of paths, whatever the
// angle light comes in at, and photons beyond the radius add nothing; with weights, it is so times eta / (eta
// + sum_light + sum_eye).
TEST(Photons, MergeIsTheProductWrittenOut) {
  const auto scene = floor_scene();
  scene::ClosureArena arena;
  WeightedVertex v = vertex_at(*scene, {0, 0, 1}, arena);
  v.mis = {0.5, 0.25, 3, 0};
  const Vec3 from = normalize(Vec3{0.6f, 0, -0.8f});
  for (const Kernel kernel : {Kernel::constant, Kernel::epanechnikov, Kernel::perlin}) {
    PhotonBuffer<MisBlock> buffer;
    WeightedVertex near = light_vertex({0.06f, 0.08f, 5}, from, 7);
    near.mis = {2, 1, 0.5, 0};
    ASSERT_TRUE(buffer.keep(*scene, near));
    ASSERT_TRUE(buffer.keep(*scene, light_vertex({0.3f, 0, 5}, from, 7)));
    PhotonMap<MisBlock> map;
    const PhotonBuffer<MisBlock>* chunks[] = {&buffer};
    ASSERT_TRUE(map.build(chunks, 0.2f, 1).ok());
    const MergeMaps<MisBlock> maps = maps_of(map);
    const double t = 0.5, area = std::numbers::pi * 0.04;
    const double k = kernel == Kernel::constant ? 1 / area
                     : kernel == Kernel::epanechnikov
                         ? 2 * (1 - t * t) / area
                         : 3.5 * (1 - 10 * t * t * t + 15 * t * t * t * t - 6 * t * t * t * t * t) / area;
    const double expected = 2 * (0.5 / std::numbers::pi) * 7 * k * 0.1;
    const Spectrum sum = merge<Unweighted>(*scene, maps, {kernel, 0.2f, 0.2f}, v);
    EXPECT_NEAR(static_cast<double>(sum.r), expected, 2e-5 * expected);
    EXPECT_NEAR(static_cast<double>(sum.g), expected / 2, 2e-5 * expected);
    // Densities of the two directions of a diffuse surface.
    const double eta = effective_area(kernel, static_cast<double>(0.2f)) * 10;
    const double to_light = 0.8 / std::numbers::pi, to_eye = 1 / std::numbers::pi;
    const double rest = 2 + to_light * (1 + 0.5 * eta) + 0.5 + to_eye * (0.25 + 3 * eta);
    const Spectrum weighted = merge<Balance>(*scene, maps, {kernel, 0.2f, 0.2f, {eta, 0}}, v);
    EXPECT_NEAR(static_cast<double>(weighted.r), expected * eta / (eta + rest), 2e-5 * expected);
  }
}

// Claim: light that grazes the eye's vertex and arrived on another face is no brighter than the cosine at the
// eye's, over half of that at its own, makes it. (Without that, edges of coarse meshes with smooth normals
// were bright lines.)
TEST(Photons, OverAnEdgeNothingIsDividedByNothing) {
  const auto scene = floor_scene();
  scene::ClosureArena arena;
  const WeightedVertex v = vertex_at(*scene, {0, 0, 1}, arena);
  for (const float own : {1e-3f, 2e-3f, 0.1f, 0.9f}) {
    WeightedVertex beside = light_vertex({0.01f, 0, 5}, normalize(Vec3{1, 0, -1e-3f}), 1);
    beside.arrival = own;
    PhotonBuffer<MisBlock> buffer;
    ASSERT_TRUE(buffer.keep(*scene, beside));
    PhotonMap<MisBlock> map;
    const PhotonBuffer<MisBlock>* chunks[] = {&buffer};
    ASSERT_TRUE(map.build(chunks, 0.1f, 1).ok());
    const double full = 2 * (0.5 / std::numbers::pi) / (std::numbers::pi * 0.01) * 0.1;
    const double expected = full * std::min(1.0, 2e-3 / static_cast<double>(own));
    const auto sum =
        static_cast<double>(merge<Unweighted>(*scene, maps_of(map), {Kernel::constant, 0.1f, 0.1f}, v).r);
    EXPECT_NEAR(sum, expected, 1e-4 * expected) << own;
  }
}

// Claim: a merged path is never longer than asked for.
TEST(Photons, LongestPathIsKept) {
  const auto scene = floor_scene();
  scene::ClosureArena arena;
  const WeightedVertex v = vertex_at(*scene, {0, 0, 1}, arena);
  PhotonBuffer<MisBlock> buffer;
  ASSERT_TRUE(buffer.keep(*scene, light_vertex({0, 0, 5}, {0, 0, -1}, 1)));
  PhotonMap<MisBlock> map;
  const PhotonBuffer<MisBlock>* chunks[] = {&buffer};
  ASSERT_TRUE(map.build(chunks, 0.1f, 1).ok());
  MergeMaps<MisBlock> maps = maps_of(map);
  const MergeScale scale(Kernel::constant, 0.1f, 0.1f);
  maps.max_edges = 4;  // 3 + 1
  EXPECT_FALSE(merge<Unweighted>(*scene, maps, scale, v).is_black());
  maps.max_edges = 3;
  EXPECT_TRUE(merge<Unweighted>(*scene, maps, scale, v).is_black());
}

// Claim: in media photons merge with eye vertices in the same medium alone, with the phase function and a
// ball's kernel, and sigma_s counts once.
TEST(Photons, MediaMergeInTheirOwn) {
  const std::string medium =
      "<medium name=\"interior\" type=\"homogeneous\"><float name=\"sigma_t\" value=\"4\"/><rgb "
      "name=\"albedo\" value=\"0.5, 0.5, 0\"/></medium></shape>";
  const auto scene =
      floor_scene("<shape type=\"sphere\"><bsdf type=\"null\"/>" + medium +
                  "<shape type=\"sphere\"><point name=\"center\" x=\"3\" y=\"0\" z=\"0\"/><bsdf "
                  "type=\"null\"/>" +
                  medium);
  ASSERT_EQ(scene->features().media, 2u);
  WeightedVertex light = light_vertex({0.1f, 0, 0}, {0, 0, 1}, 6);
  light.kind = VertexKind::medium;
  light.medium = 0;
  PhotonBuffer<MisBlock> buffer;
  ASSERT_TRUE(buffer.keep(*scene, light));
  EXPECT_FLOAT_EQ(buffer.photons()[0].flux.r, 3);
  EXPECT_EQ(buffer.photons()[0].flux.b, 0);
  PhotonMap<MisBlock> map;
  const PhotonBuffer<MisBlock>* chunks[] = {&buffer};
  ASSERT_TRUE(map.build(chunks, 0.2f, 1).ok());
  const MergeScale scale(Kernel::constant, 1, 0.2f);
  MergeMaps<MisBlock> maps;
  maps.medium = &map;
  maps.per_path = 0.5f;
  WeightedVertex eye = light;
  eye.edges = 1;
  eye.hit.p = {0, 0, 0};
  eye.throughput = Spectrum(5.0f);
  const double expected = 5 * 3 / (4 * std::numbers::pi) * 0.75 / (std::numbers::pi * 0.008) * 0.5;
  EXPECT_NEAR(static_cast<double>(merge<Unweighted>(*scene, maps, scale, eye).r), expected, 1e-5 * expected);
  eye.medium = 1;
  EXPECT_TRUE(merge<Unweighted>(*scene, maps, scale, eye).is_black());
}

// Claim: however many threads build it, and however photons are spread over chunks, a map gives the same sum
// to the last bit.
TEST(Photons, ThreadsAndChunksChangeNothing) {
  const auto scene = floor_scene();
  scene::ClosureArena arena;
  const WeightedVertex v = vertex_at(*scene, {0, 0, 1}, arena);
  rng::Stream stream(5);
  std::vector<WeightedVertex> vertices;
  for (int i = 0; i < 100000; ++i) {
    const float x = stream.next_float(), y = stream.next_float();
    vertices.push_back(light_vertex({x - 0.5f, y - 0.5f, 5}, {0, 0, -1}, stream.next_float()));
  }
  std::vector<Spectrum> sums;
  for (const std::size_t parts : {1, 7, 64}) {
    std::vector<PhotonBuffer<MisBlock>> buffers(parts);
    for (std::size_t i = 0; i < vertices.size(); ++i)
      ASSERT_TRUE(buffers[i * parts / vertices.size()].keep(*scene, vertices[i]));
    std::vector<const PhotonBuffer<MisBlock>*> chunks;
    for (const PhotonBuffer<MisBlock>& buffer : buffers) chunks.push_back(&buffer);
    for (const unsigned threads : {1u, 4u}) {
      PhotonMap<MisBlock> map;
      ASSERT_TRUE(map.build(chunks, 0.1f, threads).ok());
      EXPECT_EQ(map.size(), vertices.size());
      sums.push_back(merge<Unweighted>(*scene, maps_of(map), {Kernel::constant, 0.1f, 0.1f}, v));
    }
  }
  EXPECT_FALSE(sums[0].is_black());
  for (const Spectrum& sum : sums) EXPECT_EQ(sum, sums[0]);
}

// Claim: a vertex that is nowhere, or whose flux is no number, never gets into a map.
TEST(Photons, WhatIsNoNumberStaysOut) {
  const auto scene = floor_scene();
  PhotonBuffer<MisBlock> buffer;
  EXPECT_FALSE(buffer.keep(*scene, light_vertex({kNaN, 0, 5}, {0, 0, -1}, 1)));
  EXPECT_FALSE(
      buffer.keep(*scene, light_vertex({0, 0, std::numeric_limits<float>::infinity()}, {0, 0, -1}, 1)));
  EXPECT_FALSE(buffer.keep(*scene, light_vertex({0, 0, 5}, {0, 0, -1}, kNaN)));
  EXPECT_EQ(buffer.size(), 0u);
  PhotonMap<MisBlock> map;
  const PhotonBuffer<MisBlock>* chunks[] = {&buffer};
  ASSERT_TRUE(map.build(chunks, 0.1f, 2).ok());
  EXPECT_EQ(map.size(), 0u);
}

// Claim: weights are finite and go to 0 and 1 with the radius; sums too large for a float saturate.
TEST(Photons, WeightsAtTheLimits) {
  EXPECT_EQ(merge_weight(1e-300, 1, 1e300), 0);
  EXPECT_EQ(merge_weight(1e300, 1, 2), 1);
  EXPECT_EQ(merge_weight(1e-30, 0, 0), 1);
  EXPECT_NEAR(merge_weight(0.5, 0.25, 0.25), 0.5, 1e-15);
  const auto scene = floor_scene();
  WeightedVertex v = light_vertex({0, 0, 5}, {0, 0, -1}, 1);
  v.mis = {1e60, 1e50, 0, std::numeric_limits<double>::infinity()};
  PhotonBuffer<MisBlock> buffer;
  ASSERT_TRUE(buffer.keep(*scene, v));
  const double most = static_cast<double>(std::numeric_limits<float>::max());
  const MisBlock kept = buffer.photons()[0].weights.block();
  EXPECT_EQ(kept.known, most);
  EXPECT_EQ(kept.pending, most);
  EXPECT_EQ(kept.pending_surface, 0);
  EXPECT_EQ(kept.pending_medium, most);
}

// Claim: a light vertex that was kept in its compact form connects as the one it was made from.
TEST(Photons, KeptLightVerticesComeBackWhole) {
  const auto scene = floor_scene();
  scene::ClosureArena arena;
  WeightedVertex v = vertex_at(*scene, normalize(Vec3{0.1f, 0.2f, 1}), arena);
  v.mis = {1, 2, 3, 4};
  v.arrival = 0.75f;
  LightVertexBuffer<MisBlock> buffer;
  buffer.end_path();
  for (const std::uint32_t edges : {1u, 2u, 3u}) {
    v.edges = edges;
    buffer.keep(v);
  }
  buffer.end_path();
  Subpath<MisBlock> path;
  buffer.load(*scene, 0, 10, path);
  EXPECT_EQ(path.size(), 0u);
  buffer.load(*scene, 1, 3, path);
  ASSERT_EQ(path.size(), 2u);
  const WeightedVertex& back = path[1];
  EXPECT_EQ(back.edges, 2u);
  EXPECT_EQ(back.hit.p.x, v.hit.p.x);
  EXPECT_EQ(back.arrival, v.arrival);
  EXPECT_EQ(back.mis.pending_medium, 4);
  EXPECT_EQ(back.throughput, v.throughput);
  float pdf = 0, pdf_back = 0;
  const Vec3 wi = normalize(Vec3{-0.3f, 0.2f, -1});
  EXPECT_EQ(scatter_value(*scene, back, back.wo, wi, TransportMode::importance, pdf_back),
            scatter_value(*scene, v, v.wo, wi, TransportMode::importance, pdf));
  EXPECT_EQ(pdf_back, pdf);
}

// Claim: a footprint is a pixel's width at what the camera sees: on a floor across the view, distance times
// the angle of a pixel.
TEST(Photons, FirstRadiusFollowsThePixel) {
  const auto scene = floor_scene();
  const auto filter = film::PixelFilter::create("box", {});
  ASSERT_TRUE(filter.ok());
  const integrators::UnitContext context{*scene, *filter, samplers::SamplerKind::sobol, 1, 64, 64};
  // fov 60 over 64 pixels. (The scene is built for a film of 1 by 1, so that a pixel of its is 64 of ours.)
  const double radius = static_cast<double>(scene->features().radius);
  EXPECT_DOUBLE_EQ(integrators::merging::first_radius(context, 0.01, 0), 0.01 * radius);
  const double one = integrators::merging::first_radius(context, 0.01, 1);
  EXPECT_DOUBLE_EQ(integrators::merging::first_radius(context, 0.5, 3), 3 * one);
  EXPECT_GT(one, 0);
  EXPECT_GE(integrators::merging::first_radius(context, 1e-300, 0), 1e-12);
}

// Claim: with radius_neighbors = k the first radius holds k photons of an iteration at the middle one of what
// the camera sees: of a floor at distance 5 under a point light beside the camera, which has P cos^3 / (4 pi
// 5^2) photons per area of P paths; it falls as the root of the number of light paths; without light there is
// none.
TEST(Photons, FirstRadiusFollowsTheNeighbors) {
  const auto scene = floor_scene("<emitter type=\"point\"/>");
  const auto filter = film::PixelFilter::create("box", {});
  ASSERT_TRUE(filter.ok());
  const integrators::UnitContext context{*scene, *filter, samplers::SamplerKind::sobol, 1, 1, 1};
  const auto radius = [&](int neighbors, double paths) {
    return integrators::merging::neighbor_radius(context, {}, neighbors, paths);
  };
  // The median of tan^2 over a square view of 60 degrees: 0.212, so that cos^3 = 0.749. The k-th distance has
  // a relative deviation of 6 %, and there are about twenty independent ones.
  const double paths = 16384, density = paths * 0.749 / (100 * std::numbers::pi);
  const double expected = std::sqrt(64 / (std::numbers::pi * density));
  EXPECT_NEAR(radius(64, paths), expected, 0.08 * expected);
  EXPECT_DOUBLE_EQ(radius(64, 4 * paths), radius(64, paths) / 2);
  EXPECT_NEAR(radius(256, paths), 2 * radius(64, paths), 0.1 * expected);
  const auto dark = floor_scene();
  const integrators::UnitContext without{*dark, *filter, samplers::SamplerKind::sobol, 1, 1, 1};
  EXPECT_EQ(integrators::merging::neighbor_radius(without, {}, 8, paths), 0);
}

}  // namespace
}  // namespace candela::transport
