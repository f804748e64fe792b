// A master that the system gives no more memory: it goes on, says so, and nothing is lost.
#include <fmt/format.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "common/film/film.h"
#include "common/rng/stream.h"
#include "tests/farm/farm.h"
#include "tests/farm/metrics_page.h"
#include "tests/farm/process.h"
#include "tests/paths.h"
#include "tests/token_channel.h"
#include "tests/unit/farm_calls.h"
#include "tests/unit/hand_worker.h"

namespace candela::farm {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kFilmWidth = 1000, kFilmHeight = 800;  // a film of 38 MB
constexpr std::uint64_t kUnits = 4;
constexpr rlim_t kMega = 1 << 20;
constexpr double kPatience = 300;
constexpr const char* kEmptyScene = "<scene version='3.0.0'/>";

// A delta whose values follow from its unit alone.
std::string large_delta(const v1::Lease& lease) {
  const Unit unit = wire::from_proto(lease.unit()).value();
  film::UnitFilm film({kFilmWidth, kFilmHeight, 1}, lease.named_state().film_scale_log2());
  film::SampleCounts sample_counts;
  for (std::uint64_t i = unit.begin; i < unit.end; ++i)
    for (std::uint32_t y = 0; y < kFilmHeight; ++y)
      for (std::uint32_t x = 0; x < kFilmWidth; ++x) {
        const std::uint64_t key = rng::key(unit.half, i, y, x);
        const float v = 1 + rng::to_float(static_cast<std::uint32_t>(key));
        sample_counts.eye_samples += 1;
        film.add(0, x, y, {v, v, v}, key, sample_counts);
      }
  film.count(sample_counts);
  return film::encode_delta(
      film, {unit, film.layout(), film.scale_log2(), lease.job_id(), std::string(build_id())});
}

class LimitedMaster {
 public:
  // `address_space`: of the program, 0 for no limit.
  void start(rlim_t address_space = 0) {
    std::ofstream(folder_ / "config.toml") << "# nothing of the machine's own settings\n";
    const std::string program = test::program_path("checked-master").string();
    const std::string command =
        (address_space > 0 ? fmt::format("ulimit -Sv {}; ", address_space >> 10) : std::string()) +
        fmt::format(
            "exec '{}' --data '{}' --listen 127.0.0.1:0 --http 127.0.0.1:0 --checkpoint-interval 0.1 "
            "--lease-time 60",
            program, (folder_ / "data").string());
    process = std::make_unique<Process>(
        std::vector<std::string>{"/bin/sh", "-c", command}, folder_ / fmt::format("master-{}", ++serial_),
        std::map<std::string, std::string>{{"HOME", folder_.path().string()},
                                           {"PATH", "/usr/bin:/bin"},
                                           {"CANDELA_CONFIG", (folder_ / "config.toml").string()}});
    const std::string address = process->wait_for_line("listening on ", 60);
    if (address.empty()) throw std::runtime_error("the master does not listen: " + process->err());
    http = process->wait_for_line("http on ", 60);
    channel = test::token_channel(address, folder_ / "data");
    farm = v1::FarmService::NewStub(channel);
  }
  void kill() {
    farm.reset();
    channel.reset();
    process->kill();
  }
  rlim_t address_space() const {
    std::ifstream status(fmt::format("/proc/{}/status", process->pid()));
    rlim_t kilobytes = 0;
    for (std::string word; status >> word;)
      if (word == "VmSize:") status >> kilobytes;
    return kilobytes << 10;
  }
  void limit(rlim_t bytes) const {
    rlimit now{};
    ASSERT_EQ(::prlimit(process->pid(), RLIMIT_AS, nullptr, &now), 0);
    now.rlim_cur = bytes;
    ASSERT_EQ(::prlimit(process->pid(), RLIMIT_AS, &now, nullptr), 0);
  }
  v1::JobStatus job(const std::string& id) { return test::show(*farm, id); }
  bool says(const std::string& id, const std::string& text) {
    return job(id).message().find(text) != std::string::npos;
  }
  grpc::Status image(const std::string& id) {
    v1::FetchImageRequest request;
    request.set_job_id(id);
    grpc::ClientContext context;
    const auto stream = farm->FetchImage(&context, request);
    v1::FetchImageChunk chunk;
    while (stream->Read(&chunk)) {
    }
    return stream->Finish();
  }
  // Delivers units until there is none, again and again where the master has no memory for one: `refused` is
  // called then.
  void render(
      test::HandWorker& worker, const std::string& id, std::uint64_t iterations,
      const std::function<void()>& refused = [] {}) {
    std::optional<v1::Lease> lease;
    std::string bytes;
    ASSERT_TRUE(eventually(kPatience,
                           [&] {
                             if (!lease) {
                               lease = worker.acquire();
                               if (lease) bytes = large_delta(*lease);
                             }
                             if (lease) {
                               worker.push(worker.header(*lease, bytes), bytes);
                               if (worker.status.ok())
                                 lease.reset();
                               else
                                 refused();
                             }
                             return !lease && job(id).iterations() == iterations;
                           }))
        << job(id).message() << process->err();
  }

