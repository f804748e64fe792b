// Parts of the instrument: lists, rendering in processes, references, figures. Statistical tests state
// their false-alarm rate; seeds are fixed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "common/base/files.h"
#include "common/bundle/gather.h"
#include "common/image/image.h"
#include "common/stages/development.h"
#include "tests/bench/candela_bench/process.h"
#include "tests/bench/candela_bench/truth.h"
#include "tests/bench/known_estimator.h"
#include "tests/paths.h"
#include "tests/temporary_folder.h"
#include "worker/render/renderer.h"

namespace candela::bench {
namespace {

using testing::HasSubstr;

// --- lists ---

std::string error_of_list(const std::string& text) {
  const test::TemporaryFolder folder;
  const std::string file = (folder.path() / "list.toml").string();
  std::ofstream(file) << text;
  RunOptions options;
  options.list = file;
  const auto work = prepare(options);
  return work.ok() ? "" : work.error().to_string();
}

TEST(Lists, BadOnesHaveOneClearError) {
  EXPECT_THAT(error_of_list("iterations = "), HasSubstr("list.toml:1"));
  EXPECT_THAT(error_of_list("iterations = 4\niteratoins = 4\n"), HasSubstr(":2: unknown key 'iteratoins'"));
  EXPECT_THAT(error_of_list("iterations = 4\n"), HasSubstr("no [[scene]]"));
  EXPECT_THAT(error_of_list("iterations = \"many\"\n"), HasSubstr(":1: 'iterations' cannot be this"));
  EXPECT_THAT(error_of_list("[[scene]]\nfile = \"a\"\n"), HasSubstr("'reference' is missing"));
  EXPECT_THAT(error_of_list("[[scene]]\nfile = \"a\"\nreference = \"b\"\n[[run]]\nintegrator = \"path\"\n"),
              HasSubstr("either --iterations or --time"));
  EXPECT_THAT(error_of_list("time = 1\n[[scene]]\nfile = \"a\"\nreference = \"no.exr\"\n"
                            "[[run]]\nintegrator = \"path\"\n"),
              HasSubstr("no.exr"));
}

TEST(Lists, MakeRunsOfAllCombinations) {
  const test::TemporaryFolder folder;
  const std::vector<float> black(16 * 8 * 3);
  const auto exr = image::encode_exr(16, 8, black, {});
  ASSERT_TRUE(exr.ok());
  ASSERT_TRUE(write_file_atomically(folder.path() / "truth.exr", *exr).ok());
  std::ofstream(folder.path() / "list.toml")
      << "iterations = 4\nseeds = [3, 4]\n[[scene]]\nreference = \"truth.exr\"\nfile = \"" << kScene
      << "\"\n[[run]]\nintegrator = \"path\"\n[[run]]\nintegrator = \"path\"\nname = \"short\"\n"
         "set = { max_depth = 2 }\n";
  RunOptions options;
  options.list = (folder.path() / "list.toml").string();
  const auto work = prepare(options);
  ASSERT_TRUE(work.ok()) << work.error().to_string();
  ASSERT_EQ(work->runs.size(), 4U);
  for (const RunSpec& run : work->runs) {
    EXPECT_EQ(run.scene, "cornell");
    EXPECT_EQ(run.job.width, 16U);
    const auto back = RunSpec::from_json(run.to_json());
    ASSERT_TRUE(back.ok());
    EXPECT_EQ(back->id(), run.id());
  }
  EXPECT_EQ(work->runs[1].job.integrator_settings.at("max_depth"), "2");
  EXPECT_EQ(command_of(work->runs[1], 4, true).substr(0, 21), "candela-bench run --s");
  EXPECT_THAT(command_of(work->runs[1], 4, true), HasSubstr("--set max_depth=2 --seed 3 --iterations 4"));

  // The row's command leads to the same run.
  RunOptions command;
  command.scenes = {work->runs[1].scene_file};
  command.reference = work->runs[1].reference;
  command.integrators = {"path"};
  command.sets = {"max_depth=2"};
  command.seeds = {3};
  command.iterations = 4;
  const auto single = prepare(command);
  ASSERT_TRUE(single.ok()) << single.error().to_string();
  EXPECT_EQ(single->runs[0].job.integrator_settings, work->runs[1].job.integrator_settings);
  EXPECT_EQ(single->runs[0].scene_hash, work->runs[1].scene_hash);
}

// A list of one scene, and two variants of which one has a comma in its name.
RunOptions small_list(const fs::path& folder, const std::string& more = "") {
  const auto exr = image::encode_exr(16, 8, std::vector<float>(16 * 8 * 3, 1), {});
  if (!exr.ok() || !write_file_atomically(folder / "truth.exr", *exr).ok())
    throw std::runtime_error("no reference");
  std::ofstream(folder / "list.toml")
      << "iterations = 4\n[[scene]]\nreference = \"truth.exr\"\nfile = \"" << kScene
      << "\"\n[[run]]\nintegrator = \"path\"\n[[run]]\nintegrator = \"bdpt\"\n"
         "name = \"bdpt, short\"\nset = { max_depth = 2 }\n"
      << more;
  RunOptions options;
  options.list = (folder / "list.toml").string();
  return options;
}

TEST(Lists, NamesWithCommasAndSeveralInOneWord) {
  const test::TemporaryFolder folder;
  RunOptions options = small_list(folder.path());
  const auto chosen = [&](std::vector<std::string> names) {
    options.integrators = std::move(names);
    const auto work = prepare(options);
    return work.ok() ? work->runs.size() : 0;
  };
  EXPECT_EQ(chosen({"bdpt, short"}), 1U);
  EXPECT_EQ(chosen({"path,bdpt"}), 2U);
  EXPECT_EQ(chosen({"path", "bdpt, short"}), 2U);
  EXPECT_EQ(chosen({"path,vcm"}), 0U);
  EXPECT_EQ(chosen({""}), 0U);

  // Without a list, where a path may have one.
  fs::create_directories(folder.path() / "a,b");
  fs::copy_file(kScene, folder.path() / "a,b" / "scene.xml");
  RunOptions one;
  one.scenes = {(folder.path() / "a,b" / "scene.xml").string()};
  one.reference = (folder.path() / "truth.exr").string();
  one.integrators = {"path,light"};
  one.iterations = 4;
  const auto work = prepare(one);
  ASSERT_TRUE(work.ok()) << work.error().to_string();
  EXPECT_EQ(work->runs.size(), 2U);
  EXPECT_EQ(work->runs[0].scene, "a,b");
}

TEST(Lists, NamesThatFilesCannotTellApart) {
  const test::TemporaryFolder folder;
  const auto error_with = [&](const std::string& more) {
    const auto work = prepare(small_list(folder.path(), more));
    return work.ok() ? "" : work.error().to_string();
  };
  const std::string another = "[[scene]]\nreference = \"truth.exr\"\nfile = \"" + kScene + "\"\nname = ";
  EXPECT_EQ(error_with(another + "\"b\"\n"), "");
  EXPECT_THAT(error_with(another + "\"cornell\"\n"), HasSubstr("one in names of files"));
  EXPECT_THAT(error_with(another + "\"a b\"\n" + another + "\"a_b\"\n"), HasSubstr("one in names of files"));
  EXPECT_THAT(error_with(another + "\"\"\n"), HasSubstr("a name is empty"));
  EXPECT_EQ(file_name_of("../a-b \xc3\xa9"), ".._a-b___");
}

// Mistakes of a reference are said before anything is rendered.
TEST(Lists, ReferencesAreReadAtOnce) {
  const test::TemporaryFolder folder;
  RunOptions options = small_list(folder.path());
  const auto first = prepare(options);
  ASSERT_TRUE(first.ok()) << first.error().to_string();
  std::vector<float> rgb(16 * 8 * 3, 1);
  const auto replace = [&](const char* name, float value) {
    rgb[7] = value;
    const auto exr = image::encode_exr(16, 8, rgb, {});
    ASSERT_TRUE(exr.ok() && write_file_atomically(folder.path() / name, *exr).ok());
  };
  // Its content is part of what a run is.
  replace("truth.exr", 2);
  const auto other = prepare(options);
  ASSERT_TRUE(other.ok());
  EXPECT_NE(other->runs[0].id(), first->runs[0].id());
  replace("truth.stderr.exr", 0.5F);
  const auto with_error = prepare(options);
  ASSERT_TRUE(with_error.ok());
  EXPECT_NE(with_error->runs[0].id(), other->runs[0].id());

  replace("truth.stderr.exr", -1);
  const auto negative = prepare(options);
  ASSERT_FALSE(negative.ok());
  EXPECT_THAT(negative.error().to_string(), HasSubstr("truth.stderr.exr"));
  replace("truth.exr", std::numeric_limits<float>::quiet_NaN());
  EXPECT_FALSE(prepare(options).ok());
  fs::rename(folder.path() / "truth.exr", folder.path() / "truth.png");
  std::ofstream(folder.path() / "list.toml")
      << "iterations = 4\n[[scene]]\nreference = \"truth.png\"\nfile = \"" << kScene
      << "\"\n[[run]]\nintegrator = \"path\"\n";
  const auto png = prepare(options);
  ASSERT_FALSE(png.ok());
  EXPECT_THAT(png.error().to_string(), HasSubstr(".exr file"));
}

// --- rendering in other processes ---

RunSpec small_render(const std::string& integrator, SettingsMap given = {}) {
  if (integrator == "pssmlt") given = {{"chains", "8"}, {"bootstrap", "500"}, {"mutations", "2"}};
  auto run = make_run(kScene, "cornell", integrator, given, 24, 24);
  if (!run.ok()) throw std::runtime_error(run.error().to_string());
  run->job.seed = 5;
  return *run;
}

TEST(Rendering, SlicesAndProcessesChangeNoBit) {
  const std::vector<std::pair<std::string, SettingsMap>> cases = {{"path", {}},
                                                                  {"ppm", {}},
                                                                  {"pssmlt", {}},
                                                                  {"optimis", {{"weights", "optimal"}}},
                                                                  {"optimis", {{"selection", "trained"}}}};
  for (const auto& [integrator, given] : cases) {
    SCOPED_TRACE(integrator);
    const RunSpec run = small_render(integrator, given);
    auto here = make_render_estimator(run);
    auto there = make_process_estimator(test::program_path("candela-bench"), run);
    ASSERT_TRUE(here.ok() && there.ok());
    // Segments, of which 8 are one of each chain, and 21 more than there are chains.
    const std::uint64_t all = integrator == "pssmlt" ? 21 : 7;
    ASSERT_TRUE((*here)->advance(all).ok());
    for (const std::uint64_t units : {1, 2, 5}) ASSERT_TRUE((*there)->advance(units).ok());
    // Kept, and gone on with by another process.
    const auto saved = (*there)->save();
    ASSERT_TRUE(saved.ok());
    auto third = make_process_estimator(test::program_path("candela-bench"), run);
    ASSERT_TRUE(third.ok());
    const auto restored = (*third)->restore(*saved);
    ASSERT_TRUE(restored.ok()) << restored.error().to_string();
    EXPECT_EQ(restored->units, 5U);
    const auto cost = (*third)->advance(all);
    ASSERT_TRUE(cost.ok());
    EXPECT_EQ(cost->units, all);
    const auto mine = (*here)->snapshot(), theirs = (*third)->snapshot();
    ASSERT_TRUE(mine.ok() && theirs.ok());
    EXPECT_EQ(mine->image, theirs->image);
    EXPECT_EQ(mine->own_relmse, theirs->own_relmse);
    EXPECT_GT(*std::max_element(mine->image.begin(), mine->image.end()), 0);
    if (integrator != "pssmlt") {
      EXPECT_EQ(cost->eye_samples, 24U * 24 * 7);
    }
    EXPECT_GT(cost->rays, 1000U);
    EXPECT_GT(cost->cpu_seconds, 0);
    EXPECT_GT(cost->delta_bytes, 0U);
    EXPECT_GT(cost->peak_memory_bytes, 1U << 20);
    // From another run: refused.
    RunSpec other = run;
    other.job.width = 16;
    auto fourth = make_process_estimator(test::program_path("candela-bench"), other);
    EXPECT_FALSE((*fourth)->restore(*saved).ok());
  }
}

// Claim: the image of a job that is read out by its sums (optimis) is the film's with the corrections that
// follow from the sums of its own units, not the film's alone, which is the balance heuristic.
TEST(Rendering, ImagesAreReadOutAsTheJobSays) {
  constexpr std::uint64_t kIterations = 8;
  const auto image_of = [](const RunSpec& run) {
    auto estimator = make_render_estimator(run);
    if (!estimator.ok() || !(*estimator)->advance(kIterations).ok()) throw std::runtime_error("no image");
    auto snapshot = (*estimator)->snapshot();
    if (!snapshot.ok()) throw std::runtime_error(snapshot.error().to_string());
    return *snapshot;
  };
  const RunSpec run = small_render("optimis", {{"weights", "optimal"}, {"estimator", "crossfit"}});
  const Snapshot optimal = image_of(run);

  const fs::path scene = run.scene_file;
  const bundle::DiskSource files(scene.parent_path());
  const auto renderer = render::Renderer::create(files, scene.filename(), {}, run.job, 1);
  ASSERT_TRUE(renderer.ok()) << renderer.error().to_string();
  const auto pilot = (*renderer)->pilot({});
  ASSERT_TRUE(pilot.ok() && pilot->work.development);
  std::vector<double> expected(std::size_t{run.job.width} * run.job.height * 3);
  std::array<std::vector<film::MergedAccumulator>, 2> sums;
  for (const std::uint32_t half : {0U, 1U}) {
    render::UnitOutput output = (*renderer)->make_output(pilot->state);
    const Unit unit{Unit::Kind::iterations, half, 0, kIterations / 2};
    ASSERT_TRUE((*renderer)->run(unit, {pilot->state, {}, {}}, output, {}).ok());
    for (std::size_t i = 0; i < expected.size(); ++i)
      expected[i] +=
          std::ldexp(static_cast<double>(output.film->sums()[i]), -output.film->scale_log2()) / kIterations;
    for (const auto& accumulator : output.accumulators) {
      film::MergedAccumulator& merged =
          sums[half].emplace_back(run.job.width, run.job.height, accumulator->spec());
      std::vector<film::Int128> pixel(accumulator->spec().channels);
      for (std::uint32_t y = 0; y < run.job.height; ++y)
        for (std::uint32_t x = 0; x < run.job.width; ++x) {
          const std::size_t at = (std::size_t{y} * run.job.width + x) * pixel.size();
          for (std::size_t c = 0; c < pixel.size(); ++c) pixel[c] = accumulator->sums()[at + c];
          merged.set_pixel(x, y, pixel);
        }
    }
  }
  const auto find = [&](std::string_view name, std::uint32_t half) -> const film::MergedAccumulator* {
    for (const film::MergedAccumulator& a : sums[half])
      if (a.spec().name == name) return &a;
    return nullptr;
  };
  const auto corrections =
      correct({*pilot->work.development, "crossfit", run.job.width, run.job.height, find});
  ASSERT_TRUE(corrections.ok()) << corrections.error().to_string();
  double corrected = 0;
  for (std::size_t i = 0; i < expected.size(); ++i) {
    const double more = static_cast<double>((*corrections)[0][i] + (*corrections)[1][i]) / kIterations;
    ASSERT_NEAR(optimal.image[i], expected[i] + more, 1e-5 * (1 + std::abs(expected[i]))) << i;
    corrected += std::abs(more);
  }
  EXPECT_GT(corrected, 1);
  // The job's own choice counts: the same sums, read by the balance heuristic, are another image.
  const Snapshot balance =
      image_of(small_render("optimis", {{"weights", "optimal"}, {"estimator", "balance"}}));
  EXPECT_NE(balance.image, optimal.image);
  EXPECT_NE(balance.own_relmse, optimal.own_relmse);
}

TEST(Rendering, AProcessSaysWhatIsWrong) {
  RunSpec run = small_render("path");
  run.job.integrator = "pth";
  const auto wrong = make_process_estimator(test::program_path("candela-bench"), run);
  ASSERT_FALSE(wrong.ok());
  EXPECT_THAT(wrong.error().to_string(), HasSubstr("unknown integrator 'pth'"));
  EXPECT_FALSE(make_process_estimator("/nowhere/candela-bench", run).ok());
}

// --- references ---

TruthOptions truth_options(const fs::path& out) {
  TruthOptions options;
  options.scene_file = kScene;
  options.width = options.height = kSize;
  options.integrators = {"path", "bdpt"};
  options.iterations = 256;
  options.batches = 8;
  options.out = out.string();
  return options;
}

// Two estimators of one image with deviations 0.3 and 0.1 a unit: together, weighted by inverse variance, 256
// units each have a variance of 1 / (256 / 0.09 + 256 / 0.01). The measured relMSE has a relative deviation
// of sqrt(2 / 12288) = 1.3 %, the one estimated from 8 batches of 0.5 %; 8 % is six of the larger: 1e-8.
TEST(Truth, CombinesTwoThatAgree) {
  const test::TemporaryFolder folder;
  const EstimatorFactory factory = [](const RunSpec& run) {
    return known(run.job.integrator == "path" ? 0.3 : 0.1, 0)(run);
  };
  const auto options = truth_options(folder.path() / "truth.exr");
  std::atomic<bool> stop{false};
  const auto made = make_truth(options, factory, stop, [](const std::string&) {});
  ASSERT_TRUE(made.ok()) << made.error().to_string();
  const auto reference = Reference::read(options.out, false);
  ASSERT_TRUE(reference.ok());
  const double expected = 1 / (256 / 0.09 + 256 / 0.01) / (1.01 * kTruth * kTruth);
  const auto truth = flat_reference(0)("");
  EXPECT_NEAR((*truth)->figures_of((*reference)->rgb()).relmse / expected, 1, 0.08);
  ASSERT_TRUE((*reference)->own_error().has_value());
  EXPECT_NEAR((*reference)->own_error()->relmse / expected, 1, 0.08);
}

TEST(Truth, RefusedWhereTwoDisagree) {
  const test::TemporaryFolder folder;
  // 2 % too bright: 20 standard errors of the whole image.
  const EstimatorFactory factory = [](const RunSpec& run) {
    return known(0.3, run.job.integrator == "path" ? 0.016 : 0)(run);
  };
  const auto options = truth_options(folder.path() / "truth.exr");
  std::atomic<bool> stop{false};
  const auto refused = make_truth(options, factory, stop, [](const std::string&) {});
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(refused.error().to_string(), HasSubstr("disagree"));
  EXPECT_FALSE(fs::exists(options.out));
}

TEST(Truth, GoesOnAfterAStop) {
  const test::TemporaryFolder folder;
  const auto options = truth_options(folder.path() / "truth.exr");
  std::atomic<bool> stop{false};
  int batches = 0;
  const auto cut =
      make_truth(options, known(0.3, 0), stop, [&](const std::string&) { stop = ++batches == 3; });
  ASSERT_FALSE(cut.ok());
  stop = false;
  batches = 0;
  const auto made = make_truth(options, known(0.3, 0), stop, [&](const std::string&) { ++batches; });
  ASSERT_TRUE(made.ok()) << made.error().to_string();
  EXPECT_EQ(batches, 14);  // of 16: the third was under way
}

TEST(Truth, BadOptionsHaveOneClearError) {
  const test::TemporaryFolder folder;
  const auto error_with = [&](auto change) {
    auto options = truth_options(folder.path() / "truth.exr");
    change(options);
    std::atomic<bool> stop{false};
    const auto made = make_truth(options, known(0.3, 0), stop, [](const std::string&) {});
    return made.ok() ? "" : made.error().to_string();
  };
  EXPECT_THAT(error_with([](TruthOptions& o) { o.block = 0; }), HasSubstr("--block"));
  EXPECT_THAT(error_with([](TruthOptions& o) { o.block = 0xffffffff; }), HasSubstr("--block"));
  EXPECT_THAT(error_with([](TruthOptions& o) { o.threads = 0; }), HasSubstr("--threads"));
  EXPECT_THAT(error_with([](TruthOptions& o) { o.threads = 100'000; }), HasSubstr("--threads"));
  EXPECT_THAT(error_with([](TruthOptions& o) { o.scene_file = "l\xe9.xml"; }), HasSubstr("UTF-8"));
}

TEST(Truth, SaysWhatItRenderedAndWhereThatIsTooLittle) {
  const test::TemporaryFolder folder;
  auto options = truth_options(folder.path() / "truth.exr");
  options.iterations = 9;  // two a batch
  std::atomic<bool> stop{false};
  std::string said;
  const auto made = make_truth(options, known(3, 0), stop, [&](const std::string& line) { said += line; });
  ASSERT_TRUE(made.ok()) << made.error().to_string();
  EXPECT_THAT(*made, HasSubstr("16 iterations each in 8 batches"));
  EXPECT_THAT(said, HasSubstr("warning: a difference of 5 % would have been found in "));
}

// --- figures ---

TEST(FlipFigure, IsZeroForEqualAndOneForGreenAgainstBlue) {
  std::vector<float> green, blue, noise;
  rng::Stream stream(7);
  for (int p = 0; p < 40 * 30; ++p) {
    green.insert(green.end(), {0, 1, 0});
    blue.insert(blue.end(), {0, 0, 1});
    for (int c = 0; c < 3; ++c) noise.push_back(stream.next_float());
  }
  for (const float value : ldr_flip(noise, noise, 40, 30)) EXPECT_EQ(value, 0);
  for (const float value : ldr_flip(green, blue, 40, 30)) EXPECT_NEAR(value, 1, 1e-3);
  const Flip hdr(noise, 40, 30);
  EXPECT_EQ(hdr.mean(noise), 0);
  std::vector<float> broken = noise;
  broken[17] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_GT(hdr.mean(broken), 0);
  EXPECT_LE(hdr.mean(blue), 1);
  const Flip black(std::vector<float>(40 * 30 * 3, 0.0F), 40, 30);
  EXPECT_GT(black.mean(noise), 0.1);
}

TEST(FiguresOf, BrokenPixelsAreInfinitelyWrong) {
  const auto reference = *flat_reference(0)("");
  std::vector<float> image = reference->rgb();
  EXPECT_EQ(reference->figures_of(image).relmse, 0);
  EXPECT_EQ(reference->figures_of(image).smape, 0);
  image[0] = std::numeric_limits<float>::infinity();
  const Figures figures = reference->figures_of(image);
  EXPECT_TRUE(std::isinf(figures.relmse) && std::isinf(figures.rmse));
  EXPECT_NEAR(figures.smape, 2.0 / kValues, 1e-12);
}

}  // namespace
}  // namespace candela::bench
