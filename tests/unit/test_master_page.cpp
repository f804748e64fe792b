// Content of the page: the record of convergence, pictures in tiles, and the priority it can change.
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "common/wire/json.h"
#include "master/api/messages.h"
#include "master/http/page_json.h"
#include "master/http/pictures.h"
#include "master/http/refresh_budget.h"
#include "master/jobs/convergence.h"
#include "tests/temporary_folder.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

// Claim: what was appended is read in order, errors to the last bit: a master that starts again shows the
// upper end that it showed before. A line that a crash cut is passed over, and iterations that were lost and
// rendered again count once, by their newer estimates.
TEST(ConvergenceFile, CutLinesAndLostIterationsArePassedOver) {
  const test::TemporaryFolder folder;
  const std::filesystem::path job = folder.path() / "j1";
  EXPECT_TRUE(read_convergence(job).empty());
  append_convergence(job, {2, 1, 0.1 / 3, 0.2 / 3});
  append_convergence(job, {4, 2, std::nan("")});
  append_convergence(job, {8, 3, 0.125});
  append_convergence(job, {16, 4, 0.06});
  // As older masters wrote it, without the upper end.
  std::ofstream(job / "convergence.txt", std::ios::app) << "8 9 0.25\nnonsense\n32 10 0.0";
  const std::vector<ConvergencePoint> points = read_convergence(job);
  ASSERT_EQ(points.size(), 2U);
  EXPECT_EQ(points[0].iterations, 2U);
  EXPECT_EQ(points[1].iterations, 8U);
  EXPECT_EQ(points[1].elapsed_seconds, 9);
  EXPECT_EQ(points[1].relmse, 0.25);
  EXPECT_EQ(points[0].relmse, 0.1 / 3);
  EXPECT_EQ(points[0].relmse_upper, 0.2 / 3);
  EXPECT_TRUE(std::isnan(points[1].relmse_upper));
}

// Claim: a refresh waits until its share of a core has paid for it, never less than the pause; a list of a
// thousand lines on a busy machine, which would wait for a minute, is behind by the longest pause.
TEST(RefreshBudget, ListsAreBehindByABoundedTime) {
  RefreshBudget budget;
  EXPECT_TRUE(budget.due(0));
  budget.spent(100, 0.01, 1, 0.002);
  EXPECT_FALSE(budget.due(104.9));
  EXPECT_TRUE(budget.due(105));
  budget.spent(200, 0.0001, 1, 0.002);
  EXPECT_FALSE(budget.due(200.9));
  EXPECT_TRUE(budget.due(201));
  budget.spent(300, 0.12, 1, 0.002);
  EXPECT_FALSE(budget.due(359)) << "no longest pause was given";
  budget.spent(400, 0.12, 1, 0.002, 10);
  EXPECT_FALSE(budget.due(409.9));
  EXPECT_TRUE(budget.due(410));
  budget.reset();
  EXPECT_TRUE(budget.due(400));
}

