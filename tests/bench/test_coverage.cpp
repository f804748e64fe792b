// The short form of `candela-bench coverage`: whether the upper end of the shown error covers the truth.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdio>
#include <filesystem>
#include <sstream>

#include "common/base/files.h"
#include "tests/bench/candela_bench/coverage.h"
#include "tests/temporary_folder.h"

namespace candela::bench {
namespace {

// Claim: of the images of 16 to 64 samples a pixel of three scenes by one integrator of each kind (36 of
// them; seeds are fixed) all but one at most are covered; dividing by
// the noisy image itself covers at most 24. The second call reads what the first rendered.
TEST(Coverage, ShortForm) {
  const test::TemporaryFolder folder;
  CoverageOptions options;
  options.out = folder.path();
  options.scenes = {"box-diffuse", "furnace", "caustic"};
  options.integrators = {"path", "bdpt", "ppm", "pssmlt"};
  options.last_spp = 64;
  options.side = 16;
  options.reference_spp = 1024;
  const std::atomic<bool> stop = false;
  const auto table = coverage(options, stop, [](const std::string&) {});
  ASSERT_TRUE(table.ok()) << table.error().to_string();
  EXPECT_NE(table->find("| ppm |"), std::string::npos) << *table;
  const auto rows = read_file(std::filesystem::path(options.out) / "rows.csv", 1 << 20);
  ASSERT_TRUE(rows.ok());
  std::istringstream lines(*rows);
  int images = 0, missed = 0, missed_by_own = 0;
  std::string line;
  std::getline(lines, line);
  EXPECT_TRUE(line.starts_with("scene,integrator,held_out,seed,spp,truth,reference,relmse,upper,")) << line;
  while (std::getline(lines, line)) {
    std::vector<std::string> cells;
    std::istringstream row(line);
    for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
    if (std::stoi(cells.at(4)) < 16) continue;
    ++images;
    missed_by_own += std::stod(cells.at(5)) > std::stod(cells.at(11)) ? 1 : 0;
    if (std::stod(cells.at(5)) > std::stod(cells.at(8))) {
      ++missed;
      std::printf("not covered: %s\n", line.c_str());
    }
  }
  EXPECT_EQ(images, 36);
  EXPECT_LE(missed, 1) << *table;
  EXPECT_GE(missed_by_own, 12) << "or the line above proves little";

  const auto case_file = std::filesystem::path(options.out) / "caustic-bdpt-16-1-64.halves";
  const auto written = std::filesystem::last_write_time(case_file);
  const auto again = coverage(options, stop, [](const std::string&) {});
  ASSERT_TRUE(again.ok());
  EXPECT_EQ(*again, *table);
  EXPECT_EQ(std::filesystem::last_write_time(case_file), written);
}

// Claim: a row's truth is relMSE beside the reference, whose own noise is not in it; an image is covered if
// its truth is at most the upper end; rows whose reference is as noisy as they are do not count.
TEST(Coverage, RowsAreTold) {
  CoverageScene scene;
  scene.name = "flat";
  CoveragePoint point;
  point.spp = 4;
  stats::HalfImages& h = point.halves;
  h.width = h.height = 8;
  h.n0 = h.n1 = 2;
  for (int i = 0; i < 64 * 3; ++i) {
    h.a.push_back(i % 2 == 0 ? 1.2F : 1);
    h.b.push_back(i % 2 == 0 ? 1 : 1.2F);
  }
  const std::vector<float> exact(64 * 3, 1.1F);
  const auto rows = coverage_rows(scene, "path", 1, {point}, exact, exact);
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_NEAR(rows[0].truth, 0, 1e-12);
  EXPECT_NEAR(rows[0].by_own_image, 0.01 / (1.1 * 1.1 * 1.01), 1e-6);
  EXPECT_TRUE(rows[0].covered());
  std::vector<float> low(64 * 3, 0.9F), high(64 * 3, 1.1F);
  const auto noisy = coverage_rows(scene, "path", 1, {point}, low, high);
  EXPECT_FALSE(noisy[0].known());
  CoverageRow row{.scene = "a", .integrator = "path"};
  row.spp = 64;
  row.truth = 2;
  row.upper = 1;
  row.relmse = 1;
  EXPECT_NE(coverage_table({row}).find("0.0 % of 1 | 0.50 | 0.50"), std::string::npos)
      << coverage_table({row});
}

}  // namespace
}  // namespace candela::bench
