// Pictures that are made again: from what a picture says of itself, on one worker and on five, here and on a
// farm, after any end of a job and after deaths.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <csignal>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "common/base/files.h"
#include "common/film/index_text.h"
#include "common/image/bits.h"
#include "tests/farm/farm.h"
#include "tests/farm/hand_worker.h"
#include "tests/integrators.h"

namespace candela::farm {
namespace {

// Units of this length are many in every job below.
const std::vector<std::string> kShortUnits = {"--unit-time", "0.05", "--checkpoint-interval", "0.2"};

std::vector<std::string> with(const std::string& integrator) {
  std::vector<std::string> options{"--integrator", integrator};
  if (test::merges(integrator)) options.insert(options.end(), {"--set", "plan=full"});
  for (const auto& [name, value] : test::integrator_row(integrator).small)
    options.insert(options.end(), {"--set", name + "=" + value});
  return options;
}

// A job of this integrator, which ends by `limit`.
std::string submit(Farm& farm, const std::string& integrator, const std::vector<std::string>& limit) {
  std::vector<std::string> arguments{"submit", scene_path("cornell"), "--size", "16x12", "--seed", "3"};
  for (const auto& more : {with(integrator), limit})
    arguments.insert(arguments.end(), more.begin(), more.end());
  const CommandResult r = farm.candela(arguments);
  EXPECT_EQ(r.exit_code, 0) << r.err;
  return r.out.substr(0, r.out.find('\n'));
}

std::string fetch(Farm& farm, const std::string& id, const std::string& name) {
  const std::string file = farm.folder() / name;
  const CommandResult r = farm.candela({"fetch", id, "-o", file});
  EXPECT_EQ(r.exit_code, 0) << r.err;
  return file;
}

std::string indices_of(const std::string& file) {
  const auto texts = image::read_texts(file);
  EXPECT_TRUE(texts.ok());
  return texts->at("candela:indices_a") + "/" + texts->at("candela:indices_b");
}

// The figures of the error that a picture shows.
std::string figures_of(const std::string& file) {
  const auto texts = image::read_texts(file);
  EXPECT_TRUE(texts.ok());
  return texts->at("candela:relmse_estimate") + " at most " + texts->at("candela:relmse_upper");
}

void cancel(Farm& farm, const std::string& id) {
  const CommandResult r = farm.candela({"cancel", id});
  EXPECT_EQ(r.exit_code, 0) << r.err;
}

// `more`: how it is made again.
void expect_reproduced(Farm& farm, const std::string& file, std::vector<std::string> more = {}) {
  const std::string again = file + ".again.exr";
  more.insert(more.begin(), {"reproduce", file, "--run", "--quiet", "-o", again});
  const CommandResult r = farm.candela(more);
  ASSERT_EQ(r.exit_code, 0) << file << ": " << indices_of(file) << "\n" << r.out << r.err;
  EXPECT_EQ(r.out.substr(0, 7), "equal: ") << r.out;
  EXPECT_EQ(figures_of(again), figures_of(file));
}

// Few samples of a few pixels.
std::string iterations_of(const std::string& integrator) {
  return test::has_chains(integrator) ? "5" : "21";
}

class Reproduced : public testing::TestWithParam<std::string> {};

// Claim: the picture of a job that ended by its number of iterations on one worker, of one that was fetched
// amid its work, was cancelled on five, and was extended afterwards, is made again to the last bit, by one
// process here and by five workers.
TEST_P(Reproduced, WhateverEndsTheJob) {
  const std::string& integrator = GetParam();
  Farm farm;
  farm.start_master_here(kShortUnits);
  farm.start_worker_here("w0");
  const std::string counted = submit(farm, integrator, {"--iterations", iterations_of(integrator)});
  farm.wait_for(counted, v1::JOB_STATE_DONE);
  expect_reproduced(farm, fetch(farm, counted, "counted.exr"));
  for (int i = 1; i < 5; ++i) farm.start_worker_here("w" + std::to_string(i));

  const std::string id = submit(farm, integrator, {"--time", "1h"});
  farm.wait_for_iterations(id, 4);
  const std::string amid = fetch(farm, id, "amid.exr");
  cancel(farm, id);
  const std::string cancelled = fetch(farm, id, "cancelled.exr");
  EXPECT_EQ(farm.job(id).scene_path(), scene_path("cornell"));
  farm.extend(id, 3);
  farm.wait_for(id, v1::JOB_STATE_DONE);
  const std::string extended = fetch(farm, id, "extended.exr");
  expect_reproduced(farm, amid, {"--threads", "1"});
  expect_reproduced(farm, cancelled, {"--master", farm.address()});
  expect_reproduced(farm, extended);
}

// Claim: so is that of a job whose time was up, and of one whose error was small enough; the halves of the
// first are level where a unit's work makes them so.
TEST_P(Reproduced, TimeAndError) {
  const std::string& integrator = GetParam();
  Farm farm;
  farm.start_master_here(kShortUnits);
  for (int i = 0; i < 5; ++i) farm.start_worker_here("w" + std::to_string(i));
  const std::string timed = submit(farm, integrator, {"--time", "0.3"});
  const std::string good = submit(farm, integrator, {"--until", "relmse=100"});
  farm.wait_for(timed, v1::JOB_STATE_DONE);
  expect_reproduced(farm, fetch(farm, timed, "timed.exr"));
  farm.wait_for(good, v1::JOB_STATE_DONE);
  expect_reproduced(farm, fetch(farm, good, "good.exr"), {"--master", farm.address()});
}

INSTANTIATE_TEST_SUITE_P(, Reproduced, testing::Values("path", "vcm", "fppm", "optimis", "pssmlt"),
                         [](const auto& one) { return one.param; });

// Claim: a picture with gaps amid its indices says so, and is made again with them.
TEST(Reproduce, APictureWithGaps) {
  Farm farm;
  farm.start_master_here({"--unit-time", "0.01"});
  const std::string id = submit(farm, "path", {"--time", "1h"});
  HandWorker worker(farm.address(), "by hand");
  worker.scene_file_for_pilots = scene_path("cornell");
  worker.told_seconds = 1;  // units of one iteration
  std::vector<v1::Lease> leases;
  for (int i = 0; i < 5; ++i) leases.push_back(worker.acquire());
  for (const std::size_t i : {4U, 1U})
    ASSERT_EQ(worker.push(worker.delta_for(leases[i], scene_path("cornell"))).verdict(),
              v1::DELTA_VERDICT_MERGED);
  cancel(farm, id);
  const std::string file = fetch(farm, id, "gaps.exr");
  EXPECT_EQ(indices_of(file), "2/0");
  expect_reproduced(farm, file);
}

// Claim: the same of real processes that die: a job of chains whose time is up on five workers after its
// master and one of them were killed, and the job that makes its picture again, which meets the same.
TEST(Reproduce, AfterDeaths) {
  Farm farm;
  farm.start_master(kShortUnits);
  std::vector<Process*> workers;
  for (int i = 0; i < 5; ++i) workers.push_back(&farm.start_worker("w" + std::to_string(i)));
  const std::string id = submit(farm, "pssmlt", {"--time", "1s"});
  farm.wait_for_iterations(id, 2);
  farm.kill_master();
  farm.forget_worker(*workers[0]);
  farm.restart_master();
  farm.wait_for(id, v1::JOB_STATE_DONE);
  const std::string file = fetch(farm, id, "timed.exr");

  auto again = farm.start_candela(
      {"reproduce", file, "--run", "--quiet", "--master", farm.address(), "--timeout", "60s"}, "reproduce");
  std::string second;
  ASSERT_TRUE(eventually(kPatienceSeconds, [&] {
    const std::string& told = again->err();
    const std::size_t at = told.find("job "), end = told.find('\n', at == std::string::npos ? 0 : at);
    if (at == std::string::npos || end == std::string::npos) return false;
    second = told.substr(at + 4, end - at - 4);
    return true;
  }));
  farm.wait_for_iterations(second, 1);
  farm.kill_master();
  farm.forget_worker(*workers[1]);
  farm.restart_master();
  ASSERT_TRUE(again->wait(kPatienceSeconds));
  EXPECT_EQ(*again->wait(0), 0) << again->out() << again->err();
  EXPECT_EQ(again->out().substr(0, 7), "equal: ") << again->out();
  EXPECT_EQ(indices_of(fetch(farm, second, "second.exr")), indices_of(file));
}

// Claim: equal jobs show one error and one interval: on one worker, and on three while the master and a
// worker are killed; in the status, in the picture, and in what one process renders. The heads of their
// pictures differ in the job alone.
TEST(Reproduce, OneFigure) {
  Farm farm;
  farm.start_master(kShortUnits);
  farm.start_worker("w0");
  const std::vector<std::string> limit{"--iterations", "61"};
  const std::string alone = submit(farm, "fppm", limit);
  const auto shown = [&](const std::string& id) {
    farm.wait_for(id, v1::JOB_STATE_DONE);
    const v1::JobStatus job = farm.job(id);
    const std::string figures = figures_of(fetch(farm, id, id + ".exr"));
    EXPECT_EQ(fmt::format("{:.6g} at most {:.6g}", job.relmse_estimate(), job.relmse_upper()), figures);
    return figures;
  };
  const std::string figures = shown(alone);
  farm.start_worker("w1");
  Process& last = farm.start_worker("w2");
  const std::string again = submit(farm, "fppm", limit);
  farm.wait_for_iterations(again, 8);
  farm.kill_master();
  farm.forget_worker(last);
  farm.restart_master();
  EXPECT_EQ(shown(again), figures);
  const auto head_of = [&](const std::string& id) {
    auto texts = image::read_texts(farm.folder() / (id + ".exr"));
    EXPECT_TRUE(texts.ok());
    EXPECT_EQ(texts->erase("candela:job"), 1U);
    return *texts;
  };
  EXPECT_EQ(head_of(again), head_of(alone));
  std::vector<std::string> render{
      "render", scene_path("cornell"), "-o", farm.folder() / "here.exr", "--size", "16x12", "--seed", "3"};
  for (const auto& more : {with("fppm"), limit}) render.insert(render.end(), more.begin(), more.end());
  const CommandResult r = farm.candela(render);
  EXPECT_EQ(r.exit_code, 0) << r.err;
  EXPECT_EQ(figures_of(farm.folder() / "here.exr"), figures);
}

// Claim: Ctrl-C during `reproduce --run` tells a command that goes on. Without -o nothing is kept, and the
// command starts a run that can go on.
TEST(Reproduce, StoppedRunTellsHowToGoOn) {
  Farm farm;
  const std::string file = farm.folder() / "out.exr";
  ASSERT_EQ(
      farm.candela({"render", scene_path("cornell"), "-o", file, "--size", "16x12", "--iterations", "2"})
          .exit_code,
      0);
  // The same image that claims to have more samples than anybody renders.
  const auto image = image::read_image(file);
  auto texts = image::read_texts(file);
  ASSERT_TRUE(image.ok() && texts.ok());
  std::erase_if(*texts, [](const auto& entry) { return !entry.first.starts_with("candela:"); });
  std::string& command = texts->at("candela:reproduce");
  const std::size_t at = command.find("--indices 0/0");
  ASSERT_NE(at, std::string::npos) << command;
  command.replace(at, std::string("--indices 0/0").size(), "--indices 0-99999999/0-99999999");
  const auto bytes = image::encode_exr(image->width, image->height, image->rgb, *texts);
  ASSERT_TRUE(bytes.ok()) << bytes.error().to_string();
  ASSERT_TRUE(write_file_atomically(file, *bytes).ok());

  const std::string again = farm.folder() / "again.exr";
  for (const bool kept : {false, true}) {
    std::vector<std::string> run{"reproduce", file, "--run", "--threads", "1"};
    if (kept) run.insert(run.end(), {"-o", again});
    const auto process = farm.start_candela(run, kept ? "kept" : "passing");
    ASSERT_TRUE(eventually(kPatienceSeconds, [&] {
      return !process->running() || process->err().find("spp/s") != std::string::npos;
    }));
    process->signal(SIGINT);
    EXPECT_EQ(process->wait(kPatienceSeconds).value_or(-1), 128 + SIGINT) << process->err();
    const std::string told = process->err();
    if (kept) {
      EXPECT_NE(told.find("go on with: "), std::string::npos) << told;
      EXPECT_NE(told.find("-o " + again + " --resume\n"), std::string::npos) << told;
      EXPECT_TRUE(std::filesystem::exists(again + ".candela"));
    } else {
      EXPECT_NE(told.find("candela: stopped\ncandela: nothing is kept without -o; start anew with: "),
                std::string::npos)
          << told;
      EXPECT_NE(told.find(" --run --threads 1 -o reproduced.exr\n"), std::string::npos) << told;
      EXPECT_EQ(told.find("--resume"), std::string::npos) << told;
      EXPECT_EQ(told.find("wrote"), std::string::npos) << told;
    }
  }
}

}  // namespace
}  // namespace candela::farm