// Claim: a tile gives values back within 1/256 of the pixel's largest, over 60 orders of magnitude; what is
// not positive is 0; tiles at the edge are cut; a tile that is not there has no bytes; equal ones are named
// alike.
TEST(PageTiles, AreNearTheFloats) {
  constexpr std::uint32_t kWidth = 300, kHeight = 7;
  std::vector<float> rgb;
  for (std::uint32_t i = 0; i < kWidth * kHeight; ++i) {
    const float v = std::pow(10.0F, static_cast<float>(i % 61) - 30);
    rgb.insert(rgb.end(), {v, -v, 0.3F * v});
  }
  Picture picture(kWidth, kHeight, rgb, {.iterations = 1});
  ASSERT_EQ(picture.levels().size(), 2U);
  EXPECT_EQ(picture.levels()[1].width, 150U);
  EXPECT_EQ(picture.levels()[1].height, 4U);
  const Picture::Tile tile = picture.tile(0, 1, 0, TileForm::rgbe);
  ASSERT_TRUE(tile.bytes);
  ASSERT_EQ(tile.bytes->size(), 4U * (kWidth - kPageTile) * kHeight);
  for (std::size_t i = 0; i < tile.bytes->size() / 4; ++i) {
    const auto byte = [&](std::size_t c) { return static_cast<unsigned char>((*tile.bytes)[4 * i + c]); };
    const std::size_t x = kPageTile + i % (kWidth - kPageTile), y = i / (kWidth - kPageTile);
    const double largest = rgb[3 * (y * kWidth + x)];
    for (std::size_t c = 0; c < 3; ++c) {
      const double wanted = std::max(0.0, double{rgb[3 * (y * kWidth + x) + c]});
      EXPECT_NEAR(std::ldexp(byte(c), byte(3) - 136), wanted, largest / 128) << x << ' ' << y << ' ' << c;
    }
  }
  EXPECT_FALSE(picture.tile(0, 2, 0, TileForm::rgbe).bytes);
  EXPECT_FALSE(picture.tile(2, 0, 0, TileForm::rgbe).bytes);
  EXPECT_EQ(Picture(kWidth, kHeight, rgb, {}).tile(0, 1, 0, TileForm::rgbe).etag, tile.etag);
  rgb[3 * kPageTile] *= 2;
  EXPECT_NE(Picture(kWidth, kHeight, rgb, {}).tile(0, 1, 0, TileForm::rgbe).etag, tile.etag);
}

double value_of_half(std::uint16_t half) {
  const int exponent = half >> 10 & 31, mantissa = half & 1023;
  const double size = exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25);
  return (half & 0x8000) != 0 ? -size : size;
}

std::vector<double> halves_in(const Picture::Tile& tile) {
  std::vector<double> out;
  for (std::size_t i = 0; tile.bytes && i + 1 < tile.bytes->size(); i += 2)
    out.push_back(
        value_of_half(static_cast<std::uint16_t>(static_cast<unsigned char>((*tile.bytes)[i]) |
                                                 static_cast<unsigned char>((*tile.bytes)[i + 1]) << 8)));
  return out;
}

// Claim: a half is the nearest one of those there are, with its sign; what is beyond the largest is the
// largest.
TEST(PageTiles, HalvesAreTheNearest) {
  for (std::uint32_t half = 0; half < 0x7c00; ++half) {
    const auto value = static_cast<float>(value_of_half(static_cast<std::uint16_t>(half)));
    ASSERT_EQ(half_of(value), half);
    ASSERT_EQ(half_of(std::nextafter(value, 1e9F)), half == 0x7bff ? 0x7bff : half);
    if (half > 0) {
      ASSERT_EQ(half_of(-value), half | 0x8000);
    }
  }
  EXPECT_EQ(value_of_half(half_of(2049)), 2048) << "ties to even";
  EXPECT_EQ(value_of_half(half_of(2051)), 2052);
  EXPECT_EQ(value_of_half(half_of(1e30F)), 65504);
  EXPECT_EQ(value_of_half(half_of(-INFINITY)), -65504);
}

// Claim: a tile of halves keeps signs and dim channels; the tile of a mix has its layers one after another,
// and a mix of many large layers begins at a coarser level, whose memory is what was said.
TEST(PageTiles, OfLayersAreHalves) {
  Picture layer(2, 1, {1, -2, 0.001F, 4, 5, 6}, {});
  const std::vector<double> values = halves_in(layer.tile(0, 0, 0, TileForm::half));
  ASSERT_EQ(values.size(), 6U);
  EXPECT_EQ(values[1], -2);
  EXPECT_NEAR(values[2], 0.001, 1e-6);
  const Picture::Facts two{.partition = {"a", "b"}};
  Picture mix(300, 2, two, [](std::size_t i) { return std::vector<float>(1800, static_cast<float>(i + 1)); });
  EXPECT_EQ(mix.first(), 0U);
  const std::vector<double> tile = halves_in(mix.tile(0, 1, 0, TileForm::half));
  ASSERT_EQ(tile.size(), 2U * 3 * 44 * 2);
  EXPECT_EQ(tile.front(), 1);
  EXPECT_EQ(tile.back(), 2);
  EXPECT_EQ(halves_in(mix.tile(1, 0, 0, TileForm::half)).back(), 2);
  const Picture::Facts many{.partition = std::vector<std::string>(50, "x")};
  Picture coarse(1000, 500, many, [](std::size_t) { return std::vector<float>(1'500'000, 3.0F); });
  EXPECT_EQ(coarse.first(), 1U);
  EXPECT_FALSE(coarse.tile(0, 0, 0, TileForm::half).bytes);
  EXPECT_EQ(halves_in(coarse.tile(1, 1, 0, TileForm::half)).back(), 3);
  EXPECT_LT(Picture::mix_memory_bytes(1000, 500, 50), 120U << 20);
}

