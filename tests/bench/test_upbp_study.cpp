// The studies of upbp. upbp-nsd: its closed forms against another program's numbers, and simulation against
// its closed forms. Seeds are fixed.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "tests/bench/candela_study/nsd_axes.h"
#include "tests/bench/candela_study/study.h"

namespace candela::study {
namespace {

// Claim: the normalised standard deviations of estimators of every family are those of the table, of which
// numbers have four digits.
TEST(UpbpStudy, ClosedFormsAreThoseOfTheTable) {
  struct Known {
    const char* name;
    double fixed[4], uniform[4];  // at the widths .01, .1, 1, 4
  };
  constexpr double kWidths[] = {0.01, 0.1, 1, 4};
  constexpr Known kTable[] = {
      {"P-P3D", {1.478e4, 467.1, 14.14, 0.1941}, {4e4, 1265, 39.99, 4.899}},
      {"P-B3D[s]", {1477, 146.5, 12.93, 0.9594}, {3993, 393.4, 34.30, 6.060}},
      {"P-B3D[l]", {543.7, 54.35, 5.231, 0.1366}, {2824, 278.2, 24.24, 4.227}},
      {"P-B2D[s]", {1478, 147.7, 14.44, 2.555}, {4000, 400.0, 39.99, 9.950}},
      {"P-B2D[l]", {543.7, 54.35, 5.231, 0.1366}, {2828, 282.8, 28.27, 7.000}},
      {"B-P3D[l]", {543.7, 54.35, 5.231, 0.1366}, {2824, 278.2, 24.24, 4.227}},
      {"B-P2D[s]", {1478, 147.7, 14.44, 2.555}, {4000, 400.0, 39.99, 9.950}},
      {"B-B3D[ss]", {147.5, 45.92, 11.81, 1.598}, {398.7, 122.4, 29.41, 7.479}},
      {"B-B3D[ll]", {19.97, 6.245, 1.732, 0}, {199.3, 61.18, 14.68, 3.638}},
      {"B-B2Dlight[sl]", {54.31, 17.02, 4.766, 0.9409}, {282.4, 87.97, 24.24, 8.629}},
      {"B-B2Dlight[ls]", {54.36, 17.16, 5.344, 2.528}, {282.4, 87.97, 24.24, 8.629}},
      {"B-B2Deye[sl]", {54.36, 17.16, 5.344, 2.528}, {282.4, 87.97, 24.24, 8.629}},
      {"B-B2Deye[ll]", {19.97, 6.245, 1.732, 0}, {199.7, 62.20, 17.13, 6.060}},
      {"B-B1D[ss]", {147.8, 46.72, 14.74, 7.321}, {400.0, 126.5, 39.99, 19.97}},
      {"B-B1D[sl]", {54.36, 17.16, 5.344, 2.528}, {282.8, 89.44, 28.27, 14.11}},
      {"B-B1D[ll]", {19.97, 6.245, 1.732, 0}, {200.0, 63.24, 19.97, 9.950}},
  };
  std::map<std::string, NsdEstimator> named;
  for (const NsdEstimator& one : nsd_estimators()) named[one.name] = one;
  EXPECT_EQ(named.size(), 25U);
  for (const Known& known : kTable)
    for (int i = 0; i < 4; ++i) {
      const NsdEstimator& one = named.at(known.name);
      EXPECT_NEAR(nsd(one, {true, 2}, kWidths[i], 4), known.fixed[i], 6e-4 * known.fixed[i] + 1e-6)
          << known.name << ' ' << kWidths[i];
      EXPECT_NEAR(nsd(one, {false, 20}, kWidths[i], 4), known.uniform[i], 6e-4 * known.uniform[i])
          << known.name << ' ' << kWidths[i];
    }
}

// The rows of the short form.
const std::vector<Row>& short_rows() {
  static const std::vector<Row> rows = [] {
    Request request;
    request.short_form = true;
    return run_upbp_nsd(request).value().rows;
  }();
  return rows;
}

// Claim: slopes and crossovers are the known ones: a slope counts the points among the two sides.
TEST(UpbpStudy, SlopesAndCrossoversAreTheKnownOnes) {
  const std::map<std::string, double> widths = {{"fixed short beam", 0.96242365},
                                                {"fixed blurred short beam", 1.25643121},
                                                {"uniform short beam", 1},
                                                {"uniform long beam", 2},
                                                {"uniform blurred short beam", 1.59362426}};
  std::size_t crossovers = 0, slopes = 0;
  for (const Row& row : short_rows()) {
    if (row.part == "crossovers") {
      ++crossovers;
      const auto known = widths.find(row.problem + ' ' + row.method);
      ASSERT_NE(known, widths.end()) << row.problem << ' ' << row.method;
      EXPECT_NEAR(row.value, known->second, 1e-7) << row.problem << ' ' << row.method;
    } else if (row.part == "slopes") {
      ++slopes;
      const int points = row.method == "P-P3D" ? 2 : row.method.starts_with("B-B") ? 0 : 1;
      EXPECT_NEAR(row.value, -(1 + points) / 2.0, 2e-4) << row.method;
    }
  }
  EXPECT_EQ(crossovers, widths.size());
  EXPECT_EQ(slopes, 25U);
}

// Claim: means of samples are the exact ones, and the four estimators of upbp at 30 degrees have the
// expectations of Bessel functions that are known: some 170 values at 5.5 standard errors. Normal, one of
// them alarms with the chance 3e-6; the rarest hits are not normal, and are left out below 200 of them.
TEST(UpbpStudy, SamplesHaveTheExactMeans) {
  const std::map<std::string, double> known = {
      {"P-P3D 0.4", 0.062739292},     {"P-P3D 0.2", 0.052824101},    {"P-P3D 0.1", 0.050534273},
      {"P-B2D[l] 0.4", 0.065005233},  {"B-P2D[s] 0.2", 0.053335718}, {"P-B2D[s] 0.1", 0.050658919},
      {"B-B1D[ss] 0.1", 0.049787068}, {"B-B1D[ll] 0.4", 0.049787068}};
  std::map<std::string, double> expectations;
  int compared = 0, looked_up = 0;
  for (const Row& row : short_rows()) {
    const std::string key = row.method + ' ' + std::to_string(row.n).substr(0, 3);
    if (row.quantity == "expectation") {
      expectations[key] = row.value;
      if (const auto found = known.find(key); found != known.end()) {
        EXPECT_NEAR(row.value, found->second, 1e-8) << key;
        ++looked_up;
      }
    }
    if (row.quantity == "mean" && row.standard_error < 0.07 * row.value) {
      EXPECT_LT(std::abs(row.value - expectations.at(key)), 5.5 * row.standard_error) << key;
      ++compared;
    }
    if (row.quantity == "mean over the exact one" && row.standard_error < 0.07) {
      EXPECT_LE(std::abs(row.value - 1), 5.5 * row.standard_error + 1e-6) << row.part << ' ' << key;
      ++compared;
    }
  }
  EXPECT_EQ(looked_up, 8);
  EXPECT_GT(compared, 70);
}

// Claim: in fog around a caustic all techniques together have less than half the error of points or beams of
// light paths alone in equal time, every error is that of noise and bias, and an unknown scene is an error.
TEST(UpbpStudy, ScenesInShort) {
  Request request;
  request.short_form = true;
  request.seeds = 2;
  request.scenes = {"caustic"};
  const auto results = run_upbp_scenes(request);
  ASSERT_TRUE(results.ok()) << results.error().to_string();
  std::map<std::string, double> at_equal_time, parts;
  for (const Row& row : results->rows) {
    if (row.part == "equal time" && row.quantity == "relative squared error")
      at_equal_time[row.method] = row.value;
    const std::string key = row.method + ' ' + std::to_string(row.n);
    if (row.part == "curves" && row.quantity == "relative squared error") parts[key] += row.value;
    if (row.part == "curves" && (row.quantity == "noise" || row.quantity == "bias")) parts[key] -= row.value;
  }
  EXPECT_EQ(at_equal_time.size(), 13U);
  for (const char* alone : {"pp3d", "pb2d", "bp2d"})
    EXPECT_LT(at_equal_time["all"], 0.5 * at_equal_time[alone]) << alone;
  EXPECT_EQ(parts.size(), 26U);
  for (const auto& [key, rest] : parts) EXPECT_NEAR(rest, 0, 1e-9) << key;
  EXPECT_EQ(results->maps.size(), 20U) << "the reference, methods, and six layers";
  double shares = 0;
  for (const Row& row : results->rows)
    if (row.part == "layers") shares += row.value;
  EXPECT_GT(shares, 0.5);
  EXPECT_LE(shares, 1 + 1e-5) << "the rest is light met by chance";
  request.scenes = {"nowhere"};
  EXPECT_NE(run_upbp_scenes(request).error().to_string().find("some of caustic, mist"), std::string::npos);
}

}  // namespace
}  // namespace candela::study
