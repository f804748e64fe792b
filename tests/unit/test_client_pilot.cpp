// Pilots on a farm in this process: real renderers behind a master and its workers, which count what they do.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <map>
#include <mutex>
#include <set>
#include <thread>

#include "client/farm_client.h"
#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/image/image.h"
#include "common/job/bundle.h"
#include "common/wire/wire.h"
#include "master/master.h"
#include "tests/temporary_folder.h"
#include "worker/service/farm_worker.h"

namespace candela::pilot_farm {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kIterations = 24;

// A lamp and a small one in a box of fog.
const std::string kScene =
    "<scene version=\"3.0.0\"><integrator type=\"path\"/><sensor type=\"perspective\"/>"
    "<shape type=\"cube\"><bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf></shape>"
    "<shape type=\"sphere\"><float name=\"radius\" value=\"0.9\"/><bsdf type=\"null\"/><medium "
    "name=\"interior\" type=\"homogeneous\"><float name=\"sigma_t\" value=\"1\"/><rgb name=\"albedo\" "
    "value=\"0.5, 0.5, 0.5\"/></medium></shape>"
    "<shape type=\"rectangle\"><transform name=\"to_world\"><scale value=\"0.3\"/><rotate x=\"1\" "
    "angle=\"90\"/><translate y=\"0.99\"/></transform><emitter type=\"area\"/></shape>"
    "<shape type=\"sphere\"><point name=\"center\" x=\"-0.7\" y=\"-0.5\" z=\"0.7\"/><float name=\"radius\" "
    "value=\"0.05\"/><emitter type=\"area\"/></shape></scene>";

// Counts over all workers.
struct Counts {
  std::mutex mutex;
  std::condition_variable changed;
  std::uint64_t pilots = 0, renderers = 0;
  std::set<std::uint64_t> steps;  // of an iteration: all that were seen
  std::set<std::string> decided;  // in the states of units
};

// Its units begin when every worker has one.
class CountedRenderer final : public render::Renderer {
 public:
  CountedRenderer(std::unique_ptr<render::Renderer> real, Counts& counts, std::size_t workers)
      : real_(std::move(real)), counts_(counts), workers_(workers) {
    const std::lock_guard lock(counts_.mutex);
    ++counts_.renderers;
    counts_.changed.notify_all();
  }
  Result<PilotResult> pilot(const render::RunContext& context) const override {
    {
      const std::lock_guard lock(counts_.mutex);
      ++counts_.pilots;
    }
    return real_->pilot(context);
  }
  render::UnitOutput make_output(const NamedState& state) const override { return real_->make_output(state); }
  Result<void> run(const Unit& unit, const render::UnitInput& input, render::UnitOutput& output,
                   const render::RunContext& context) const override {
    {
      std::unique_lock lock(counts_.mutex);
      counts_.changed.wait_for(lock, std::chrono::seconds(60), [&] { return counts_.renderers >= workers_; });
    }
    const std::uint64_t before = context.steps->load();
    CANDELA_TRY(real_->run(unit, input, output, context));
    const std::uint64_t count = unit.end - unit.begin, steps = context.steps->load() - before;
    const std::lock_guard lock(counts_.mutex);
    counts_.steps.insert(steps / count);
    if (steps % count != 0) counts_.steps.insert(0);
    counts_.decided.insert(input.state.decided);
    return {};
  }
  Result<std::string> plan_text() const override { return real_->plan_text(); }

 private:
  std::unique_ptr<render::Renderer> real_;
  Counts& counts_;
  std::size_t workers_;
};

class CountedFarm {
 public:
  explicit CountedFarm(std::size_t workers) : workers_of_farm_(workers) {
    std::ofstream(folder_.path() / "scene.xml") << kScene;
    master::MasterOptions options;
    options.data_dir = folder_.path() / "data";
    options.listen.clear();
    options.unit_seconds = 0.001;  // an iteration
    options.audit_share = 0;       // no pilot is compared
    master_ = value_of(master::Master::start(options));
    client_ = client::FarmClient::over(master_->in_process_channel(), 10);
  }
  ~CountedFarm() {
    for (const auto& worker : workers_) worker->drain();
  }
  CountedFarm(const CountedFarm&) = delete;
  CountedFarm& operator=(const CountedFarm&) = delete;