// Claim: a job whose priority is raised gets the next lease, and the store and an event are told; a job that
// has ended and a priority beyond the limits of a submission are refused, and nothing changes.
TEST_F(SchedulerFixture, RaisedPriorityGetsTheNextLease) {
  worker("w");
  s->submit(row("a", 100), now());
  s->submit(row("b", 100), now());
  ASSERT_TRUE(s->set_priority("b", 3, now()).ok());
  s->take_changes();
  EXPECT_EQ(lease("w")->row.job_id, "b");
  ASSERT_TRUE(s->set_priority("a", 4, now()).ok());
  bool stored = false, told = false;
  for (const Change& change : s->take_changes()) {
    if (const auto* job = std::get_if<PutJob>(&change)) stored = stored || job->row.priority == 4;
    if (const auto* event = std::get_if<AddEvent>(&change)) told = told || event->row.kind == "priority";
  }
  EXPECT_TRUE(stored && told);
  EXPECT_EQ(lease("w")->row.job_id, "a");
  EXPECT_FALSE(s->set_priority("a", 1000001, now()).ok());
  EXPECT_EQ(s->job("a")->row.priority, 4);
  ASSERT_TRUE(s->cancel("a", now()).ok());
  EXPECT_FALSE(s->set_priority("a", 5, now()).ok());
}

// Each field of a line is one of the page, with its value; seconds are whole. Three are of the list alone.
void expect_part(const nlohmann::json& line, const nlohmann::json& page) {
  for (const auto& [name, value] : line.items()) {
    if (name == "workers" || name == "turn" || name == "thumbnail") continue;
    ASSERT_TRUE(page.contains(name)) << name;
    if (value.is_object())
      expect_part(value, page.at(name));
    else if (name == "elapsed_seconds" || name == "eta_seconds")
      EXPECT_EQ(value.is_null(), page.at(name).is_null()) << name;
    else
      EXPECT_EQ(value, page.at(name)) << name;
  }
}

// Claim: a line of a list says what the page of the job or worker says, under the same names, before anything
// is merged and after.
TEST_F(SchedulerFixture, LinesSayWhatPagesSay) {
  const auto job_line = [&] {
    const Job& job = *s->job("j");
    expect_part(nlohmann::json::parse(job_line_json(*s, job, now())),
                nlohmann::json::parse(wire::page_json(to_message(status_of(*s, job, now())))));
  };
  const auto worker_line = [&] {
    const WorkerState& w = s->workers().at("w");
    const auto line = nlohmann::json::parse(worker_line_json(*s, w, now()));
    expect_part(line, nlohmann::json::parse(wire::page_json(to_message(status_of(*s, w, now())))));
  };
  worker("w");
  JobRow r = row("j", 100);
  r.name = "a <b>\u202e";
  r.share = 1.5;
  r.priority = -3;
  r.stop.time_seconds = 60;
  r.settings.integrator = "vcm";
  r.named_state = NamedState{20};
  r.thread_seconds_per_iteration = 1;
  s->restore(r, {}, {}, {}, {}, now());  // as after a pilot
  job_line();
  for (int i = 0; i < 3; ++i) {
    const auto l = lease("w");
    ASSERT_TRUE(l);
    EXPECT_EQ(deliver(*l, unit_of(*l), {}, 1), Delivery::ok);
    at(clock + 1);
  }
  job_line();
  worker_line();
}

}  // namespace
}  // namespace candela::master
