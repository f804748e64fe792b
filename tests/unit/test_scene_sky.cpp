// The sky's model against radiances measured of Mitsuba 0.6's emitter: rows that the fit
// (tests/bench/fit_sky.py) did not see. A row is the mean over a pixel of 2.8125 degrees squared.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <numbers>
#include <sstream>
#include <tuple>
#include <vector>

#include "tests/paths.h"
#include "tests/unit/scene_fixture.h"
#include "worker/scene/emitters/sky_model.h"

namespace candela::scene {
namespace {

struct SkyRow {
  double turbidity = 0, albedo = 0, elevation = 0, theta = 0, phi = 0;  // angles in degrees
  std::array<double, 3> rgb{};
};

constexpr double kPixel = 2.8125;
constexpr double kToRadians = std::numbers::pi / 180;

std::vector<SkyRow> parse_rows(const std::string& text) {
  std::vector<SkyRow> rows;
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);  // names of the columns
  while (std::getline(lines, line)) {
    std::array<double, 8> v{};
    const char* at = line.c_str();
    for (double& value : v) {
      char* end = nullptr;
      value = std::strtod(at, &end);
      at = *end == ',' ? end + 1 : end;
    }
    rows.push_back({v[0], v[1], v[2], v[3], v[4], {v[5], v[6], v[7]}});
  }
  return rows;
}

std::vector<SkyRow> sample_rows() {
  std::ifstream file(test::source_path("tests/unit/sky_rows.csv"));
  std::stringstream text;
  text << file.rdbuf();
  return parse_rows(text.str());
}

// Means over the pixel of what `radiance` says of (theta, phi from the sun) in radians: three by three nodes
// of Gauss and Legendre.
template <class Radiance>
std::array<double, 3> pixel_mean(const SkyRow& row, const Radiance& radiance) {
  const double node = std::sqrt(0.6) / 2 * kPixel;
  const std::array<double, 3> offsets = {-node, 0, node}, weights = {5.0 / 18, 8.0 / 18, 5.0 / 18};
  std::array<double, 3> sums{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const std::array<double, 3> rgb =
          radiance((row.theta + offsets[i]) * kToRadians, (row.phi + offsets[j]) * kToRadians);
      for (std::size_t k = 0; k < 3; ++k) sums[k] += weights[i] * weights[j] * rgb[k];
    }
  return sums;
}

std::array<double, 3> modeled(const SkyModel& sky, const SkyRow& row) {
  return pixel_mean(row, [&](double theta, double phi) {
    const double sun = (90 - row.elevation) * kToRadians;
    const double cosine = std::cos(theta) * std::cos(sun) + std::sin(theta) * std::sin(sun) * std::cos(phi);
    const Vec3d rgb = sky.radiance(std::cos(theta), std::acos(std::clamp(cosine, -1.0, 1.0)));
    return std::array<double, 3>{rgb.x, rgb.y, rgb.z};
  });
}

SkyModel model_of(const SkyRow& row) {
  return {row.turbidity, Vec3d{row.albedo, row.albedo, row.albedo}, row.elevation * kToRadians};
}

struct Residuals {
  double worst = 0, squares = 0;
  std::size_t count = 0, beyond = 0;  // beyond 2 %
  void add(double residual) {
    worst = std::max(worst, std::abs(residual));
    squares += residual * residual;
    ++count;
    beyond += std::abs(residual) > 0.02 ? 1 : 0;
  }
  double rms() const { return std::sqrt(squares / static_cast<double>(count)); }
};

// Claim: of held-out rows of each turbidity and albedo the model is within 2 % in each channel, and 0.5 % off
// in the mean square.
TEST(Sky, HeldOutRowsAreMet) {
  const std::vector<SkyRow> rows = sample_rows();
  ASSERT_GE(rows.size(), 200U);
  std::map<std::tuple<double, double, std::size_t>, Residuals> states;
  Residuals all;
  for (const SkyRow& row : rows) {
    const std::array<double, 3> rgb = modeled(model_of(row), row);
    for (std::size_t k = 0; k < 3; ++k) {
      const double residual = rgb[k] / row.rgb[k] - 1;
      all.add(residual);
      states[{row.turbidity, row.albedo, k}].add(residual);
      EXPECT_LE(std::abs(residual), 0.02) << row.turbidity << " " << row.albedo << " " << row.elevation << " "
                                          << row.theta << " " << row.phi << " channel " << k;
    }
  }
  EXPECT_EQ(states.size(), 60U);
  for (const auto& [state, residuals] : states) EXPECT_GE(residuals.count, 8U);
  EXPECT_LT(all.rms(), 0.005);
}

// Claim: the same of all measured rows where ../shared is: one in a thousand is off by more than 2 %, none by
// 3.5 %; and for each sun the light on the ground, by a quadrature over the rows, is within 0.5 %.
TEST(Sky, AllMeasuredRowsAreMet) {
  const std::filesystem::path file = test::shared_path() / "data/sky-of-mitsuba.csv.gz";
  if (!std::filesystem::exists(file))
    GTEST_SKIP() << "the folder ../shared with measured radiances is not here";
  const gzFile bytes = gzopen(file.c_str(), "rb");
  ASSERT_NE(bytes, nullptr);
  std::string text;
  std::array<char, 1 << 16> part{};
  for (int n = 0; (n = gzread(bytes, part.data(), part.size())) > 0;) text.append(part.data(), n);
  gzclose(bytes);
  const std::vector<SkyRow> rows = parse_rows(text);
  ASSERT_EQ(rows.size(), 80920U);
  Residuals all;
  for (std::size_t begin = 0; begin < rows.size();) {
    const SkyRow& first = rows[begin];
    const SkyModel sky = model_of(first);
    std::array<double, 3> measured{}, model{};
    std::size_t i = begin;
    for (; i < rows.size() && rows[i].elevation == first.elevation && rows[i].turbidity == first.turbidity &&
           rows[i].albedo == first.albedo;
         ++i) {
      const std::array<double, 3> rgb = modeled(sky, rows[i]);
      const double weight = std::sin(2 * rows[i].theta * kToRadians);
      for (std::size_t k = 0; k < 3; ++k) {
        all.add(rgb[k] / rows[i].rgb[k] - 1);
        measured[k] += weight * rows[i].rgb[k];
        model[k] += weight * rgb[k];
      }
    }
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_NEAR(model[k] / measured[k], 1, 0.005)
          << first.turbidity << " " << first.albedo << " " << first.elevation << " channel " << k;
    begin = i;
  }
  EXPECT_LT(all.rms(), 0.005);
  EXPECT_LT(all.worst, 0.035);
  EXPECT_LT(all.beyond, all.count / 1000);
}

// Claim: the emitter's picture has the measured radiances, with the sun where sun_direction puts it and the
// ground's albedo as given.
TEST(Sky, PictureHasMeasuredRadiances) {
  const std::vector<SkyRow> rows = sample_rows();
  for (std::size_t i = 0; i < rows.size(); i += 6) {
    const SkyRow& row = rows[i];
    const double a = row.elevation * kToRadians;
    const auto scene = test::build_scene(fmt::format(
        R"(<emitter type="sky"><float name="turbidity" value="{}"/><rgb name="albedo" value="{}"/>
           <vector name="sun_direction" x="{}" y="{}" z="0"/></emitter>)",
        row.turbidity, row.albedo, std::cos(a), std::max(std::sin(a), 1e-6)));
    ASSERT_TRUE(scene.ok()) << scene.error().to_string();
    const std::array<double, 3> rgb = pixel_mean(row, [&](double theta, double phi) {
      const Spectrum seen = (*scene)->environment({static_cast<float>(std::sin(theta) * std::cos(phi)),
                                                   static_cast<float>(std::cos(theta)),
                                                   static_cast<float>(std::sin(theta) * std::sin(phi))});
      return std::array<double, 3>{static_cast<double>(seen.r), static_cast<double>(seen.g),
                                   static_cast<double>(seen.b)};
    });
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_NEAR(rgb[k] / row.rgb[k], 1, 0.025)
          << row.turbidity << " " << row.albedo << " " << row.elevation << " " << row.theta << " " << row.phi;
  }
}

