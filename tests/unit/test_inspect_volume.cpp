// Tests of the light in space: cells that a segment crosses, exact sums, and grids of scenes whose light is
// known. Estimates are allowed five standard errors or more; the file alarms falsely with probability below
// 1e-4.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <thread>

#include "common/rng/stream.h"
#include "tests/unit/inspect_fixture.h"
#include "worker/inspect/volume.h"
#include "worker/integrators/volume/cell_film.h"

namespace candela::inspect {
namespace {

// The length of a segment in a box, by slabs, without a grid.
double length_in(Vec3d low, Vec3d high, Vec3d from, Vec3d direction, double longest) {
  double enter = 0, leave = longest;
  for (int a = 0; a < 3; ++a) {
    if (direction[a] == 0) {
      if (from[a] < low[a] || from[a] >= high[a]) return 0;
      continue;
    }
    const double t0 = (low[a] - from[a]) / direction[a], t1 = (high[a] - from[a]) / direction[a];
    enter = std::max(enter, std::min(t0, t1));
    leave = std::min(leave, std::max(t0, t1));
  }
  return std::max(0.0, leave - enter);
}

// Claim: each cell is visited once at most, with the length that the segment has in it, and no other cell has
// any; from outside and inside, along axes and diagonals, on faces and through corners, and without an end.
TEST(InspectVolume, VisitsTheCellsOfASegment) {
  const CellGrid grid{{-1, 0, 2}, {2, 1, 4}, {6, 3, 5}};
  const Vec3d cell = grid.cell();
  rng::Stream stream(rng::key(7, 1));
  const auto uniform = [&] { return rng::to_double(stream.next_u64()); };
  double crossed = 0;
  for (int i = 0; i < 3000; ++i) {
    Vec3d from{-2 + 5 * uniform(), -1 + 3 * uniform(), 1 + 4 * uniform()};
    Vec3d direction{uniform() - 0.5, uniform() - 0.5, uniform() - 0.5};
    if (i % 5 == 1) direction.x = 0;
    if (i % 5 == 2) direction.x = direction.y = 0;
    if (i % 5 == 3) direction = {direction.x < 0 ? -0.5 : 0.5, direction.y < 0 ? -1.0 / 3 : 1.0 / 3, 0.4};
    if (i % 7 < 3) from = {-1 + 0.5 * std::floor(6 * uniform()), std::floor(3 * uniform()) / 3, from.z};
    direction = direction / length(direction);
    const double longest = i % 4 == 0 ? INFINITY : 3 * uniform();
    std::map<std::uint64_t, double> visited;
    for_each_cell(grid, from, direction, longest, [&](std::uint64_t at, double part) {
      EXPECT_TRUE(visited.emplace(at, part).second) << "twice in one cell";
      EXPECT_GT(part, 0);
    });
    std::uint64_t at = 0;
    for (std::uint32_t z = 0; z < 5; ++z)
      for (std::uint32_t y = 0; y < 3; ++y)
        for (std::uint32_t x = 0; x < 6; ++x, ++at) {
          const Vec3d low = grid.low + Vec3d{x * cell.x, y * cell.y, z * cell.z};
          const double expected = length_in(low, low + cell, from, direction, longest);
          const auto found = visited.find(at);
          ASSERT_NEAR(found == visited.end() ? 0 : found->second, expected, 1e-12) << i << " cell " << at;
          crossed += expected;
        }
  }
  EXPECT_GT(crossed, 500);
  int visits = 0;
  const auto count = [&](std::uint64_t, double) { ++visits; };
  for_each_cell(grid, {NAN, 0, 0}, {1, 0, 0}, 9, count);
  for_each_cell(grid, {0, 0.5, 3}, {NAN, NAN, NAN}, 9, count);
  for_each_cell(grid, {1e300, 1e300, 1e300}, {1, 0, 0}, INFINITY, count);
  EXPECT_EQ(visits, 0);
}

// Claim: sums are the same to the bit whatever order and threads, negative values too, and parts add up to
// the whole.
TEST(InspectVolume, AddsExactly) {
  std::vector<double> values;
  rng::Stream stream(rng::key(3, 1));
  for (int i = 0; i < 4000; ++i)
    values.push_back(std::ldexp(rng::to_double(stream.next_u64()) - 0.3, i % 60 - 30));
  CellSums forward(1), backward(1), odd(1), even(1), threaded(1);
  for (std::size_t i = 0; i < values.size(); ++i) {
    ASSERT_TRUE(forward.add(0, values[i]));
    ASSERT_TRUE(backward.add(0, values[values.size() - 1 - i]));
    ASSERT_TRUE((i % 2 == 0 ? even : odd).add(0, values[i]));
  }
  {
    std::vector<std::jthread> team;
    for (std::size_t t = 0; t < 3; ++t)
      team.emplace_back([&, t] {
        for (std::size_t i = t; i < values.size(); i += 3) threaded.add(0, values[i]);
      });
  }
  EXPECT_TRUE(forward == backward);
  EXPECT_TRUE(forward == threaded);
  even.add(odd);
  EXPECT_TRUE(forward == even);
  double sum = 0;
  for (const double v : values) sum += v;
  EXPECT_NEAR(forward.value(0), sum, 1e-9 * std::abs(sum));
  CellSums back(1);
  EXPECT_TRUE(back.add(0, -1.5) && back.add(0, 1.5) && back.add(0, -0x1p-64) && back.add(0, 0x1p-64));
  EXPECT_TRUE(back == CellSums(1));
  EXPECT_FALSE(back.add(0, 0x1p41) || back.add(0, NAN) || back.add(0, -INFINITY));
  EXPECT_TRUE(back == CellSums(1));
}

constexpr std::uint32_t kSize = 8;

std::unique_ptr<Session> open(const std::string& body, const std::string& expression = {},
                              const SettingsMap& chosen = {}) {
  JobSettings job;
  job.integrator = "bdpt";
  job.width = job.height = kSize;
  job.filter = "box";
  job.seed = 5;
  const auto settings = render::complete_integrator_settings("bdpt", {}, chosen);
  EXPECT_TRUE(settings.ok());
  job.integrator_settings = *settings;
  const test::TextFiles files({{"scene.xml", "<scene version=\"3.0.0\">" + body + "</scene>"}});
  auto session = Session::open(files, "scene.xml", {}, job, {expression, {}}, 1);
  if (!session.ok()) throw std::runtime_error(session.error().to_string());
  return std::move(*session);
}

VolumeRequest whole(const CellGrid& grid, std::uint64_t spp) {
  VolumeRequest request;
  request.pixels = {0, 0, kSize - 1, kSize - 1};
  request.grid = grid;
  request.spp = spp;
  return request;
}

VolumeReport inspect_of(const Session& session, const VolumeRequest& request) {
  auto report = inspect_volume(session, request);
  if (!report.ok()) throw std::runtime_error(report.error().to_string());
  return std::move(*report);
}

struct Green {
  CellGrid grid;
  loaders::VolumeData data;
  double at(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    const std::size_t cell = (std::size_t{z} * grid.size[1] + y) * grid.size[0] + x;
    return static_cast<double>(data.values[3 * cell + 1]);
  }
};
Green green_of(const VolumeRequest& request, VolumeReport& report) {
  auto data = volume_data(request, report);
  if (!data.ok()) throw std::runtime_error(data.error().to_string());
  return {request.grid, *std::move(data)};
}

// Claim: sunlight at 37 degrees from the vertical reaches the floor's four square meters that the image shows
// as a beam of known place and density: radiance / (area * cosine) in its cells, 0 beside it; each layer of
// cells has the image's light times the length of the way through it.
TEST(InspectVolume, SunlightIsABeam) {
  const auto session = open(
      R"(<sensor type="orthographic"><transform name="to_world">
        <lookat origin="0, 5, 0" target="0, 0, 0" up="0, 0, 1"/></transform></sensor>
      <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/></transform>
        <bsdf type="diffuse"><rgb name="reflectance" value="0.5"/></bsdf></shape>
      <emitter type="directional"><vector name="direction" x="0.6" y="-0.8" z="0"/>
        <rgb name="irradiance" value="3.14159265"/></emitter>)",
      {}, {{"max_depth", "2"}});
  const CellGrid grid{{-4, 0, -1}, {2, 2, 1}, {12, 4, 2}};
  const VolumeRequest request = whole(grid, 1600);
  VolumeReport report = inspect_of(*session, request);
  EXPECT_NEAR(report.mean.y, 0.4, 0.4e-3);
  EXPECT_EQ(report.crossing.y, report.mean.y);
  EXPECT_EQ(report.too_large, 0u);
  const double mean = report.mean.y;
  const Green light = green_of(request, report);
  const Vec3d cell = grid.cell();
  int inside = 0, outside = 0;
  for (std::uint32_t y = 0; y < 4; ++y) {
    double sum = 0;
    const double y0 = y * cell.y, y1 = y0 + cell.y;
    for (std::uint32_t x = 0; x < 12; ++x) {
      const double x0 = grid.low.x + x * cell.x, x1 = x0 + cell.x;
      for (std::uint32_t z = 0; z < 2; ++z) {
        sum += light.at(x, y, z) * cell.x * cell.y * cell.z;
        if (x0 >= -1 - 0.75 * y0 && x1 <= 1 - 0.75 * y1) {
          ++inside;
          // 12800 samples cross the cell.
          EXPECT_NEAR(light.at(x, y, z), 0.4 / (4 * 0.8), 0.05 * 0.125) << x << ' ' << y;
        } else if (x1 < -1 - 0.75 * y1 || x0 > 1 - 0.75 * y0) {
          ++outside;
          EXPECT_EQ(light.at(x, y, z), 0) << x << ' ' << y;
        }
      }
    }
    EXPECT_NEAR(sum, mean * cell.y / 0.8, 1e-5 * sum) << y;
  }
  EXPECT_GE(inside, 16);
  EXPECT_GE(outside, 40);
}

// Claim: the film of a job has, in its layer of the light that is selected, the sums that one machine has of
// the same samples, for each cell, and for the light and its part that crosses the box.
TEST(InspectVolume, JobsHaveTheSameLight) {
  const std::string body =
      R"(<sensor type="perspective"><float name="fov" value="50"/><transform name="to_world">
        <lookat origin="100, 3, 6" target="100, 0.5, 0" up="0, 1, 0"/></transform></sensor>
      <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="4"/>
        <translate x="100"/></transform><bsdf type="diffuse"/></shape>
      <shape type="sphere"><point name="center" x="100" y="1" z="0"/><float name="radius" value="0.8"/>
        <bsdf type="dielectric"/></shape>
      <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate x="100" y="4"/></transform>
        <emitter type="area"><rgb name="radiance" value="5, 4, 3"/></emitter></shape>)";
  const std::string select = "LS+DE";
  const SettingsMap depth = {{"max_depth", "5"}};
  const auto session = open(body, select, depth);
  VolumeRequest request = whole({{98, 0.1, -1.5}, {100, 3, 1.5}, {5, 4, 3}}, 160);
  request.pixels = {1, 2, 6, 7};
  const VolumeReport report = inspect_of(*session, request);
  EXPECT_GT(report.paths, 100u);

