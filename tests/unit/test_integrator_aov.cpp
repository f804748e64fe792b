// AOVs: their values against what geometry says, and that the image does not know of them. Where a pixel's
// mean is an integral, the bound is that of stratified samples.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "common/job/aov.h"
#include "tests/unit/renderer_fixture.h"

namespace candela {
namespace {

constexpr std::uint32_t kAovSide = 12;
// Rounding adds one unit to a whole number with probability 2^-16.
constexpr double kFilmUnit = 1e-10;

// A camera in (0, 0, 4) that looks down on the plane z = 0; `more` is beside it.
std::string plane_scene(const std::string& bsdf, const std::string& more = {}) {
  return "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><float name='fov' "
         "value='40'/><float name='near_clip' value='0.5'/><transform name='to_world'><lookat origin='0,0,4' "
         "target='0,0,0' up='0,1,0'/></transform></sensor><emitter type='constant'/><shape type='rectangle'>"
         "<transform name='to_world'><scale value='20'/></transform>" +
         bsdf + "</shape>" + more + "</scene>";
}
const std::string kGray = "<bsdf type='diffuse'><rgb name='reflectance' value='0.2 0.5 0.7'/></bsdf>";
const std::string kAll =
    "albedo,depth,position,uv,geo_normal,normal,dp_du,dp_dv,prim_index,shape_index,coverage,duv_dx,duv_dy,"
    "boundary_test";

JobSettings aov_job(const std::string& aovs, const std::string& integrator = "path") {
  JobSettings job;
  job.integrator = integrator;
  job.width = job.height = kAovSide;
  job.seed = 11;
  job.aovs = aovs;
  return job;
}

struct Sums {
  std::vector<std::int64_t> film;
  std::map<std::string, std::vector<std::int64_t>> aovs;
  std::map<std::string, film::AccumulatorSpec> specs;
  std::map<std::string, std::string> mattes;  // encoded
  std::map<std::string, film::KeyedSums> keys;
  film::SampleCounts sample_counts;
  // The mean of a pixel's channel over `samples`.
  double mean(const std::string& name, std::size_t pixel, std::uint32_t channel, double samples) const {
    const film::AccumulatorSpec& spec = specs.at(name);
    return std::ldexp(static_cast<double>(aovs.at(name)[pixel * spec.channels + channel]), -spec.scale_log2) /
           samples;
  }
};

Sums sums_of(const render::UnitOutput& output) {
  Sums sums;
  const film::Layout& layout = output.film->layout();
  const std::size_t values = layout.pixel_count() * layout.layers * film::kChannels;
  sums.film.assign(output.film->sums(), output.film->sums() + values);
  for (const auto& aov : output.aovs) {
    std::string name = aov->spec().name;
    if (name.starts_with("aov.")) name = name.substr(4);
    sums.specs[name] = aov->spec();
    if (aov->spec().domain == film::AccumulatorSpec::Domain::keys) {
      sums.keys[name] = aov->keys();
      sums.keys[name].put(sums.mattes[name]);
      continue;
    }
    sums.aovs[name].assign(aov->sums(), aov->sums() + layout.pixel_count() * aov->spec().channels);
  }
  sums.sample_counts = output.sample_counts();
  return sums;
}

Sums run_units(const render::Renderer& renderer, const std::vector<Unit>& units, unsigned threads = 1) {
  const NamedState state = test::state_at(renderer, test::kFilmScaleLog2);
  auto output = renderer.make_output(state);
  for (const Unit& unit : units) {
    const auto done = renderer.run(unit, {state, {}, {}}, output, {threads});
    EXPECT_TRUE(done.ok()) << done.error().to_string();
  }
  return sums_of(output);
}

Unit iterations(std::uint64_t begin, std::uint64_t end) {
  return {Unit::Kind::iterations, 0, begin, end};
}

// Claim: lists are read as Mitsuba's and by kinds alone; all else is refused by name.
TEST(AovNames, AreReadAndRefused) {
  const auto list = parse_aovs("dd.y:depth,nn:sh_normal, normal ,albedo");
  ASSERT_TRUE(list.ok()) << list.error().to_string();
  EXPECT_EQ(text_of(*list), "dd.y:depth,nn:sh_normal,normal:sh_normal,albedo:albedo");
  EXPECT_TRUE(parse_aovs("none")->empty());
  EXPECT_TRUE(parse_aovs("")->empty());
  EXPECT_EQ(parse_aovs(kAll)->size(), 14U);
  EXPECT_EQ(text_of(*parse_aovs("crypto_object,m:crypto_material")),
            "CryptoObject:crypto_object,m:crypto_material");
  for (const char* bad :
       {"colour", "a:colour", "albedo,albedo", "error:albedo", "variance:depth", "1:depth", "a b:depth",
        "albedo,", ":depth", "crypto_object,CryptoObject01:albedo",
        "crypto_object,CryptoObject:crypto_material",
        "a:uv,b:uv,c:uv,d:uv,e:uv,f:uv,g:uv,h:uv,i:uv,j:uv,k:uv,l:uv,m:uv,n:uv,o:uv,p:uv,q:uv"}) {
    const auto refused = parse_aovs(bad);
    ASSERT_FALSE(refused.ok()) << bad;
    EXPECT_EQ(refused.error().kind, ErrorKind::usage) << bad;
  }
}

// Claim: on a plane each value is what geometry says: constants as floats to the last bit, depth and position
// as the integral over the pixel.
TEST(Aovs, OfAPlane) {
  const test::TextFiles files({{"scene.xml", plane_scene(kGray)}});
  constexpr int kSamples = 256;
  const Sums sums = run_units(*test::make_renderer(files, aov_job(kAll), {}), {iterations(0, kSamples)});
  const double half = 4 * std::tan(20 * std::numbers::pi / 180);  // of the image, on the plane
  for (std::uint32_t y = 0; y < kAovSide; ++y)
    for (std::uint32_t x = 0; x < kAovSide; ++x) {
      const std::size_t p = std::size_t{y} * kAovSide + x;
      const auto at = [&](const std::string& name, std::uint32_t c) {
        return sums.mean(name, p, c, kSamples);
      };
      EXPECT_EQ(static_cast<float>(at("albedo", 0)), 0.2f);
      EXPECT_EQ(static_cast<float>(at("albedo", 1)), 0.5f);
      EXPECT_EQ(static_cast<float>(at("albedo", 2)), 0.7f);
      for (const char* normal : {"geo_normal", "normal"}) {
        EXPECT_EQ(at(normal, 0), 0);
        EXPECT_EQ(at(normal, 1), 0);
        EXPECT_NEAR(at(normal, 2), 1, kFilmUnit);
      }
      EXPECT_NEAR(at("coverage", 0), 1, kFilmUnit);
      EXPECT_NEAR(at("shape_index", 0), 1, 1e-6);
      // Mitsuba's camera has x to the left.
      const double px = half * (1 - 2 * (x + 0.5) / kAovSide) * -1,
                   py = half * (1 - 2 * (y + 0.5) / kAovSide);
      EXPECT_NEAR(std::abs(at("position", 0)), std::abs(px), 2e-3);
      EXPECT_NEAR(at("position", 1), py, 2e-3);
      EXPECT_EQ(at("position", 2), 0);
      // The mean of the distance is that of the pixel's middle and what its second derivative adds, below
      // h^2/24 for each axis.
      const double middle = std::sqrt(16 + px * px + py * py);
      EXPECT_NEAR(at("depth", 0), middle, 5e-3);
      // The rectangle spans 40 units for a step of 1 in u and v.
      EXPECT_NEAR(at("uv", 0), 0.5 + at("position", 0) / 40, 1e-5);
      EXPECT_NEAR(at("uv", 1), 0.5 + at("position", 1) / 40, 1e-5);
      EXPECT_NEAR(at("dp_du", 0), 40, 1e-3);
      EXPECT_NEAR(at("dp_dv", 1), 40, 1e-3);
      // A step of one pixel is a step on the plane, the same in all pixels; u and v point to the right and
      // up.
      const double step = 2 * half / kAovSide / 40;
      EXPECT_NEAR(std::abs(at("duv_dx", 0)), step, 1e-6);
      EXPECT_NEAR(at("duv_dx", 1), 0, 1e-6);
      EXPECT_NEAR(at("duv_dy", 0), 0, 1e-6);
      EXPECT_NEAR(at("duv_dy", 1), -step, 1e-6);
      EXPECT_GT(at("boundary_test", 0), 0);
      EXPECT_LE(at("boundary_test", 0), 1);
    }
  // Both signs are there, and both triangles.
  EXPECT_LT(sums.mean("position", 0, 0, 1) * sums.mean("position", kAovSide - 1, 0, 1), 0);
  for (std::size_t cause = 0; cause < sums.sample_counts.rejected.size(); ++cause)
    EXPECT_EQ(sums.sample_counts.rejected[cause], 0U);
}

// Claim: the boundary test is Mitsuba's: three times the least barycentric coordinate on flat triangles, in
// instances and with coordinates of their own too, the squared cosine on smooth ones, the cosine on a sphere,
// the distance from the rim on a disk.
TEST(Aovs, BoundariesOfShapes) {
  const auto middle = [](const std::string& shape, const std::string& aim = "0.1,0.2,0") {
    const std::string scene =
        "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><float name='fov' "
        "value='0.001'/><transform name='to_world'><lookat origin='0.1,0.2,4' target='" +
        aim + "' up='0,1,0'/></transform></sensor>" + shape + "</scene>";
    const test::TextFiles files({{"scene.xml", scene},
                                 {"t.obj",
                                  "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.5 0.5\nvt 0.9 0.1\nvt 0.2 0.3\n"
                                  "f 1/1 2/2 3/3\n"},
                                 {"s.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0.6 0 0.8\nf 1//1 2//1 3//1\n"}});
    const Sums sums =
        run_units(*test::make_renderer(files, aov_job("boundary_test"), {}), {iterations(0, 4)});
    return sums.mean("boundary_test", kAovSide * kAovSide / 2 + kAovSide / 2, 0, 4);
  };
  const auto obj = [](const std::string& file, const std::string& more = {}) {
    return "<shape type='obj'><string name='filename' value='" + file + "'/>" + more + "</shape>";
  };
  // At (0.1, 0.2) the least of 0.7, 0.1, 0.2.
  const std::string flat = obj("t.obj", "<boolean name='face_normals' value='true'/>");
  EXPECT_NEAR(middle(flat), 0.3, 1e-3);
  EXPECT_NEAR(middle("<shape type='shapegroup' id='g'>" + flat +
                     "</shape><shape type='instance'><ref id='g'/><transform name='to_world'><scale x='2' "
                     "y='1' z='3'/></transform></shape>"),
              0.15, 1e-3);
  EXPECT_NEAR(middle(obj("t.obj")), 1, 1e-3);  // its normals are averages: it is smooth
  EXPECT_NEAR(middle(obj("s.obj")), 0.64, 1e-3);
  EXPECT_NEAR(middle("<shape type='disk'/>"), 1 - std::sqrt(0.05), 1e-3);
  EXPECT_NEAR(middle("<shape type='sphere'/>"), std::sqrt(0.95), 1e-3);
}

// Claim: the normal of a sphere is its position over its radius, in every pixel, far from the origin too;
// where nothing is hit all is zero.
TEST(Aovs, OfASphere) {
  // The last is further than floats of this size reach: the scene is moved, and positions are the file's.
  for (const double away : {0.0, 1e4, 4e6}) {
    const std::string place = std::to_string(away);
    const std::string scene =
        "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><float name='fov' "
        "value='40'/><transform name='to_world'><lookat origin='" +
        place + ",0,-4' target='" + place +
        ",0,0' up='0,1,0'/></transform></sensor><shape type='sphere'><point "
        "name='center' x='" +
        place + "' y='0' z='0'/></shape></scene>";
    const test::TextFiles files({{"scene.xml", scene}});
    constexpr int kSamples = 64;
    const Sums sums = run_units(*test::make_renderer(files, aov_job("normal,position,coverage,depth"), {}),
                                {iterations(0, kSamples)});
    std::size_t covered = 0, empty = 0;
    for (std::size_t p = 0; p < kAovSide * kAovSide; ++p) {
      const double coverage = sums.mean("coverage", p, 0, kSamples);
      for (std::uint32_t c = 0; c < 3; ++c) {
        const double center = c == 0 ? away : 0;
        EXPECT_NEAR(sums.mean("normal", p, c, kSamples),
                    sums.mean("position", p, c, kSamples) - center * coverage,
                    1e-5 + 2e-7 * std::min(away, 1e4) + 2e-9 * away);
      }
      if (coverage == 0) {
        ++empty;
        EXPECT_EQ(sums.mean("depth", p, 0, kSamples), 0);
      }
      covered += coverage == 1 ? 1 : 0;
    }
    EXPECT_GT(covered, 20U);
    EXPECT_GT(empty, 20U);
  }
}

// Claim: the film has the same bits with and without AOVs, of every integrator of iterations that has
// accumulators and of one that has none.
TEST(Aovs, LeaveTheFilmAlone) {
  const test::TextFiles files({{"scene.xml", plane_scene(kGray, "<shape type='sphere'/>")}});
  for (const std::string integrator : {"path", "bdpt", "optimis"}) {
    const Unit unit = iterations(0, 4);
    const Sums with = run_units(*test::make_renderer(files, aov_job(kAll, integrator), {}), {unit});
    const Sums without = run_units(*test::make_renderer(files, aov_job("", integrator), {}), {unit});
    EXPECT_TRUE(with.film == without.film) << integrator;
    EXPECT_EQ(with.sample_counts.eye_samples, without.sample_counts.eye_samples);
    EXPECT_EQ(with.sample_counts.rays, without.sample_counts.rays + 4 * kAovSide * kAovSide);
    EXPECT_TRUE(without.aovs.empty());
  }
}

// Claim: sums do not depend on threads, nor on how iterations are cut into units.
TEST(Aovs, AreSumsOfUnits) {
  const test::TextFiles files({{"scene.xml", plane_scene(kGray, "<shape type='sphere'/>")}});
  const auto renderer = test::make_renderer(files, aov_job(kAll), {});
  const Sums whole = run_units(*renderer, {iterations(0, 9)}, 3);
  const Sums parts = run_units(*renderer, {iterations(5, 9), iterations(0, 2), iterations(2, 5)});
  EXPECT_TRUE(whole.aovs == parts.aovs);
  EXPECT_TRUE(whole.film == parts.film);
}

// Claim: with a filter of negative lobes constants stay what they are, within the filter's own noise, and the
// weights' sign does not reject a sample.
TEST(Aovs, UnderFilters) {
  const test::TextFiles files({{"scene.xml", plane_scene(kGray)}});
  JobSettings job = aov_job("albedo,coverage");
  job.filter = "mitchell";
  job.filter_settings = {{"B", "0.333333"}, {"C", "0.333333"}};
  constexpr int kSamples = 256;
  const Sums sums = run_units(*test::make_renderer(files, job, {}), {iterations(0, kSamples)});
  for (std::size_t p = 0; p < kAovSide * kAovSide; ++p) {
    EXPECT_NEAR(sums.mean("coverage", p, 0, kSamples), 1, 0.1);
    EXPECT_NEAR(sums.mean("albedo", p, 1, kSamples), 0.5 * sums.mean("coverage", p, 0, kSamples), 1e-6);
  }
  for (const std::uint64_t rejected : sums.sample_counts.rejected) EXPECT_EQ(rejected, 0U);
}

// Claim: in each pixel the sums over names are those of the coverage to the bit, whatever the filter, and
// each name has the share of its surface; what light passes straight is seen by its share. Names are those of
// shape or material, else of kind and number. Sums depend neither on threads nor on how iterations are cut
// into units.
TEST(Mattes, SumToTheCoverage) {
  const std::string scene = plane_scene("<bsdf type='diffuse' id='stone'/>",
                                        "<shape type='sphere' id='ball'><float name='radius' "
                                        "value='0.7'/><bsdf type='twosided'><bsdf type='diffuse' "
                                        "id='gold'/></bsdf></shape><shape type='sphere'><point name='center' "
                                        "x='1' y='0' z='0'/><float name='radius' "
                                        "value='0.4'/></shape><shape type='rectangle' id='veil'><transform "
                                        "name='to_world'><translate x='-1.2' z='2'/>"
                                        "</transform><bsdf type='mask' id='gauze'><float name='opacity' "
                                        "value='0.25'/><bsdf type='diffuse'/>"
                                        "</bsdf></shape>");
  const test::TextFiles files({{"scene.xml", scene}});
  constexpr int kSamples = 64;
  for (const bool lobes : {false, true}) {
    JobSettings job = aov_job("coverage,crypto_object,crypto_material");
    job.filter = lobes ? "mitchell" : "box";
    if (lobes) job.filter_settings = {{"B", "0.333333"}, {"C", "0.333333"}};
    const auto renderer = test::make_renderer(files, job, {});
    const Sums whole = run_units(*renderer, {iterations(0, kSamples)}, 3);
    const Sums parts = run_units(*renderer, {iterations(9, kSamples), iterations(0, 2), iterations(2, 9)});
    EXPECT_TRUE(whole.mattes == parts.mattes);
    EXPECT_EQ(whole.specs.at("CryptoObject").key_names,
              (std::vector<std::string>{"rectangle.1", "ball", "sphere.2", "veil"}));
    EXPECT_EQ(whole.specs.at("CryptoMaterial").key_names,
              (std::vector<std::string>{"stone", "gold", "sphere.2", "gauze"}));
    std::vector<film::KeyedSums::KeySum> keys;
    std::array<double, 4> shares{};
    for (const std::string name : {"CryptoObject", "CryptoMaterial"})
      for (std::uint32_t p = 0; p < kAovSide * kAovSide; ++p) {
        whole.keys.at(name).get_pixel(p % kAovSide, p / kAovSide, keys);
        film::Int128 sum = 0;
        for (const film::KeyedSums::KeySum& key : keys) {
          sum += key.sum;
          shares[key.key] += std::ldexp(static_cast<double>(key.sum), -whole.specs.at(name).scale_log2);
        }
        EXPECT_TRUE(sum == whole.aovs.at("coverage")[p]);
      }
    for (double& share : shares) share /= 2.0 * kSamples * kAovSide * kAovSide;
    EXPECT_NEAR(shares[0] + shares[1] + shares[2] + shares[3], 1, lobes ? 0.02 : 1e-9);
    for (const double share : shares) EXPECT_GT(share, 0.01);
    // A quarter of the veil: its square is 2 wide at distance 2, cut by the image's left edge at 0.728.
    const double half = 2 * std::tan(20 * std::numbers::pi / 180);
    EXPECT_NEAR(shares[3], 0.25 * (half - 0.2) / (2 * half), 0.01);
  }
}

// Claim: of a job of chains each segment brings as many eye samples as mutations, which are counted pixel by
// pixel and spread evenly; values are means over the counted ones. The film stays what it was.
TEST(Aovs, OfChains) {
  const test::TextFiles files({{"scene.xml", plane_scene(kGray)}});
  const SettingsMap small = {{"chains", "4"}, {"mutations", "6"}, {"bootstrap", "1000"}};
  const auto render = [&](const std::string& aovs) {
    const auto renderer = test::make_renderer(files, aov_job(aovs, "pssmlt"), small);
    NamedState state;
    state.film_scale_log2 = test::kFilmScaleLog2;
    auto output = renderer->make_output(state);  // b = 0: the chains stand still
    std::vector<chains::ChainStart> starts(2);
    const auto done = renderer->run({Unit::Kind::segments, 0, 0, 2}, {state, {}, starts}, output, {2});
    EXPECT_TRUE(done.ok()) << done.error().to_string();
    return sums_of(output);
  };
  const Sums with = render("albedo"), without = render("");
  EXPECT_TRUE(with.film == without.film);
  ASSERT_TRUE(with.aovs.contains("aov-samples"));
  std::int64_t total = 0;
  for (std::size_t p = 0; p < kAovSide * kAovSide; ++p) {
    const auto samples = with.aovs.at("aov-samples")[p];
    total += samples;
    // Two of four chains: three samples of six.
    EXPECT_EQ(samples, 3);
    EXPECT_EQ(static_cast<float>(with.mean("albedo", p, 1, static_cast<double>(samples))), 0.5f);
  }
  EXPECT_EQ(total, kAovSide * kAovSide * 3);
}

// Claim: a second name for a layer of the integrator is refused.
TEST(Aovs, DoNotHideLayers) {
  const test::TextFiles files({{"scene.xml", plane_scene(kGray)}});
  JobSettings job = aov_job("independent:albedo", "pssmlt");
  job.integrator_settings = *render::complete_integrator_settings("pssmlt", {}, {});
  const auto refused = render::Renderer::create(files, "scene.xml", {}, job, 1);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().field, "aovs");
}

}  // namespace
}  // namespace candela
