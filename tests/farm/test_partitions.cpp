// Layers of a partition in every integrator on a farm of real processes, by the integers of the master's
// film: developed images are rounded.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/files.h"
#include "common/chains/chains.h"
#include "common/film/codec.h"
#include "common/film/merged_film.h"
#include "tests/farm/farm.h"
#include "tests/integrators.h"

namespace candela::farm {
namespace {

// A partition of all paths, by the surface next to the eye and by their length.
const std::vector<std::string> kPartition = {"--layer",    "seen=LE",
                                             "--layer",    "red=L[DGSV]*X{red}E",
                                             "--layer",    "green=L[DGSV]*X{green}E",
                                             "--layer",    "direct=L[^X{red}X{green}]E",
                                             "--layer",    "bounces=L[DGSV]+[^X{red}X{green}]E",
                                             "--partition"};
constexpr std::uint32_t kParts = 5;

// The film within a checkpoint, whose forms master/merge/checkpoint.h tells.
std::string_view film_within(std::string_view bytes) {
  const auto u64 = [&](std::size_t at) { return film::Reader(bytes.substr(at)).u64(); };
  for (const std::string_view end : {"CANHIST1", "CANMOVES"})
    if (bytes.ends_with(end)) bytes.remove_suffix(24 + u64(bytes.size() - 24));
  while (bytes.starts_with("CANSUMS") || bytes.starts_with("CANCHNS")) bytes = bytes.substr(16, u64(8));
  return bytes;
}

std::optional<film::MergedFilm> film_of(Farm& farm, const std::string& id) {
  const v1::JobStatus status = farm.job(id);
  const auto bytes = read_file(
      farm.folder() / "data" / "jobs" / id / fmt::format("film.{}.ckpt", status.checkpoint_generation()),
      1 << 28);
  EXPECT_TRUE(bytes.ok());
  if (!bytes.ok()) return std::nullopt;
  auto film = film::MergedFilm::parse(film_within(*bytes));
  EXPECT_TRUE(film.ok()) << film.error().to_string();
  if (!film.ok()) return std::nullopt;
  return *std::move(film);
}

// Sums of some layers of both halves, from number `first` on.
std::vector<film::Int128> sums_of(const film::MergedFilm& film, std::uint32_t first, std::uint32_t count) {
  std::vector<film::Int128> sums;
  for (std::uint32_t half = 0; half < 2; ++half)
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x)
        for (int c = 0; c < 3; ++c) {
          film::Int128 sum = 0;
          for (std::uint32_t layer = first; layer < first + count; ++layer)
            sum += film.sum(half, layer, x, y, c);
          sums.push_back(sum);
        }
  return sums;
}

class Partitions : public testing::TestWithParam<std::string> {
 protected:
  static std::vector<std::string> options() {
    const std::string& integrator = GetParam();
    std::vector<std::string> words = {"--integrator", integrator};
    // In a box of matt walls a plan merges nothing beside connections.
    if (test::merges(integrator)) words.insert(words.end(), {"--set", "plan=full"});
    // Layers take the place of optimal weights.
    if (integrator == "optimis") words.insert(words.end(), {"--set", "weights=balance"});
    return words;
  }
  static std::uint64_t iterations() {
    return static_cast<std::uint64_t>(600 * test::integrator_row(GetParam()).farm_share) | 1;
  }
  std::string submit(const std::vector<std::string>& more) {
    std::vector<std::string> words = options();
    words.insert(words.end(), more.begin(), more.end());
    return farm_.submit(iterations(), "cornell", words);
  }
  film::MergedFilm finished(const std::string& id) {
    farm_.wait_for(id, v1::JOB_STATE_DONE);
    farm_.audit(id, iterations());
    auto film = film_of(farm_, id);
    if (!film) throw std::runtime_error("no film of " + id);
    return *std::move(film);
  }

  Farm farm_;
};

// Claim: the layers of a partition add up to the image, integer by integer, in every integrator; the image is
// that of a job without layers; and all layers are the same by one worker, by three, and by
// three of which one is killed in the midst of a unit.
TEST_P(Partitions, AddUpToTheImageWhateverDies) {
  if (!long_form()) GTEST_SKIP() << "only with CANDELA_LONG=1";
  farm_.start_master({"--unit-time", "0.1", "--checkpoint-interval", "0.2", "--lease-time", "2"});
  Process& victim = farm_.start_worker("victim");
  const film::MergedFilm one = finished(submit(kPartition));
  const film::MergedFilm plain = finished(submit({}));
  farm_.start_worker("second");
  farm_.start_worker("third");
  const film::MergedFilm three = finished(submit(kPartition));
  const std::string id = submit(kPartition);
  farm_.wait_for_iterations(id, 1);
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] { return farm_.worker("victim").jobs_size() > 0; }));
  victim.kill();
  ASSERT_EQ(farm_.job(id).state(), v1::JOB_STATE_RUNNING)
      << "the job ended before the worker was killed: make it longer";
  const film::MergedFilm killed = finished(id);

  const std::uint32_t images = test::has_chains(GetParam()) ? chains::kImageLayers : 1;
  ASSERT_EQ(plain.layout().layers, images);
  ASSERT_EQ(one.layout().layers, images * (1 + kParts));
  EXPECT_TRUE(three.serialise() == one.serialise()) << "three workers leave a trace";
  EXPECT_TRUE(killed.serialise() == one.serialise()) << "a death leaves a trace";
  std::array<std::size_t, kParts> lit{};
  for (std::uint32_t image = 0; image < images; ++image) {
    const auto sums = sums_of(one, image, 1);
    EXPECT_TRUE(sums == sums_of(plain, image, 1)) << "the image is another one with layers, " << image;
    EXPECT_TRUE(sums == sums_of(one, images + image * kParts, kParts)) << "the sum, layer " << image;
    for (std::uint32_t part = 0; part < kParts; ++part)
      for (const film::Int128& sum : sums_of(one, images + image * kParts + part, 1))
        lit[part] += sum != 0 ? 1 : 0;
  }
  for (std::uint32_t part = 0; part < kParts; ++part)
    EXPECT_GT(lit[part], 20u) << kPartition[2 * part + 1] << " is dark";
}

INSTANTIATE_TEST_SUITE_P(, Partitions, testing::ValuesIn(test::all_integrators()),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace candela::farm