  std::unique_ptr<Process> process;
  std::string http;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::FarmService::Stub> farm;

 private:
  TempDir folder_;
  int serial_ = 0;
};

// Claim: where the address space ends amid a job, checkpoints fail with a word and are made when there is
// memory again, and nothing that was merged is lost; a master that starts without room for its films starts,
// with an ended job and with one that goes on, answers who looks at them, and goes on when there is memory.
TEST(Memory, AMasterOutlivesItsLack) {
  // JobFilmMemory and MemorySchedulerTest hold the parts to it in the short form.
  if (!long_form()) GTEST_SKIP() << "only with CANDELA_LONG=1";
  LimitedMaster master;
  master.start();
  test::HandWorker worker(master.channel);
  ASSERT_TRUE(worker.enrol().ok());
  JobSettings settings;
  settings.width = kFilmWidth;
  settings.height = kFilmHeight;
  const std::string id =
      test::submit(*master.farm, kEmptyScene, test::submission(kEmptyScene, settings, kUnits));
  const auto lease = worker.acquire();
  ASSERT_TRUE(lease);
  v1::CompletePilotRequest pilot;
  worker.sign(pilot, *lease);
  pilot.mutable_named_state()->set_film_scale_log2(20);
  pilot.set_seconds_per_iteration(4);
  ASSERT_TRUE(worker.complete(pilot)) << worker.status.error_message();
  const rlim_t had = master.address_space();
  // As little as is enough for the film and its deltas leaves none for a copy and its bytes. Some of it lies
  // in what the allocator has reserved already.
  rlim_t room = 4 * kMega;
  master.limit(had + room);
  master.render(worker, id, kUnits, [&] { master.limit(had + (room += 4 * kMega)); });
  ASSERT_TRUE(eventually(kPatience, [&] { return master.says(id, "out of memory"); }))
      << "there was memory for a checkpoint: the test is none";
  EXPECT_NE(master.job(id).state(), v1::JOB_STATE_DONE);
  master.limit(RLIM_INFINITY);
  ASSERT_TRUE(eventually(kPatience, [&] { return master.job(id).state() == v1::JOB_STATE_DONE; }))
      << master.job(id).message();
  EXPECT_TRUE(master.image(id).ok());

  master.kill();
  master.start(had + 24 * kMega);
  EXPECT_EQ(master.job(id).state(), v1::JOB_STATE_DONE);
  EXPECT_FALSE(http_get(master.http, "/api/jobs/" + id).empty()) << "the page gives no answer";
  EXPECT_FALSE(master.image(id).ok()) << "there was memory for an image: the test is none";
  ASSERT_TRUE(master.process->running()) << master.process->err();
  master.limit(RLIM_INFINITY);
  EXPECT_TRUE(master.image(id).ok());
  v1::ExtendJobRequest more;
  more.set_job_id(id);
  more.set_add_iterations(2);
  grpc::ClientContext context;
  v1::JobStatus extended;
  ASSERT_TRUE(master.farm->ExtendJob(&context, more, &extended).ok());

  master.kill();
  master.start(had + 24 * kMega);
  ASSERT_TRUE(eventually(kPatience, [&] { return master.says(id, "memory"); })) << master.job(id).message();
  EXPECT_EQ(master.job(id).iterations(), kUnits) << "what is on disk counts, read or not";
  master.limit(RLIM_INFINITY);
  test::HandWorker second(master.channel);
  ASSERT_TRUE(second.enrol().ok());
  master.render(second, id, kUnits + 2);
  ASSERT_TRUE(eventually(kPatience, [&] { return master.job(id).state() == v1::JOB_STATE_DONE; }));
  const v1::GetLedgerResponse ledger = test::ledger(*master.farm, id);
  EXPECT_EQ(ledger.film_eye_samples(), (kUnits + 2) * kFilmWidth * kFilmHeight);
}

}  // namespace
}  // namespace candela::farm