  JobSettings job;
  job.integrator = "volume";
  job.width = integrators::cell_film_width(request.grid);
  job.height = integrators::cell_film_height(request.grid);
  job.filter = "box";
  job.seed = 5;
  job.layers = letters::text_of(session->request());
  SettingsMap settings = depth;
  for (const auto& [name, value] : {std::pair{"film_width", "8"},
                                    {"film_height", "8"},
                                    {"pixel_x0", "1"},
                                    {"pixel_y0", "2"},
                                    {"pixel_x1", "6"},
                                    {"pixel_y1", "7"},
                                    {"low_x", "98"},
                                    {"low_y", "0.1"},
                                    {"low_z", "-1.5"},
                                    {"high_x", "100"},
                                    {"high_y", "3"},
                                    {"high_z", "1.5"},
                                    {"cells_x", "5"},
                                    {"cells_y", "4"},
                                    {"cells_z", "3"}})
    settings[name] = value;
  const test::TextFiles files({{"scene.xml", "<scene version=\"3.0.0\">" + body + "</scene>"}});
  const auto renderer = test::make_renderer(files, job, settings);
  const auto film = test::render_job(*renderer, request.spp);
  const std::size_t layer = std::size_t{job.width} * job.height * 3;
  const auto sum = [&](std::uint64_t pixel, std::size_t channel) {
    return std::ldexp(static_cast<double>(film->sums()[layer + 3 * pixel + channel]), -test::kFilmScaleLog2);
  };
  for (std::uint64_t i = 0; i < 3 * request.grid.count(); ++i) {
    const double expected = std::ldexp(report.sums.value(i), -report.scale_log2);
    EXPECT_NEAR(sum(i / 3, i % 3), expected, 1e-5 * expected + 1e-5) << i;
  }
  const double samples = static_cast<double>(request.pixels.count() * request.spp);
  for (std::size_t c = 0; c < 3; ++c) {
    const auto of = [&](integrators::CellFilmSum which) {
      return sum(integrators::cell_film_pixel(request.grid, which), c) / samples;
    };
    const double mean = report.mean[static_cast<int>(c)], crossing = report.crossing[static_cast<int>(c)];
    EXPECT_NEAR(of(integrators::CellFilmSum::light), mean, 1e-5 * mean) << c;
    EXPECT_NEAR(of(integrators::CellFilmSum::crossing), crossing, 1e-5 * crossing) << c;
    EXPECT_GT(mean, crossing);
  }
}