// Claim: below one degree of elevation, where nothing was measured, the sky is between those of the ends, and
// it is never negative nor without bound down to the horizon.
TEST(Sky, LowSunsAreTame) {
  for (int turbidity = 1; turbidity <= 10; ++turbidity)
    for (const double gamma : {0.5, 1.5, 2.5}) {
      const auto green = [&](double elevation, double cos_theta) {
        return SkyModel(turbidity, {0.1, 0.1, 0.1}, elevation * kToRadians).radiance(cos_theta, gamma).y;
      };
      const double low = green(0, 0.5), high = green(1, 0.5);
      EXPECT_NEAR(green(0.25, 0.5), 0.75 * low + 0.25 * high, 1e-9);
      EXPECT_LT(low, high);
      for (double elevation = 0; elevation <= 90; elevation += 0.5)
        for (const double cos_theta : {0.0, 0.005, 0.02, 0.04}) {
          const double near_horizon = green(elevation, cos_theta);
          EXPECT_GE(near_horizon, 0) << turbidity << " " << elevation;
          EXPECT_LT(near_horizon, 2 * green(elevation, 0.08)) << turbidity << " " << elevation;
        }
    }
}

// Claim: between whole turbidities, and between a black and a white ground, radiance is linear.
TEST(Sky, BlendsLinearly) {
  const double elevation = 0.6;
  for (const double gamma : {0.05, 0.7, 2.0}) {
    const auto green = [&](double turbidity, double albedo) {
      return SkyModel(turbidity, {albedo, albedo, albedo}, elevation).radiance(0.4, gamma).y;
    };
    EXPECT_NEAR(green(3.25, 0), 0.75 * green(3, 0) + 0.25 * green(4, 0), 1e-12);
    EXPECT_NEAR(green(10, 0.3), 0.7 * green(10, 0) + 0.3 * green(10, 1), 1e-12);
    EXPECT_GT(green(3, 1), green(3, 0));
  }
}

}  // namespace
}  // namespace candela::scene
