// A whole master in this process, over its in-process channel, with workers that make deltas from a hash
// instead of rendering.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <array>
#include <string>

#include "common/base/files.h"
#include "common/base/log.h"
#include "common/film/film.h"
#include "common/rng/stream.h"
#include "master/master.h"
#include "tests/expect_invariants.h"
#include "tests/temporary_folder.h"
#include "tests/unit/farm_calls.h"
#include "tests/unit/hand_worker.h"

namespace candela::master {

inline constexpr std::uint32_t kWidth = 40, kHeight = 33;  // four tiles, two of them cut
inline const std::string kScene = "<scene version='3.0.0'/>";

// A value for each iteration and pixel that anybody can compute again, changed by change(i, x, y, color).
template <class Change>
std::string make_changed_delta(const Unit& unit, const std::string& job, int scale, const std::string& build,
                               Change&& change) {
  film::UnitFilm film({kWidth, kHeight, 1}, scale);
  film::SampleCounts sample_counts;
  for (std::uint64_t i = unit.begin; i < unit.end; ++i)
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x) {
        const std::uint64_t key = rng::key(unit.half, i, y, x);
        const float v = 1 + rng::to_float(static_cast<std::uint32_t>(key));
        sample_counts.eye_samples += 1;
        std::array<float, 3> color = {v, v * 0.5F, v * 0.25F};
        change(i, x, y, color);
        film.add(0, x, y, {color[0], color[1], color[2]}, key, sample_counts);
      }
  film.count(sample_counts);
  return film::encode_delta(film, {unit, film.layout(), scale, job, build});
}

// Result of "rendering".
inline std::string make_delta(const Unit& unit, const std::string& job, int scale, const std::string& build) {
  return make_changed_delta(unit, job, scale, build, [](auto&&...) {});
}

class TestWorker : public test::HandWorker {
 public:
  using HandWorker::HandWorker;
  bool pilot(const v1::Lease& lease) {
    v1::CompletePilotRequest request;
    sign(request, lease);
    request.mutable_named_state()->set_film_scale_log2(20);
    request.set_plan("the plan");
    request.set_seconds_per_iteration(0.5);
    return complete(request);
  }
  static std::string render(const v1::Lease& lease) {
    return make_delta(*wire::from_proto(lease.unit()), lease.job_id(), lease.named_state().film_scale_log2(),
                      std::string(build_id()));
  }
  v1::DeltaVerdict deliver(const v1::Lease& lease) {
    const std::string bytes = render(lease);
    return push(header(lease, bytes), bytes).verdict();
  }
  // One lease, done; false if there was none.
  bool step() {
    const auto lease = acquire();
    if (!lease) return false;
    if (lease->unit().kind() == v1::Unit::KIND_PILOT) return pilot(*lease);
    return deliver(*lease) == v1::DELTA_VERDICT_MERGED;
  }
};

class MasterTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_TRUE(log::initialise("test", "off", "text").ok());
    start();
  }
  void start() {
    MasterOptions o;
    o.data_dir = folder.path();
    o.listen.clear();
    o.checkpoint_seconds = checkpoint_seconds;
    o.unit_seconds = 1;
    o.lease_seconds = lease_seconds;
    o.keep_finished_seconds = keep_finished_seconds;
    o.blob_grace_seconds = blob_grace_seconds;
    o.memory_bytes = memory_bytes;
    o.audit_share = audit_share;
    o.notify = notify;
    o.http_listen = http_listen;
    o.page_token_file = page_token_file;
    o.observer = test::expect_invariants();
    auto m = Master::start(o);
    ASSERT_TRUE(m.ok()) << m.error().to_string();
    master = std::move(*m);
    channel = master->in_process_channel();
    farm = v1::FarmService::NewStub(channel);
  }
  void restart() {
    farm.reset();
    channel.reset();
    master.reset();
    start();
  }
  grpc::Status upload(const std::string& bytes, const std::string& hash, std::uint64_t size) {
    return test::upload(*farm, bytes, hash, size);
  }
  static v1::SubmitRequest submission(std::uint64_t iterations) {
    JobSettings settings;
    settings.width = kWidth;
    settings.height = kHeight;
    return test::submission(kScene, settings, iterations);
  }
  std::string submit(std::uint64_t iterations) { return test::submit(*farm, kScene, submission(iterations)); }
  v1::JobStatus show(const std::string& id) { return test::show(*farm, id); }
  v1::JobStatus wait_end(const std::string& id) {
    v1::WatchJobRequest request;
    request.set_job_id(id);
    request.set_interval_ms(20);
    grpc::ClientContext context;
    context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(10));
    v1::JobStatus out;
    auto stream = farm->WatchJob(&context, request);
    while (stream->Read(&out)) {
    }
    EXPECT_TRUE(stream->Finish().ok());
    return out;
  }
  std::string fetch(const std::string& id) {
    v1::FetchImageRequest request;
    request.set_job_id(id);
    return test::fetch(*farm, request);
  }
  // The ledger of rows and the film's own account must be one: no overlap, no gap, and the right number of
  // samples.
  void audit(const std::string& id, std::uint64_t iterations) {
    const v1::GetLedgerResponse ledger = test::ledger(*farm, id);
    std::array<film::IndexSet, 2> rows, film;
    for (const auto& r : ledger.merged())
      EXPECT_TRUE(rows[r.unit().half()].insert(r.unit().begin(), r.unit().end()));
    for (const auto& r : ledger.film()) EXPECT_TRUE(film[r.half()].insert(r.begin(), r.end()));
    for (int h = 0; h < 2; ++h) {
      const std::uint64_t n = h == 0 ? (iterations + 1) / 2 : iterations / 2;
      const auto half = static_cast<std::size_t>(h);
      EXPECT_EQ(rows[half].count(), n);
      EXPECT_EQ(film[half].count(), n);
      EXPECT_EQ(rows[half].first_gap(0, n).first, rows[half].first_gap(0, n).second);
      EXPECT_EQ(film[half].first_gap(0, n).first, film[half].first_gap(0, n).second);
    }
    EXPECT_EQ(ledger.film_eye_samples(), iterations * kWidth * kHeight);
  }
  // The newest checkpoint's sums: what every run of the same iterations must agree on to the last bit.
  film::MergedFilm checkpoint_of(const std::string& id) {
    const std::uint64_t g = show(id).checkpoint_generation();
    auto bytes = read_file(folder.path() / "jobs" / id / ("film." + std::to_string(g) + ".ckpt"), 1 << 28);
    EXPECT_TRUE(bytes.ok());
    auto film = film::MergedFilm::parse(*bytes);
    EXPECT_TRUE(film.ok());
    return std::move(*film);
  }

  test::TemporaryFolder folder;
  double checkpoint_seconds = 0.05, lease_seconds = 30;
  double keep_finished_seconds = 0, blob_grace_seconds = 3600;
  std::uint64_t memory_bytes = 0;
  double audit_share = 0;
  std::string notify, http_listen, page_token_file;
  std::unique_ptr<Master> master;
  std::shared_ptr<grpc::Channel> channel;
  std::unique_ptr<v1::FarmService::Stub> farm;
};

// The film that so many iterations must give, made without a master.
inline film::MergedFilm expected_film(std::uint64_t iterations) {
  film::MergedFilm film({kWidth, kHeight, 1}, 20);
  for (std::uint32_t h = 0; h < 2; ++h) {
    const Unit unit{Unit::Kind::iterations, h, 0, h == 0 ? (iterations + 1) / 2 : iterations / 2};
    auto delta = film::Delta::decode(make_delta(unit, "x", 20, "b"), film.layout());
    EXPECT_TRUE(delta.ok() && film.merge(*delta).ok());
  }
  return film;
}

inline void expect_same(const film::MergedFilm& a, const film::MergedFilm& b) {
  for (std::uint32_t h = 0; h < 2; ++h) {
    EXPECT_EQ(a.merged(h), b.merged(h));
    EXPECT_EQ(a.sample_counts(h), b.sample_counts(h));
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x)
        for (int c = 0; c < 3; ++c) ASSERT_TRUE(a.sum(h, 0, x, y, c) == b.sum(h, 0, x, y, c));
  }
}

}  // namespace candela::master