// Claim: with edges to the eye, a sky's light converges on a pinhole: radiance / cross-section of the cone.
// Without them light that is seen directly crosses nothing.
TEST(InspectVolume, EdgesToTheEyeConverge) {
  const auto session = open(
      R"(<sensor type="perspective"><float name="fov" value="40"/></sensor>
      <emitter type="constant"><rgb name="radiance" value="3"/></emitter>)");
  VolumeRequest request = whole({{-0.2, -0.2, 2}, {0.2, 0.2, 2.5}, {1, 1, 1}}, 4000);
  VolumeReport none = inspect_of(*session, request);
  EXPECT_EQ(none.paths, 0u);
  EXPECT_EQ(green_of(request, none).at(0, 0, 0), 0);
  request.eye_edges = true;
  VolumeReport report = inspect_of(*session, request);
  // The mean of 1 / (2 z tan)^2 over the cell; the slope adds 0.3 %. 5 standard errors of 11000 samples.
  const double tangent = std::tan(20 * M_PI / 180), expected = 3 / (4 * tangent * tangent * 2 * 2.5);
  EXPECT_NEAR(green_of(request, report).at(0, 0, 0), expected, 0.05 * expected);
}

// Glass, a glossy box, fog, a lamp and a sky.
constexpr const char* kRich =
    R"(<sensor type="perspective"><float name="fov" value="40"/>
      <transform name="to_world"><lookat origin="0, 4, 9" target="0, 1, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="8"/></transform>
      <bsdf type="twosided"><bsdf type="roughplastic"><float name="alpha" value="0.2"/>
      <rgb name="diffuse_reflectance" value="0.7, 0.3, 0.05"/></bsdf></bsdf></shape>
    <shape type="sphere" id="ball"><point name="center" x="1.2" y="1" z="0.5"/><bsdf type="dielectric"/>
      <medium name="interior" type="homogeneous" id="fog"><rgb name="sigma_t" value="0.2, 0.4, 1"/></medium></shape>
    <shape type="rectangle"><transform name="to_world"><rotate x="1" angle="90"/><translate y="5"/></transform>
      <emitter type="area" id="ceiling"><rgb name="radiance" value="9, 8, 7"/></emitter></shape>
    <emitter type="constant" id="sky"><rgb name="radiance" value="0.3, 0.4, 0.5"/></emitter>)";

