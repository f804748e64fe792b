// Statistics of merges (worker/transport/statistics) against literal loops over photons, and scales by a map.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "tests/unit/scene_fixture.h"
#include "worker/core/math.h"
#include "worker/transport/statistics/counts.h"
#include "worker/transport/statistics/plug_in.h"
#include "worker/transport/statistics/weighted_sectors.h"
#include "worker/transport/technique/merge.h"

namespace candela::transport {
namespace {

constexpr double kFirst = 0.4;
constexpr float kRadius = 0.25f, kPerPath = 0.01f;

struct Cloud {
  std::unique_ptr<scene::Scene> scene;
  scene::ClosureArena arena;
  Vertex<NoBlock> eye;
  PhotonBuffer<NoBlock> buffer;
  PhotonMap<NoBlock> map;
  MergeMaps<NoBlock> maps;
};

// Photons on a floor at z = 5, or in a fog, around the eye's vertex at (0, 0, 5).
void fill(Cloud& cloud, bool medium) {
  const std::string fog =
      "<shape type=\"sphere\"><float name=\"radius\" value=\"50\"/><bsdf type=\"null\"/><medium "
      "name=\"interior\" type=\"homogeneous\"><float name=\"sigma_t\" value=\"4\"/><rgb name=\"albedo\" "
      "value=\"0.5, 0.5, 0.5\"/></medium></shape>";
  auto scene = test::build_scene(
      "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"100\"/><rotate x=\"1\" "
      "angle=\"180\"/><translate z=\"5\"/></transform><bsdf type=\"diffuse\"><rgb name=\"reflectance\" "
      "value=\"0.5, 0.25, 0.125\"/></bsdf></shape>" +
      fog);
  ASSERT_TRUE(scene.ok()) << scene.error().to_string();
  cloud.scene = std::move(*scene);
  Vertex<NoBlock>& v = cloud.eye;
  ASSERT_TRUE(cloud.scene->intersect({{0, 0, 4}, {0, 0, 1}}, v.hit));
  v.wo = {0, 0, -1};
  v.connectible = true;
  v.edges = 1;
  v.throughput = Spectrum(2.0f, 1.0f, 0.5f);
  if (medium) {
    v.kind = VertexKind::medium;
    v.medium = 0;
  } else {
    v.closure = cloud.scene->closure(v.hit, v.hit.shading.to_local(v.wo), cloud.arena);
  }
  rng::Stream stream(7);
  const auto uniform = [&] { return static_cast<float>(2 * stream.next_double() - 1); };
  for (int i = 0; i < 3000; ++i) {
    Vertex<NoBlock> photon = v;
    photon.hit.p = v.hit.p + Vec3{0.6f * uniform(), 0.6f * uniform(), medium ? 0.6f * uniform() : 0.0f};
    photon.wo = normalize(Vec3{uniform(), uniform(), -1});
    photon.arrival = medium ? 4 : photon.density_factor(photon.wo);
    photon.throughput = Spectrum(1 + uniform(), 2, 1);
    ASSERT_TRUE(cloud.buffer.keep(*cloud.scene, photon));
  }
  const PhotonBuffer<NoBlock>* chunks[] = {&cloud.buffer};
  ASSERT_TRUE(cloud.map.build(chunks, kRadius, 1).ok());
  cloud.maps.per_path = kPerPath;
  (medium ? cloud.maps.medium : cloud.maps.surface) = &cloud.map;
}

// visit(offset, phi of each channel, squared distance) for every photon.
template <class Visit>
void each_colored_photon(const Cloud& cloud, bool medium, const Visit& visit) {
  const Vertex<NoBlock>& v = cloud.eye;
  const double extent =
      medium ? 4.0 / 3 * std::numbers::pi * kFirst * kFirst * kFirst : std::numbers::pi * kFirst * kFirst;
  for (std::size_t i = 0; i < cloud.buffer.size(); ++i) {
    const Photon<NoBlock>& photon = cloud.buffer.photons()[i];
    const Vec3 y = cloud.buffer.positions()[i] - v.hit.p;
    const Spectrum scatters = medium
                                  ? Spectrum(static_cast<float>(0.25 / std::numbers::pi))
                                  : Spectrum(0.5f, 0.25f, 0.125f) * static_cast<float>(1 / std::numbers::pi);
    const Spectrum phi = v.throughput * scatters * photon.flux;
    const auto of = [&](float channel) { return static_cast<double>(channel * kPerPath) / extent; };
    visit(y, std::array{of(phi.r), of(phi.g), of(phi.b)}, static_cast<double>(dot(y, y)));
  }
}
// visit(offset, phi, squared distance) for every photon.
template <class Visit>
void each_photon(const Cloud& cloud, bool medium, const Visit& visit) {
  each_colored_photon(cloud, medium, [&](Vec3 y, const std::array<double, 3>& phi, double d2) {
    visit(y, 0.212671 * phi[0] + 0.715160 * phi[1] + 0.072169 * phi[2], d2);
  });
}

// The sector of six by its angle in the frame of the normal.
std::size_t literal_sector(Vec3 y, const Frame& frame) {
  double angle = std::atan2(static_cast<double>(dot(y, frame.t)), static_cast<double>(dot(y, frame.s)));
  if (angle < 0) angle += 2 * std::numbers::pi;
  return static_cast<std::size_t>(angle / (2 * std::numbers::pi) * 6);
}

template <class Statistics>
Spectrum gather(const Cloud& cloud, Kernel kernel, Statistics& statistics) {
  const MergeScale scale(kernel, kRadius, kRadius);
  Gather<Unweighted, Statistics> all(*cloud.scene, cloud.maps, statistics);
  all.begin(scale);
  all.start(cloud.eye);
  Spectrum sum;
  all.finish(sum);
  statistics = all.statistics();
  return sum;
}

std::vector<std::unique_ptr<film::UnitAccumulator>> make_accumulators(
    const std::vector<film::AccumulatorSpec>& specs) {
  std::vector<std::unique_ptr<film::UnitAccumulator>> made;
  for (const auto& spec : specs) made.push_back(std::make_unique<film::UnitAccumulator>(4, 3, spec));
  return made;
}

// Claim: statistics of colors are, channel by channel, those of a literal loop, and go to their channels of
// the accumulators.
TEST(Statistics, ColorsAreSummedApart) {
  Cloud cloud;
  fill(cloud, false);
  const Frame frame = make_frame(cloud.eye.hit.ng);
  std::array<double, 36> expected{};
  std::array<double, 3> squares{};
  const double r = static_cast<double>(kRadius);
  each_colored_photon(cloud, false, [&](Vec3 y, const std::array<double, 3>& phi, double d2) {
    if (d2 > r * r) return;
    const std::size_t channel = literal_sector(y, frame) + (2 * d2 < r * r ? 0 : 6);
    for (std::size_t c = 0; c < 3; ++c) {
      expected[12 * c + channel] += phi[c];
      squares[c] += phi[c] * phi[c];
    }
  });
  EXPECT_GT(std::abs(expected[0] / expected[12] - expected[1] / expected[13]), 1e-3) << "one color is tested";
  WeightedSectors sectors(kFirst, true);
  gather(cloud, Kernel::constant, sectors);
  const auto sums = make_accumulators({adaptive::sectors_spec(36, 3), adaptive::squares_spec(36, 3)});
  EXPECT_TRUE(sectors.write(sums, 2, 1, 1, 9, false));
  for (std::size_t i = 0; i < 36; ++i) {
    EXPECT_NEAR(sectors.sums()[i], expected[i], 1e-5 * expected[i]) << i;
    EXPECT_NEAR(std::ldexp(static_cast<double>(sums[0]->sums()[6 * 36 + i]), -32), sectors.sums()[i], 1e-8);
  }
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(sectors.squares()[c], squares[c], 1e-5 * squares[c]);
    EXPECT_NEAR(std::ldexp(static_cast<double>(sums[1]->sums()[6 * 3 + c]), -56) / squares[c], 1, 1e-5);
  }
}

// Claim: sums and squares of phi by sectors are those of a literal loop over photons, on surfaces and in
// media, whatever the kernel; and the merge is what it is without statistics.
TEST(Statistics, SectorsAreALiteralLoop) {
  for (const bool medium : {false, true}) {
    Cloud cloud;
    fill(cloud, medium);
    const Frame frame = make_frame(cloud.eye.hit.ng);
    std::array<double, 12> expected{}, counts{};
    double squares = 0;
    const double r = static_cast<double>(kRadius);
    each_photon(cloud, medium, [&](Vec3 y, double phi, double d2) {
      if (d2 > r * r) return;
      std::size_t channel = 0;
      if (medium) {
        std::size_t axis = 0;
        const double along[] = {static_cast<double>(y.x), static_cast<double>(y.y), static_cast<double>(y.z)};
        for (std::size_t a = 1; a < 3; ++a)
          if (std::abs(along[a]) > std::abs(along[axis])) axis = a;
        channel = axis + (along[axis] < 0 ? 3 : 0) + (std::pow(d2, 1.5) < r * r * r / 2 ? 0 : 6);
      } else {
        channel = literal_sector(y, frame) + (2 * d2 < r * r ? 0 : 6);
      }
      expected[channel] += phi;
      counts[channel] += 1;
      squares += phi * phi;
    });
    for (const Kernel kernel : {Kernel::constant, Kernel::epanechnikov, Kernel::perlin}) {
      WeightedSectors sectors(kFirst);
      const Spectrum sum = gather(cloud, kernel, sectors);
      for (std::size_t i = 0; i < 12; ++i)
        EXPECT_NEAR(sectors.sums()[i], expected[i], 1e-5 * expected[i]) << i;
      EXPECT_NEAR(sectors.squares()[0], squares, 1e-5 * squares);
      SectorCounts counted;
      EXPECT_EQ(gather(cloud, kernel, counted), sum);
      EXPECT_EQ(counted.counts(), counts);
      EXPECT_EQ(merge<Unweighted>(*cloud.scene, cloud.maps, {kernel, kRadius, kRadius}, cloud.eye), sum);
    }
    EXPECT_GT(counts[0], 5);
  }
}

// Claim: the second moment and the Laplacian are those of a literal loop, with photons beyond the radius
// where the stencil reaches further, and those photons add nothing to the image.
TEST(Statistics, MomentsAreALiteralLoop) {
  for (const bool medium : {false, true})
    for (const double h : {0.05, 0.2}) {
      Cloud cloud;
      fill(cloud, medium);
      const Frame frame = make_frame(cloud.eye.hit.ng);
      for (const Kernel kernel : {Kernel::constant, Kernel::epanechnikov, Kernel::perlin}) {
        const MergeScale narrow(kernel, static_cast<float>(h), static_cast<float>(h));
        const MergeScale scale(kernel, kRadius, kRadius);
        const double extent = medium ? 4.0 / 3 * std::numbers::pi * kFirst * kFirst * kFirst
                                     : std::numbers::pi * kFirst * kFirst;
        const auto value = [&](const MergeScale& of, double d2) {
          return static_cast<double>(medium ? of.ball.value(static_cast<float>(d2))
                                            : of.disc.value(static_cast<float>(d2)));
        };
        double moment = 0, mean = 0, laplacian = 0, largest = 0;
        each_photon(cloud, medium, [&](Vec3 y, double phi, double d2) {
          if (d2 <= static_cast<double>(kRadius * kRadius)) {
            moment += value(scale, d2) * extent * phi * phi;
            mean += value(scale, d2) * extent * phi;
          }
          const Vec3 axes[] = {medium ? Vec3{1, 0, 0} : frame.s, medium ? Vec3{0, 1, 0} : frame.t, {0, 0, 1}};
          const auto at = [&](Vec3 to) {
            const auto d = static_cast<double>(dot(y - to, y - to));
            return d <= h * h ? value(narrow, d) : 0.0;
          };
          double stencil = 0;
          for (int a = 0; a < (medium ? 3 : 2); ++a)
            stencil +=
                at(axes[a] * static_cast<float>(h)) + at(axes[a] * static_cast<float>(-h)) - 2 * at({});
          laplacian += phi * stencil / (h * h) * extent * kFirst * kFirst;
          largest += std::abs(phi * stencil) / (h * h) * extent * kFirst * kFirst;
        });
        PlugInMoments moments(kernel, kFirst, h);
        const Spectrum sum = gather(cloud, kernel, moments);
        EXPECT_NEAR(moments.moment(!medium), moment, 1e-5 * moment);
        EXPECT_NEAR(moments.laplacian(!medium), laplacian, 1e-4 * largest);
        EXPECT_NEAR(moments.mean(), medium ? 0 : mean, 1e-5 * mean);
        EXPECT_EQ(moments.moment(medium), 0);
        EXPECT_EQ(moments.laplacian(medium), 0);
        const Spectrum plain = merge<Unweighted>(*cloud.scene, cloud.maps, scale, cloud.eye);
        EXPECT_NEAR(static_cast<double>(sum.g), static_cast<double>(plain.g),
                    1e-5 * static_cast<double>(plain.g));  // another order of the same photons
      }
    }
}

// Claim: pilots of pixels are those of the place on the film, on surfaces alone, and the reach follows them.
TEST(Statistics, PilotsFollowTheFilmPosition) {
  std::vector<SurfacePilot> table;
  for (const double h : {0.2, 0.05}) table.emplace_back(Kernel::constant, kFirst, h);
  const std::string map{0, 1, 1, 0};  // 2 x 2
  for (const bool medium : {false, true}) {
    Cloud cloud;
    fill(cloud, medium);
    const MergeScale scale(Kernel::constant, kRadius, kRadius);
    const auto laplacian = [&](const PlugInMoments& statistics, FilmPosition at) {
      Gather<Unweighted, PlugInMoments> all(*cloud.scene, cloud.maps, statistics);
      all.begin(scale, at);
      all.start(cloud.eye);
      Spectrum sum;
      all.finish(sum);
      return all.statistics().laplacian(!medium);
    };
    const PlugInMoments pilots(Kernel::constant, kFirst, 0.1, {table, map, 2, 2});
    for (const auto& [at, h] : {std::pair{FilmPosition{0.5f, 0.5f}, 0.2}, {FilmPosition{1.5f, 0.5f}, 0.05}}) {
      const double found = laplacian(pilots, at);
      EXPECT_NE(found, 0);
      EXPECT_EQ(found, laplacian({Kernel::constant, kFirst, medium ? 0.1 : h}, at));
    }
  }
}

void expect_empty(const std::vector<std::unique_ptr<film::UnitAccumulator>>& accumulators) {
  for (const auto& sums : accumulators)
    for (std::size_t i = 0; i < 12 * sums->spec().channels; ++i) EXPECT_EQ(sums->sums()[i], 0);
}

// Claim: a path's statistics start at zero, go to one pixel, and are scaled by its weight on the film, by its
// square for squares; where one of the sums is beyond its accumulator nothing is added to any of them, and
// the path is told.
TEST(Statistics, AreWrittenOnceAPath) {
  Cloud cloud;
  fill(cloud, false);
  WeightedSectors sectors(kFirst);
  gather(cloud, Kernel::constant, sectors);
  const auto sums = make_accumulators({adaptive::sectors_spec(40), adaptive::squares_spec(40)});
  EXPECT_TRUE(sectors.write(sums, 2, 1, -0.5f, 9, false));
  for (std::size_t pixel = 0; pixel < 12; ++pixel)
    for (std::size_t c = 0; c < 12; ++c)
      EXPECT_NEAR(std::ldexp(static_cast<double>(sums[0]->sums()[pixel * 12 + c]), -36),
                  pixel == 6 ? 0.5 * sectors.sums()[c] : 0, 1e-9);
  EXPECT_NEAR(std::ldexp(static_cast<double>(sums[1]->sums()[6]), -64) / (0.25 * sectors.squares()[0]), 1,
              1e-9);
  const auto full = make_accumulators({adaptive::sectors_spec(120), adaptive::squares_spec(120)});
  EXPECT_FALSE(sectors.write(full, 2, 1, 1, 9, true));
  expect_empty(full);
  sectors.begin();
  EXPECT_EQ(sectors.squares()[0], 0);
  EXPECT_THAT(sectors.sums(), testing::Each(0));
}

// Claim: moments whose Laplacian alone exceeds its accumulator (a photon that only the stencil
// reaches), are written whole or not at all.
TEST(Statistics, AreWrittenWholeOrNotAtAll) {
  Cloud cloud;
  fill(cloud, false);
  PlugInMoments moments(Kernel::constant, kFirst, kFirst / 8);
  gather(cloud, Kernel::constant, moments);
  ASSERT_GT(std::abs(moments.laplacian()), 100 * moments.moment());
  film::AccumulatorSpec of_moments = adaptive::moments_spec(40), of_laplacian = adaptive::laplacian_spec(40);
  of_moments.scale_log2 = 0;
  for (const bool fits : {true, false}) {
    of_laplacian.scale_log2 =
        55 - static_cast<int>(std::ceil(std::log2(std::abs(moments.laplacian())))) + (fits ? 0 : 2);
    const auto sums = make_accumulators({of_moments, of_laplacian});
    EXPECT_EQ(moments.write(sums, 2, 1, 1, 9, true), fits);
    if (!fits) expect_empty(sums);
  }
}

// Claim: a map gives the scale of the pixel that a place is in, or of the nearest one, and its eta to splats.
TEST(Statistics, ScalesFollowTheFilmPosition) {
  std::vector<MergeScale> levels;
  for (int g = 0; g < 3; ++g)
    levels.emplace_back(Kernel::constant, std::ldexp(1.0f, -g), 1.0f, MergeFactors{1.0 + g, 2.0 + g});
  const std::string map{0, 1, 2, 1, 1, 0};  // 3 x 2
  const ScaleMap scales(levels, map, 3, 2);
  const EtaOf<ScaleMap> eta{scales};
  const auto level = [&](float x, float y) {
    const double surface = eta.at({x, y}).surface;
    EXPECT_EQ(scales.at({x, y}).eta.surface, surface);
    return static_cast<int>(surface) - 1;
  };
  EXPECT_EQ(level(0, 0), 0);
  EXPECT_EQ(level(0.999f, 0.5f), 0);
  EXPECT_EQ(level(1, 0.5f), 1);
  EXPECT_EQ(level(2.5f, 0.9f), 2);
  EXPECT_EQ(level(2.5f, 1), 0);
  EXPECT_EQ(level(-7, 1.5f), 1);
  EXPECT_EQ(level(3, -0.01f), 2);
  EXPECT_EQ(level(99, 99), 0);
}

}  // namespace
}  // namespace candela::transport
