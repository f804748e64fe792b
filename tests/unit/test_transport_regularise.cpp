// Path-space regularization: which paths, which vertex, the kernel, the bandwidth, against the tables of the
// theory (regularisation.csv, regularisation-paths.csv).
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>
#include <map>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "common/rng/stream.h"
#include "tests/unit/shared_cases.h"
#include "worker/transport/regularise.h"

namespace candela::transport {
namespace {

using Row = std::map<std::string, std::string>;

std::vector<std::string> fields(const std::string& line) {
  std::vector<std::string> list;
  std::stringstream stream(line);
  for (std::string field; std::getline(stream, field, ',');) {
    if (field.ends_with('\r')) field.pop_back();
    list.push_back(field);
  }
  return list;
}

// Empty if the table is not installed.
std::vector<Row> table(const std::string& name) {
  std::ifstream file(test::shared_path() / "theory" / name);
  std::vector<Row> rows;
  std::string line;
  if (!std::getline(file, line)) return rows;
  const std::vector<std::string> header = fields(line);
  while (std::getline(file, line)) {
    const std::vector<std::string> values = fields(line);
    Row& row = rows.emplace_back();
    for (std::size_t i = 0; i < values.size(); ++i) row[header[i]] = values[i];
  }
  return rows;
}

std::vector<Letter> letters(const std::string& text) {
  std::vector<Letter> list;
  for (const char c : text) list.push_back(c == 'S' ? Letter::specular : Letter::diffuse);
  return list;
}

std::vector<std::uint32_t> numbers(const std::string& text) {
  std::vector<std::uint32_t> list;
  std::stringstream stream(text);
  for (std::uint32_t n = 0; stream >> n;) list.push_back(n);
  return list;
}

std::vector<std::uint32_t> cheapest(const std::vector<Letter>& string, std::uint32_t edges) {
  std::vector<std::uint32_t> list;
  const std::uint32_t least = least_cost(string, Connecting::bidirectional);
  for (std::uint32_t s = 1; s <= edges; ++s)
    if (cost(string, s) == least) list.push_back(s);
  return list;
}

// Claim: all 186 strings of up to five edges are mollified or not as the table says, for bidirectional path
// tracing and for path tracing, and by the candidates of the table.
TEST(Regularise, StringsAreThoseOfTheTable) {
  const std::vector<Row> rows = table("regularisation-paths.csv");
  if (rows.empty()) GTEST_SKIP() << "no regularisation-paths.csv in " << test::shared_path() / "theory";
  ASSERT_EQ(rows.size(), 186U);
  int mollified = 0, by_path = 0;
  for (const Row& row : rows) {
    const std::string& text = row.at("string");
    const std::vector<Letter> string = letters(text);
    const auto edges = static_cast<std::uint32_t>(std::stoul(row.at("edges_k")));
    const bool bdpt = mollify(string, Connecting::bidirectional);
    const bool path = mollify(string, Connecting::next_event);
    EXPECT_EQ(bdpt, row.at("bdpt_samplable") == "0") << text;
    EXPECT_EQ(path, row.at("pt_samplable") == "0") << text;
    mollified += bdpt ? 1 : 0;
    by_path += path ? 1 : 0;
    if (bdpt) {
      EXPECT_EQ(std::to_string(least_cost(string, Connecting::bidirectional)), row.at("min_S_letters"))
          << text;
      EXPECT_EQ(cheapest(string, edges), numbers(row.at("candidate_s"))) << text;
    }
    if (path) {
      EXPECT_EQ(std::to_string(least_cost(string, Connecting::next_event)), row.at("pt_min_S_letters"))
          << text;
    }
  }
  EXPECT_EQ(mollified, 19);
  EXPECT_EQ(by_path, 92);
}

// The subpaths of technique s, with the letters of the ends of its connection edge.
std::pair<SubpathString, SubpathString> subpaths(const std::vector<Letter>& string, std::uint32_t s,
                                                 const std::vector<double>& lengths) {
  const std::size_t last = string.size() - 1;
  SubpathString light(string[0], string[1]), eye(string[last], string[last - 1]);
  for (std::uint32_t i = 1; i < s; ++i) light.add(string[i + 1], lengths[i - 1]);
  for (auto i = static_cast<std::uint32_t>(lengths.size()); i > s; --i) eye.add(string[i], lengths[i - 1]);
  return {light, eye};
}

// Claim: techniques that see nothing but the letters and lengths of their own subpaths make the choice that
// is made of the whole string, of random lengths and of equal ones: one technique counts, and no other.
TEST(Regularise, SubpathsChooseAsTheWholeStringDoes) {
  rng::Stream random(rng::key(45, 1));
  for (std::uint32_t edges = 1; edges <= 7; ++edges) {
    for (std::uint32_t bits = 0; bits < 1U << (edges + 3); ++bits) {
      std::vector<Letter> string;
      for (std::uint32_t i = 0; i < edges + 3; ++i)
        string.push_back((bits >> i & 1) != 0 ? Letter::specular : Letter::diffuse);
      std::vector<double> lengths;
      const bool ties = random.next_float() < 0.3f;
      for (std::uint32_t i = 0; i < edges; ++i)
        lengths.push_back(ties ? 1 + std::floor(2 * random.next_double()) : 0.1 + random.next_double());
      const bool any =
          mollify(string, Connecting::bidirectional) && least_cost(string, Connecting::bidirectional) == 1;
      const std::uint32_t chosen = any ? choose(string, Connecting::bidirectional, lengths) : 0;
      EXPECT_EQ(chosen > 0, any);
      for (std::uint32_t s = 1; s <= edges; ++s) {
        const auto [light, eye] = subpaths(string, s, lengths);
        EXPECT_EQ(mollifies(light, eye, lengths[s - 1]), s == chosen)
            << "edges " << edges << ", letters " << bits << ", s " << s;
      }
    }
  }
}

// Claim: K / l^2 is that of the table.
TEST(Regularise, KernelIsThatOfTheTable) {
  const std::vector<Row> rows = table("regularisation.csv");
  if (rows.empty()) GTEST_SKIP() << "no regularisation.csv in " << test::shared_path() / "theory";
  ASSERT_EQ(rows.size(), 21U);
  for (const Row& row : rows) {
    const double l = std::stod(row.at("dist_mirror_light")),
                 expected = std::stod(row.at("mollifier_over_l2"));
    const Mollifier mollifier(std::stod(row.at("r")));
    EXPECT_NEAR(mollifier.value_over_length_squared(l * l) / expected, 1, 1e-13) << row.at("r");
  }
}

// Claim: the kernel integrates to one over its cone, and the cone has the half angle atan(r / l), for r / l
// from 1e-6 to 1; shorter edges than r count as edges of that length.
TEST(Regularise, KernelAndConeBelongTogether) {
  rng::Stream random(rng::key(45, 2));
  for (const double l : {1e-4, 1.0, 3e5}) {
    for (const double ratio : {1e-6, 1e-4, 1e-2, 0.3, 1.0, 1.5, 7.0}) {
      const double r = ratio * l;
      const Mollifier mollifier(r);
      const long double tangent = std::min(static_cast<long double>(ratio), 1.0L);
      // 1 - cos(atan t) = t^2 / (1 + t^2 + sqrt(1 + t^2))
      const long double t2 = tangent * tangent;
      const long double solid_angle = 2 * std::numbers::pi_v<long double> * t2 / (1 + t2 + std::sqrt(1 + t2));
      EXPECT_NEAR(static_cast<double>(mollifier.value(l * l) * solid_angle *
                                      (std::max(r, l) / static_cast<long double>(l)) *
                                      (std::max(r, l) / static_cast<long double>(l))),
                  1, 1e-12)
          << l << " " << ratio;
      for (int i = 0; i < 200; ++i) {
        const double share = 2 * random.next_double(), around = 2 * std::numbers::pi * random.next_double();
        const auto angle = static_cast<double>(std::atan(tangent)) * share;
        const Vec3d to =
            Vec3d(std::sin(angle) * std::cos(around), std::sin(angle) * std::sin(around), std::cos(angle)) *
            l;
        if (std::abs(share - 1) < 1e-7) continue;
        EXPECT_EQ(mollifier.inside({0, 0, 1}, to), share < 1) << l << " " << ratio << " " << share;
      }
      EXPECT_FALSE(mollifier.inside({0, 0, 1}, {0, 0, -l}));
    }
  }
}

// Claim: bandwidths follow the power law of the iteration's number in the job: the same bits whoever asks,
// and in whatever order.
TEST(Regularise, BandwidthIsAFunctionOfTheIndex) {
  EXPECT_EQ(bandwidth(0.25, 0, 1.0 / 6), 0.25);
  EXPECT_NEAR(bandwidth(0.25, 63, 1.0 / 6), 0.125, 1e-15);
  EXPECT_EQ(bandwidth(0.25, 1ULL << 40, 0), 0.25);
  EXPECT_NEAR(bandwidth(1, 728, 1.0 / 3) * 9, 1, 1e-12);
  std::vector<std::uint64_t> bits;
  for (std::uint64_t i = 0; i < 1000; ++i)
    bits.push_back(std::bit_cast<std::uint64_t>(bandwidth(0.3, i * i, 1.0 / 6)));
  for (std::uint64_t i = 1000; i-- > 0;)
    EXPECT_EQ(std::bit_cast<std::uint64_t>(bandwidth(0.3, i * i, 1.0 / 6)), bits[i]);
  EXPECT_TRUE(std::is_sorted(bits.rbegin(), bits.rend()));
}

}  // namespace
}  // namespace candela::transport