// Claim: threads change not a bit, and expressions that are a partition have grids that add up to the whole
// to the bit, in a scene with all letters, media, mixed lobes and light from outside.
TEST(InspectVolume, PartsAddUpToTheWhole) {
  VolumeRequest request = whole({{-2, 0, -2}, {3, 4, 2}, {9, 7, 5}}, 32);
  request.eye_edges = true;
  const SettingsMap settings = {{"max_depth", "6"}};
  const VolumeReport all = inspect_of(*open(kRich, {}, settings), request);
  EXPECT_GT(all.paths, 1000u);
  EXPECT_GT(all.mean.y, all.crossing.y);
  EXPECT_GT(all.crossing.y, 0);
  request.threads = 3;
  const VolumeReport threaded = inspect_of(*open(kRich, {}, settings), request);
  EXPECT_TRUE(all.sums == threaded.sums);
  EXPECT_EQ(all.mean, threaded.mean);
  EXPECT_EQ(all.crossing, threaded.crossing);
  CellSums sum(3 * request.grid.count());
  Vec3d mean;
  for (const char* part : {"LE", "L[DGS]*DE", "L[DGS]*GE", "L[DGS]*SE", "L[DGS]*V[DGSV]*E"}) {
    const VolumeReport selected = inspect_of(*open(kRich, part, settings), request);
    EXPECT_EQ(selected.scale_log2, all.scale_log2);
    EXPECT_GT(selected.paths, 0u) << part;
    sum.add(selected.sums);
    mean += selected.mean;
  }
  EXPECT_TRUE(sum == all.sums);
  EXPECT_NEAR(mean.y, all.mean.y, 1e-9);
}

}  // namespace
}  // namespace candela::inspect
