// Layers all the way: a renderer of two layers behind two workers, a master that is restarted and one that
// dies, and the EXR at the end. Everything is real but the renderer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <thread>

#include "client/farm_client.h"
#include "client/output.h"
#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/image/image.h"
#include "common/job/bundle.h"
#include "common/stats/error_interval.h"
#include "common/stats/image_error.h"
#include "common/wire/wire.h"
#include "master/master.h"
#include "tests/temporary_folder.h"
#include "worker/service/farm_worker.h"

namespace candela {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kWidth = 70, kHeight = 41;
constexpr int kScale = 18;
constexpr std::uint64_t kIterations = 60;
const std::vector<std::string> kLayers{"weighted.s2.t3", "unweighted.s2.t3"};
const std::string kScene = "<scene version='3.0.0'/>";

// Adds iterations of one half: noise in the image, noise of its own in each layer. The second layer has light
// in a corner only: most of its tiles are never touched.
void render(std::uint32_t half, std::uint64_t begin, std::uint64_t end, film::UnitFilm& film) {
  film::SampleCounts sample_counts;
  for (std::uint64_t i = begin; i < end; ++i) {
    for (std::uint32_t y = 0; y < kHeight; ++y) {
      for (std::uint32_t x = 0; x < kWidth; ++x) {
        for (std::uint32_t layer = 0; layer < film.layout().layers; ++layer) {
          if (layer == 2 && (x > 20 || y > 20)) continue;
          const std::uint64_t key = rng::key(99, half, i, x, y, layer);
          const float v =
              0.5F + rng::to_float(static_cast<std::uint32_t>(key)) * static_cast<float>(1 + layer);
          if (layer == 0)
            film.add(layer, x, y, {v, 0.5F * v, 0.25F}, key, sample_counts);
          else
            film.splat(layer, x, y, {0.25F, v, 0.5F * v}, key, sample_counts);
        }
        ++sample_counts.eye_samples;
        sample_counts.light_paths += 2;
        sample_counts.rays += 3;
      }
    }
    ++sample_counts.bounded_walks;
  }
  film.count(sample_counts);
}

// Number of units that may be rendered: the test says how far a job comes before a master goes.
std::atomic<int>& permits() {
  static std::atomic<int> count{0};
  return count;
}
bool take_permit() {
  int left = permits().load();
  while (left > 0)
    if (permits().compare_exchange_weak(left, left - 1)) return true;
  return false;
}

class LayeredRenderer final : public render::Renderer {
 public:
  render::UnitOutput make_output(const NamedState& state) const override {
    render::UnitOutput output;
    output.film = std::make_unique<film::UnitFilm>(film::Layout{kWidth, kHeight, 3}, state.film_scale_log2);
    return output;
  }
  Result<PilotResult> pilot(const render::RunContext&) const override {
    return PilotResult{{kScale}, "the plan", 0.01, {.layers = kLayers}};
  }
  Result<void> run(const Unit& unit, const render::UnitInput&, render::UnitOutput& output,
                   const render::RunContext& context) const override {
    while (!take_permit()) {
      if (context.stop->load()) return refused_error("stopped");
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    render(unit.half, unit.begin, unit.end, *output.film);
    // An iteration costs so much that units stay small, whatever the machine.
    std::this_thread::sleep_for(std::chrono::milliseconds(5 * (unit.end - unit.begin)));
    return {};
  }
  Result<std::string> plan_text() const override { return std::string("the plan"); }
};

film::MergedFilm expected_film() {
  film::MergedFilm film({kWidth, kHeight, 3}, kScale);
  for (std::uint32_t half = 0; half < 2; ++half) {
    film::UnitFilm unit(film.layout(), kScale);
    const std::uint64_t end = (kIterations + 1 - half) / 2;
    render(half, 0, end, unit);
    const film::DeltaInfo info{{Unit::Kind::iterations, half, 0, end}, film.layout(), kScale, "j", "b"};
    const auto delta = film::Delta::decode(film::encode_delta(unit, info), film.layout());
    EXPECT_TRUE(delta.ok() && film.merge(*delta).ok());
  }
  return film;
}

// Keeps what it is to denoise, and changes nothing.
class Recorder final : public image::Denoiser {
 public:
  Result<std::vector<float>> denoise(const image::DenoiseImages& images) const override {
    seen.emplace_back(images.color.begin(), images.color.end());
    return seen.back();
  }
  mutable std::vector<std::vector<float>> seen;
};

class LayersOverTheFarm : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(log::initialise("test", "off", "text").ok());
    data_ = folder_ / "data";
    std::ofstream(folder_ / "scene.xml") << kScene;
    start();
  }
  void TearDown() override { stop(); }
  void start() {
    master::MasterOptions options;
    options.data_dir = data_;
    options.listen.clear();
    options.checkpoint_seconds = 0.02;
    options.unit_seconds = 0.02;
    auto master = master::Master::start(options);
    ASSERT_TRUE(master.ok()) << master.error().to_string();
    master_ = std::move(*master);
    client_ = client::FarmClient::over(master_->in_process_channel(), 10);
  }
  void stop() {
    stop_workers();
    client_.reset();
    master_.reset();
  }
  void start_workers() {
    for (const char* name : {"one", "two"}) {
      worker::WorkerOptions options;
      options.cache_dir = folder_ / "cache";
      options.threads = 1;
      options.name = name;
      worker::RendererFactory factory{
          [](const description::FileSource&, const std::string&, const std::map<std::string, std::string>&,
             const JobSettings&, unsigned) -> Result<std::unique_ptr<render::Renderer>> {
            return std::unique_ptr<render::Renderer>(std::make_unique<LayeredRenderer>());
          },
          [] { return std::vector<std::string>{"avx2"}; }};
      worker::Tuning tuning;
      tuning.first_backoff = worker::Milliseconds(5);
      auto worker = worker::FarmWorker::start(options, master_->in_process_channel(), factory, tuning);
      ASSERT_TRUE(worker.ok()) << worker.error().to_string();
      workers_.push_back(std::move(*worker));
    }
  }
  void stop_workers() {
    for (const auto& worker : workers_) worker->drain();
    workers_.clear();
  }
  std::string submit() {
    const std::string hash = sha256_hex(kScene);
    EXPECT_TRUE(client_->upload_blob(hash, kScene.size(), folder_ / "scene.xml", [](std::uint64_t) {}).ok());
    v1::SubmitRequest request;
    bundle::Bundle bundle;
    bundle.main_path = "scene.xml";
    bundle.files = {{"scene.xml", hash, kScene.size()}};
    wire::to_proto(bundle, *request.mutable_bundle());
    JobSettings settings;
    settings.width = kWidth;
    settings.height = kHeight;
    wire::to_proto(settings, *request.mutable_settings());
    request.mutable_stop()->set_iterations(kIterations);
    request.set_idempotency_token("once");
    const auto response = client_->submit(request);
    EXPECT_TRUE(response.ok()) << response.error().to_string();
    return response.ok() ? response->job_id() : "";
  }
  v1::JobStatus show(const std::string& id) {
    const auto status = client_->get_job(id);
    EXPECT_TRUE(status.ok()) << status.error().to_string();
    return status.ok() ? *status : v1::JobStatus();
  }
  template <class Condition>
  [[nodiscard]] bool wait_for(const std::string& id, Condition condition) {
    for (int i = 0; i < 2000; ++i) {
      if (condition(show(id))) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return false;
  }
  static std::vector<std::string> layers_of(const v1::JobStatus& status) {
    return {status.layers().begin(), status.layers().end()};
  }
  fs::path put(const std::string& name, const std::string& bytes) {
    EXPECT_TRUE(write_file_atomically(folder_ / name, bytes).ok());
    return folder_ / name;
  }

  // Claim: a denoiser is given both halves of the image, and the image of one half when that is asked for;
  // the note says the error.
  void check_denoised(const std::string& id, const film::MergedFilm& expected) {
    using Which = film::MergedFilm::Which;
    const auto denoiser = std::make_shared<Recorder>();
    const client::ImageOutput output{(folder_ / "denoised.exr").string(), "", denoiser};
    const auto both = client::fetch_for(*client_, id, {}, output);
    ASSERT_TRUE(both.ok()) << both.error().to_string();
    const auto note = client::write_images(output, *both);
    ASSERT_TRUE(note.ok()) << note.error().to_string();
    EXPECT_EQ(denoiser->seen,
              (std::vector{expected.develop(0, Which::half0), expected.develop(0, Which::half1)}));
    EXPECT_THAT(*note, testing::StartsWith("the denoised image: relMSE about "));
    EXPECT_EQ(image::read_image(output.exr)->rgb, expected.develop(0));
    EXPECT_EQ(image::read_layer(output.exr, kLayers[1])->rgb, expected.develop(2));
    denoiser->seen.clear();
    const auto one = client::fetch_for(*client_, id, {.half = v1::FetchImageRequest::HALF_B}, output);
    ASSERT_TRUE(one.ok() && client::write_images(output, *one).ok());
    EXPECT_EQ(denoiser->seen, std::vector<std::vector<float>>{expected.develop(0, Which::half1)});
  }

  // Claim: the image of a half is the exact mean of this half's iterations, in every layer, and says so. The
  // two, weighted by their iterations, are the image. A half has no error layer.
  void check_halves(const std::string& id, const film::MergedFilm& expected) {
    using v1::FetchImageRequest;
    using Which = film::MergedFilm::Which;
    std::vector<double> sum(expected.develop(0).size());
    for (const auto& [half, which, name] : {std::tuple(FetchImageRequest::HALF_A, Which::half0, "A"),
                                            std::tuple(FetchImageRequest::HALF_B, Which::half1, "B")}) {
      const auto exr = client_->fetch_image(id, {.half = half});
      ASSERT_TRUE(exr.ok()) << exr.error().to_string();
      const fs::path path = put("half.exr", *exr);
      const auto picture = image::read_image(path);
      ASSERT_TRUE(picture.ok());
      EXPECT_EQ(picture->rgb, expected.develop(0, which)) << name;
      EXPECT_NE(picture->rgb, expected.develop(0)) << "both halves alike prove nothing";
      EXPECT_EQ(image::read_layer(path, kLayers[1])->rgb, expected.develop(2, which)) << name;
      EXPECT_EQ(picture->metadata.at("candela:half"), name);
      EXPECT_EQ(picture->metadata.count("candela:relmse_estimate"), 0U);
      const std::uint64_t iterations = expected.merged(which == Which::half0 ? 0 : 1).count();
      EXPECT_EQ(picture->metadata.at("candela:iterations"), std::to_string(iterations));
      EXPECT_EQ(picture->metadata.at("candela:eye_samples"), std::to_string(iterations * kWidth * kHeight));
      for (std::size_t i = 0; i < sum.size(); ++i)
        sum[i] += static_cast<double>(picture->rgb[i]) * static_cast<double>(iterations) / kIterations;
      const auto refused = client_->fetch_image(id, {.error_layer = true, .half = half});
      ASSERT_FALSE(refused.ok());
      EXPECT_EQ(refused.error().exit_code(), 2) << refused.error().to_string();
    }
    check_denoised(id, expected);
    const std::vector<float> image = expected.develop(0);
    for (std::size_t i = 0; i < sum.size(); ++i) ASSERT_NEAR(sum[i], static_cast<double>(image[i]), 1e-6);
  }

  test::TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path(), data_;
  std::unique_ptr<master::Master> master_;
  std::unique_ptr<client::FarmClient> client_;
  std::vector<std::unique_ptr<worker::Worker>> workers_;
};

// Claim: the names of the layers come from the pilot, are kept by a master that is restarted and by one that
// dies (a copy of its folder as it lies is all that is left), and every layer is the exact sum of the
// iterations, to the last bit, whoever rendered them. The EXR has the layers beside the image, with or
// without the error layer; the image alone is had on request; the estimate of the error is the image's.
TEST_F(LayersOverTheFarm, SurviveRestartsAndReachTheExr) {
  const std::string id = submit();
  EXPECT_TRUE(show(id).layers().empty()) << "before the pilot";
  EXPECT_EQ(client_->fetch_image(id, {.half = v1::FetchImageRequest::HALF_B}).error().kind,
            ErrorKind::refused);
  permits() = 3;
  start_workers();
  ASSERT_TRUE(wait_for(id, [](const auto& s) { return s.units_merged() == 3; }));
  EXPECT_EQ(layers_of(show(id)), kLayers);
  // A restart in order.
  stop();
  start();
  EXPECT_EQ(layers_of(show(id)), kLayers);
  const std::uint64_t before = show(id).iterations();
  ASSERT_LT(before, kIterations) << "units are too large to test anything";
  ASSERT_GE(before, 3U);
  permits() = 3;
  start_workers();
  ASSERT_TRUE(wait_for(id, [&](const auto& s) { return s.iterations() > before; }));
  stop_workers();
  // Death, when nothing is being written (what is merged after the last checkpoint is tests/farm's).
  ASSERT_TRUE(wait_for(id, [](const auto& s) { return s.checkpoint_iterations() == s.iterations(); }));
  const fs::path grave = folder_ / "after";
  fs::copy(data_, grave, fs::copy_options::recursive);
  stop();
  data_ = grave;
  start();
  EXPECT_EQ(layers_of(show(id)), kLayers);
  ASSERT_LT(show(id).iterations(), kIterations) << "units are too large to test anything";
  permits() = 1 << 20;
  start_workers();
  ASSERT_TRUE(wait_for(id, [](const auto& s) { return s.state() == v1::JOB_STATE_DONE; }))
      << show(id).message();

  const film::MergedFilm expected = expected_film();
  const v1::JobStatus end = show(id);
  EXPECT_EQ(end.light_paths(), 2 * kIterations * kWidth * kHeight);
  EXPECT_EQ(end.rays(), 3 * kIterations * kWidth * kHeight);
  EXPECT_EQ(end.bounded_walks(), kIterations);
  const stats::ErrorInterval interval = stats::error_interval(stats::halves_of(expected, {}));
  EXPECT_EQ(end.relmse_estimate(), interval.relmse);
  EXPECT_EQ(end.relmse_upper(), interval.upper);
  const auto bytes = read_file(
      data_ / "jobs" / id / ("film." + std::to_string(end.checkpoint_generation()) + ".ckpt"), 1 << 28);
  ASSERT_TRUE(bytes.ok());
  EXPECT_TRUE(*bytes == expected.serialise()) << "the last checkpoint";

  for (const bool error_layer : {false, true}) {
    const auto exr = client_->fetch_image(id, {.error_layer = error_layer});
    ASSERT_TRUE(exr.ok()) << exr.error().to_string();
    const fs::path path = put("all.exr", *exr);
    EXPECT_EQ(image::read_image_size(path)->channels, error_layer ? 12U : 9U);
    const auto picture = image::read_image(path);
    ASSERT_TRUE(picture.ok());
    EXPECT_EQ(picture->rgb, expected.develop(0));
    EXPECT_EQ(picture->metadata.at("candela:layers"), "weighted.s2.t3, unweighted.s2.t3");
    EXPECT_EQ(picture->metadata.at("candela:light_paths"),
              std::to_string(2 * kIterations * kWidth * kHeight));
    EXPECT_EQ(picture->metadata.at("candela:rays"), std::to_string(3 * kIterations * kWidth * kHeight));
    EXPECT_EQ(picture->metadata.at("candela:bounded_walks"), std::to_string(kIterations));
    for (std::uint32_t i = 0; i < 2; ++i) {
      const auto layer = image::read_layer(path, kLayers[i]);
      ASSERT_TRUE(layer.ok()) << layer.error().to_string();
      EXPECT_EQ(layer->rgb, expected.develop(i + 1)) << kLayers[i];
    }
    const auto error = image::read_layer(path, "error");
    EXPECT_EQ(error.ok(), error_layer);
    if (error_layer) {
      EXPECT_EQ(error->rgb, stats::error_map(expected));
    }
  }
  const auto alone = client_->fetch_image(id, {.image_only = true});
  ASSERT_TRUE(alone.ok());
  const fs::path path = put("alone.exr", *alone);
  EXPECT_EQ(image::read_image_size(path)->channels, 3U);
  EXPECT_EQ(image::read_image(path)->rgb, expected.develop(0));
  EXPECT_EQ(image::read_image(path)->metadata.count("candela:layers"), 0U);
  check_halves(id, expected);
  // Files that the master writes by itself have the layers, too.
  EXPECT_EQ(image::read_layer(data_ / "jobs" / id / "image.exr", kLayers[1])->rgb, expected.develop(2));
}

}  // namespace
}  // namespace candela