  void start_worker() {
    worker::WorkerOptions options;
    options.cache_dir = folder_.path() / "cache";
    options.threads = 1;
    options.name = "worker" + std::to_string(workers_.size());
    worker::RendererFactory factory{
        [this](const description::FileSource& files, const std::string& key,
               const std::map<std::string, std::string>& parameters, const JobSettings& settings,
               unsigned threads) -> Result<std::unique_ptr<render::Renderer>> {
          CANDELA_ASSIGN(auto real, render::Renderer::create(files, key, parameters, settings, threads));
          return std::unique_ptr<render::Renderer>(
              std::make_unique<CountedRenderer>(std::move(real), counts_, workers_of_farm_));
        },
        [] { return render::supported_isas(); }};
    workers_.push_back(
        value_of(worker::FarmWorker::start(options, master_->in_process_channel(), factory, {})));
  }
  std::string submit(const std::string& integrator) {
    const std::string hash = sha256_hex(kScene);
    EXPECT_TRUE(
        client_->upload_blob(hash, kScene.size(), folder_.path() / "scene.xml", [](std::uint64_t) {}).ok());
    v1::SubmitRequest request;
    bundle::Bundle bundle;
    bundle.main_path = "scene.xml";
    bundle.files = {{"scene.xml", hash, kScene.size()}};
    wire::to_proto(bundle, *request.mutable_bundle());
    JobSettings settings;
    settings.integrator = integrator;
    settings.width = settings.height = 16;
    settings.seed = 7;
    settings.integrator_settings = value_of(render::complete_integrator_settings(integrator, {}, {}));
    wire::to_proto(settings, *request.mutable_settings());
    request.mutable_stop()->set_iterations(kIterations);
    request.set_idempotency_token("once");
    return value_of(client_->submit(request)).job_id();
  }
  v1::JobStatus wait(const std::string& id) {
    v1::JobStatus status;
    for (int i = 0; i < 20000; ++i) {
      status = value_of(client_->get_job(id));
      if (status.state() == v1::JOB_STATE_DONE || status.state() == v1::JOB_STATE_FAILED) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    EXPECT_EQ(status.state(), v1::JOB_STATE_DONE) << status.message();
    return status;
  }
  std::vector<float> pixels(const v1::JobStatus& status) {
    const fs::path file = folder_.path() / (status.id() + ".exr");
    std::ofstream(file, std::ios::binary) << value_of(client_->fetch_image(status.id(), {}));
    return value_of(image::read_image(file)).rgb;
  }
  Counts& counts() { return counts_; }

 private:
  template <class T>
  static T value_of(Result<T> result) {
    if (!result.ok()) throw std::runtime_error(result.error().to_string());
    return std::move(result).value();
  }

  const std::size_t workers_of_farm_;
  Counts counts_;
  test::TemporaryFolder folder_;
  std::unique_ptr<master::Master> master_;
  std::unique_ptr<client::FarmClient> client_;
  std::vector<std::unique_ptr<worker::Worker>> workers_;
};

// Claim: the trials of a job are made once, by its pilot, whatever the number of workers: no iteration of any
// worker takes more steps than another, all have the same decision, and one worker or three make the same
// image by the same plan.
TEST(PilotOnAFarm, TrialsRunOnceAJob) {
  ASSERT_TRUE(log::initialise("test", "off", "text").ok());
  for (const char* integrator : {"upbp", "bpm"}) {
    SCOPED_TRACE(integrator);
    std::map<std::size_t, std::pair<std::vector<float>, std::string>> seen;  // image and plan
    for (const std::size_t workers : {1, 3}) {
      CountedFarm farm(workers);
      const std::string id = farm.submit(integrator);
      for (std::size_t i = 0; i < workers; ++i) farm.start_worker();
      const v1::JobStatus end = farm.wait(id);
      const std::lock_guard lock(farm.counts().mutex);
      EXPECT_EQ(farm.counts().pilots, 1U);
      EXPECT_EQ(farm.counts().steps.size(), 1U) << "some iteration did more than another";
      EXPECT_EQ(farm.counts().steps.count(0), 0U);
      ASSERT_EQ(farm.counts().decided.size(), 1U);
      EXPECT_FALSE(farm.counts().decided.begin()->empty());
      EXPECT_EQ(farm.counts().renderers, workers);
      seen[workers] = {farm.pixels(end), end.plan()};
    }
    EXPECT_EQ(seen[1].second, seen[3].second);
    ASSERT_FALSE(seen[1].first.empty());
    EXPECT_TRUE(seen[1].first == seen[3].first);
  }
}

}  // namespace
}  // namespace candela::pilot_farm
