// Whole farms over jobs of Markov chains (chain_farm.h): any fleet, any death, any delivery.
#include "tests/unit/chain_farm.h"

#include <gtest/gtest.h>

#include <cmath>

#include "common/stages/prefixes.h"
#include "common/stats/image_error.h"

namespace candela::toy {
namespace {

// Claim: one worker or sixteen, even or so uneven that one does nine tenths of the work: sums, chains, b and
// picture are the same to the last bit.
TEST_F(ChainFarm, OneWorker) {
  add_worker(microseconds(50));
  const std::string id = submit(12);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 12);
}
TEST_F(ChainFarm, FourWorkers) {
  for (int i = 0; i < 4; ++i) add_worker(microseconds(200));
  const std::string id = submit(8);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 8);
}
TEST_F(ChainFarm, SixteenWorkers) {
  for (int i = 0; i < 16; ++i) add_worker(microseconds(1000));
  const std::string id = submit(8);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 8);
}
TEST_F(ChainFarm, UnevenWorkers) {
  toy_.plan.chains = 200;
  add_worker(microseconds(400));
  for (int i = 0; i < 3; ++i) add_worker(microseconds(100000));
  const std::string id = submit(20);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 20);
  std::map<std::string, std::uint64_t> segments;
  const v1::GetLedgerResponse account = ledger(id);
  for (const auto& row : account.merged()) segments[row.worker_id()] += row.unit().end() - row.unit().begin();
  std::uint64_t most = 0, all = 0;
  for (const auto& [worker, count] : segments) {
    most = std::max(most, count);
    all += count;
  }
  EXPECT_EQ(segments.size(), 4U) << "some worker did nothing";
  EXPECT_EQ(all, 20 * toy_.plan.chains);
  EXPECT_GE(10 * most, 9 * all) << "the work was even after all";
}

// Claim: where every unit is audited, of the bootstrap and of chains, all comes out the same. One table or
// one segment that is false is never merged, and its worker is distrusted; what it had brought before has the
// job begin anew.
TEST_F(ChainFarm, AuditsOfHonestWorkers) {
  options_.audit_share = 1;
  restart(false);
  for (const char* name : {"a", "b", "c"}) add_worker(microseconds(200), name);
  const std::string id = submit(8);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 8);
}
TEST_F(ChainFarm, AuditsFindAFalseSegment) {
  for (const bool in_bootstrap : {true, false}) {
    SCOPED_TRACE(in_bootstrap);
    workers_.clear();
    options_.audit_share = 1;
    restart(false);
    ToyWorker liar(channel());
    for (const char* name : {"a", "b", "c"}) add_worker(microseconds(200), name);
    const std::string id = submit(8);
    bool lied = false;
    for (int i = 0; i < 20000 && !lied; ++i) {
      const auto lease = liar.HandWorker::acquire();
      if (!lease) {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        if (show(id).state() >= v1::JOB_STATE_DONE) break;
        continue;
      }
      if (lease->unit().kind() == v1::Unit::KIND_PILOT) {
        liar.pilot(*lease);
        continue;
      }
      render::UnitOutput output = ToyWorker::render(*lease);
      const bool bootstrap = lease->unit().kind() == v1::Unit::KIND_BOOTSTRAP;
      if (bootstrap == in_bootstrap) {
        lied = true;
        if (bootstrap)
          output.table.at(0) += 1;
        else
          output.records.at(0).counts.large_sum += 1;
      }
      liar.push(*lease, output);
    }
    EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
    check(id, 8);
    v1::ListWorkersResponse all;
    grpc::ClientContext context;
    ASSERT_TRUE(farm_->ListWorkers(&context, {}, &all).ok());
    EXPECT_EQ(all.distrusted_size(), lied ? 1 : 0);
    if (all.distrusted_size() == 1) {
      EXPECT_TRUE(all.distrusted(0).worker().ends_with("/test"));
      v1::WorkerRequest request;
      request.set_worker_id("test");
      v1::TrustResponse response;
      grpc::ClientContext trust;
      ASSERT_TRUE(farm_->TrustWorker(&trust, request, &response).ok());
    }
  }
}

// Claim: a master that goes away twenty times, from the bootstrap on, and every other time with less on disk
// than its store tells of, loses nothing that counts.
TEST_F(ChainFarm, TheMasterDiesTwentyTimes) {
  toy_.plan.bootstrap_samples = 60000;  // more than five units, whatever the load
  for (int i = 0; i < 2; ++i) add_worker(microseconds(2000));
  const std::string id = submit(60);
  constexpr int kInBootstrap = 5;
  std::uint64_t seen = 0;
  for (int death = 0; death < 20; ++death) {
    const bool early = death < kInBootstrap;
    const v1::JobStatus status = wait_for(id, [&](const v1::JobStatus& s) {
      if (s.state() != v1::JOB_STATE_RUNNING && s.state() != v1::JOB_STATE_QUEUED) return true;
      return early ? s.chains().bootstrap_done() > seen : s.units_merged() > seen;
    });
    ASSERT_EQ(status.state(), v1::JOB_STATE_RUNNING) << "the job ended after " << death << " deaths";
    ASSERT_EQ(status.has_named_state(), !early) << "death " << death;
    restart(death % 2 == 1);
    const v1::JobStatus after = show(id);
    EXPECT_GE(after.chains().bootstrap_done(), status.chains().bootstrap_done());
    seen = death + 1 < kInBootstrap ? after.chains().bootstrap_done() : after.units_merged();
  }
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 60);
}

// Claim: a done job of chains whose newest checkpoint is damaged says so and goes on from the one before when
// it is extended: no segment is offered whose chain's state is lost, another job gets its turns meanwhile,
// and the film is the one that was never damaged.
TEST_F(ChainFarm, ADamagedCheckpointOfADoneJob) {
  add_worker(microseconds(200));
  const std::string id = submit(30);
  wait_end(id);
  farm_.reset();
  master_.reset();
  std::map<std::uint64_t, fs::path> generations;
  for (const auto& e : fs::directory_iterator(options_.data_dir / "jobs" / id))
    if (const std::string n = e.path().filename().string(); n.starts_with("film."))
      generations[std::stoull(n.substr(5))] = e.path();
  ASSERT_EQ(generations.size(), 2U);
  auto bytes = read_file(generations.rbegin()->second, 1 << 28);
  ASSERT_TRUE(bytes.ok());
  (*bytes)[bytes->size() / 2] = static_cast<char>((*bytes)[bytes->size() / 2] ^ 1);
  ASSERT_TRUE(write_file_atomically(generations.rbegin()->second, *bytes).ok());
  start();
  const v1::JobStatus hurt = wait_for(id, [](const v1::JobStatus& s) { return s.lost() > 0; });
  EXPECT_EQ(hurt.state(), v1::JOB_STATE_DONE);
  const std::string other = submit(5);
  v1::ExtendJobRequest request;
  request.set_job_id(id);
  request.set_add_iterations(2);
  v1::JobStatus extended;
  grpc::ClientContext context;
  ASSERT_TRUE(farm_->ExtendJob(&context, request, &extended).ok());
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(wait_end(other).state(), v1::JOB_STATE_DONE);
  check(id, 32);
  check(other, 5);
  v1::ListEventsRequest ask;
  ask.set_job_id(id);
  v1::ListEventsResponse events;
  grpc::ClientContext second;
  ASSERT_TRUE(farm_->ListEvents(&second, ask, &events).ok());
  int returned = 0;
  for (const v1::Event& e : events.events()) returned += e.kind() == "returned" ? 1 : 0;
  EXPECT_LT(returned, 5) << "leases that cannot be prepared";
}

// Claim: workers that fall silent in the midst of bootstrap and segments, that deliver twice, late, or what
// is not theirs cost time and nothing else.
TEST_F(ChainFarm, LostAndRepeatedDeliveries) {
  options_.lease_seconds = 0.3;
  toy_.plan.bootstrap_samples = 160;  // in units of one, since the master counts every one of these workers
  restart(false);
  const std::string id = submit(2);
  auto next = std::make_unique<ToyWorker>(channel());
  int leased = 0, lost = 0, twice = 0;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (show(id).state() < v1::JOB_STATE_DONE && std::chrono::steady_clock::now() < end) {
    const auto lease = next->acquire();
    if (!lease) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      continue;
    }
    const std::unique_ptr<ToyWorker> w = std::exchange(next, std::make_unique<ToyWorker>(channel()));
    // Each seventh lease, not each seventh moment: the last unit, whose lease runs out at even intervals,
    // would else be lost again and again, and wait longer each time.
    if (leased++ % 7 == 0) {
      ++lost;
      continue;
    }
    if (lease->unit().kind() == v1::Unit::KIND_PILOT) {
      ASSERT_TRUE(w->pilot(*lease).ok());
    } else {
      EXPECT_EQ(w->deliver(*lease), v1::DELTA_VERDICT_MERGED);
      twice += w->deliver(*lease) == v1::DELTA_VERDICT_DUPLICATE ? 1 : 0;
    }
  }
  EXPECT_GT(lost, 20);
  EXPECT_GT(twice, 50);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 2);
}

// Claim: records that are not what the unit's chains left are corrupt and change nothing; a unit is never
// merged without them.
TEST_F(ChainFarm, ContradictoryRecordsAreCorrupt) {
  toy_.plan.chains = 400;  // units of more than one, though the master counts all these workers as its own
  const std::string id = submit(2);
  const auto lease = [&](ToyWorker& w) {
    std::optional<v1::Lease> l = w.acquire_soon();
    while (l && l->unit().kind() != v1::Unit::KIND_SEGMENTS) {
      EXPECT_TRUE(l->unit().kind() == v1::Unit::KIND_PILOT ? w.pilot(*l).ok()
                                                           : w.deliver(*l) == v1::DELTA_VERDICT_MERGED);
      l = w.acquire_soon();
    }
    EXPECT_TRUE(l);
    return *l;
  };
  const auto verdict = [&](const std::function<void(render::UnitOutput&)>& spoil) {
    ToyWorker w(channel());
    const v1::Lease l = lease(w);
    render::UnitOutput r = ToyWorker::render(l);
    spoil(r);
    return w.push(l, r).verdict();
  };
  EXPECT_EQ(verdict([](auto& r) { r.records.pop_back(); }), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(verdict([](auto& r) { r.records.push_back(r.records[0]); }), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(verdict([](auto& r) { r.records[0].segments = 2; }), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(verdict([](auto& r) { r.records[0].counts.accepted = 1ULL << 40; }), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(verdict([](auto& r) { r.records.clear(); }), v1::DELTA_VERDICT_CORRUPT);
  ToyWorker w(channel());
  const v1::Lease l = lease(w);
  EXPECT_EQ(w.deliver(l), v1::DELTA_VERDICT_MERGED);
  ToyWorker last(channel());
  while (show(id).iterations() < 2) {
    const auto next = last.acquire_soon();
    ASSERT_TRUE(next);
    last.deliver(*next);
  }
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 2);
}

// Claim: a table of bootstrap samples passes the gate that films pass: changed bytes, another number of
// samples, values that are no contribution, and more rejected samples than there are, are corrupt; a table
// under a lease that is not the sender's is stale; a table twice is a duplicate. b is what it must be.
TEST_F(ChainFarm, TablesPassTheGate) {
  toy_.plan.bootstrap_samples = 200000;  // several units, so that a failed one holds up no other
  const std::string id = submit(2);
  ToyWorker pilot(channel());
  const auto first = pilot.acquire();
  ASSERT_TRUE(first && pilot.pilot(*first).ok());
  const auto lease = [&](ToyWorker& w) {
    const std::optional<v1::Lease> l = w.acquire_soon();
    EXPECT_TRUE(l && l->unit().kind() == v1::Unit::KIND_BOOTSTRAP);
    return l.value_or(v1::Lease());
  };
  const auto verdict = [&](const std::function<void(render::UnitOutput&)>& spoil) {
    ToyWorker w(channel());
    const v1::Lease l = lease(w);
    render::UnitOutput r = ToyWorker::render(l);
    spoil(r);
    return w.push(l, r).verdict();
  };
  EXPECT_EQ(verdict([](auto& r) { r.table.pop_back(); }), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(verdict([](auto& r) { r.table[0] = -1; }), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(verdict([](auto& r) { r.counts.rejected[1] = r.table.size() + 1; }), v1::DELTA_VERDICT_CORRUPT);

  ToyWorker w(channel()), stranger(channel());
  const v1::Lease l = lease(w);
  const render::UnitOutput r = ToyWorker::render(l);
  const film::DeltaInfo info{*wire::from_proto(l.unit()), {}, 0, l.job_id(), std::string(build_id())};
  const std::string bytes = encode_delta(info, r);
  v1::DeltaHeader header = w.header(l, bytes);
  header.set_worker_id(stranger.session.worker_id());
  header.set_session(stranger.session.session());
  EXPECT_EQ(stranger.test::HandWorker::push(header, bytes).verdict(), v1::DELTA_VERDICT_STALE);
  ToyWorker boaster(channel());
  const v1::Lease big = lease(boaster);
  v1::DeltaHeader too_big = boaster.header(big, bytes);
  too_big.set_size_bytes(1ULL << 40);
  EXPECT_EQ(boaster.test::HandWorker::push(too_big, bytes).verdict(), v1::DELTA_VERDICT_CORRUPT);
  EXPECT_EQ(w.push(l, r).verdict(), v1::DELTA_VERDICT_MERGED);
  EXPECT_EQ(w.push(l, r).verdict(), v1::DELTA_VERDICT_DUPLICATE);
  std::string changed = bytes;
  changed[changed.size() / 2] ^= 1;
  ToyWorker spoilt(channel());
  const v1::Lease other = lease(spoilt);
  EXPECT_EQ(spoilt.test::HandWorker::push(spoilt.header(other, bytes), changed).verdict(),
            v1::DELTA_VERDICT_CORRUPT);

  ToyWorker last(channel());
  while (show(id).iterations() < 2)
    if (const auto next = last.acquire_soon()) last.deliver(*next);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 2);
}

// Claim: a pilot of chains that cannot be is refused by its field, and the job stays as it was.
TEST_F(ChainFarm, ImpossiblePilotsAreRefused) {
  const std::string id = submit(2);
  ToyWorker w(channel());
  const auto lease = w.acquire();
  ASSERT_TRUE(lease);
  const auto refused = [&](const char* field, const std::function<void(v1::CompletePilotRequest&)>& spoil) {
    const grpc::Status status = w.pilot(*lease, spoil);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::INVALID_ARGUMENT) << field;
    EXPECT_NE(status.error_message().find(field), std::string::npos) << status.error_message();
  };
  refused("chains.chains", [](auto& r) { r.mutable_work()->mutable_chains()->set_chains(7); });
  refused("chains.segment_mutations",
          [](auto& r) { r.mutable_work()->mutable_chains()->set_segment_mutations(0); });
  refused("layers", [](auto& r) { r.mutable_work()->clear_layers(); });
  EXPECT_FALSE(show(id).has_chains());
  EXPECT_TRUE(w.pilot(*lease).ok());
  EXPECT_TRUE(show(id).has_chains());
  EXPECT_TRUE(std::isnan(show(id).chains().b()));
}

// Claim: the picture converges to the known function, b to its mean, and the estimated errors are of the true
// ones' size. The sum of squared errors over that of estimated variances, of 1320 pixels with one degree of
// freedom each, has a standard deviation near 0.06: 0.25 is four of them, as is the bound of b; together a
// seed in some 8000 fails.
TEST_F(ChainFarm, ThePictureIsTheFunction) {
  toy_.direct = true;
  toy_.plan.segment_mutations = 2000;
  constexpr std::uint64_t kRounds = 50;
  for (int i = 0; i < 2; ++i) add_worker(microseconds(0));
  const std::string id = submit(kRounds);
  const v1::JobStatus end = wait_end(id);
  ASSERT_EQ(end.state(), v1::JOB_STATE_DONE);
  check(id, kRounds);
  const auto picture =
      image::read_image(fetch(id, [](v1::FetchImageRequest& r) { r.set_error_layer(true); }));
  double b = 0, squares = 0, relative = 0, variance = 0;
  const std::uint32_t pixels = kWidth * kHeight;
  for (std::uint32_t p = 0; p < pixels; ++p) b += toy_.f(p) / static_cast<double>(pixels);
  const double mean = b + 0.5;  // g's mean over 1320 pixels is exactly a half
  const Expected& expected = expected_after(kRounds);
  const auto map = stats::error_map(expected.film, expected.development());
  for (std::uint32_t p = 0; p < pixels; ++p) {
    const double truth = toy_.f(p) + toy_.g(p);
    const double error = static_cast<double>(picture->rgb[3 * p]) - truth;
    squares += error * error;
    variance += std::pow(static_cast<double>(map[3 * p]), 2);
    relative += error * error / (truth * truth + 0.01 * mean * mean) / pixels;
  }
  EXPECT_NEAR(squares / variance, 1, 0.25);
  EXPECT_NEAR(relative / end.relmse_estimate(), 1, 0.5);
  EXPECT_LE(relative, end.relmse_upper());
  EXPECT_LT(std::abs(end.chains().b() - b), 4 * end.chains().b_standard_error());
  EXPECT_LT(end.chains().b_standard_error(), 0.01 * b) << "or the line above proves nothing";
  std::uint64_t mutations = 0, large = 0;
  for (const auto& group : end.chains().groups()) {
    mutations += group.mutations();
    large += group.large_steps();
    EXPECT_GT(group.accepted(), 0U);
    EXPECT_GT(group.longest_stay(), 0U);
  }
  EXPECT_EQ(mutations, kRounds * toy_.plan.chains * toy_.plan.segment_mutations);
  EXPECT_NEAR(static_cast<double>(large) / static_cast<double>(mutations), kLargeStep, 0.001);
  EXPECT_EQ(end.chains().b_samples(), toy_.plan.bootstrap_samples + large);
}

// Claim: the status of a job that its error ends tells of the chains of the image, also if the last look at
// the chains was at as many segments, of which some lay beyond the image's.
TEST_F(ChainFarm, StatusFollowsThePrefix) {
  options_.unit_seconds = 1e-6;  // a segment each
  options_.lease_seconds = 60;
  restart(false);
  toy_.plan.chains = 8;
  settings_.integrator_settings = toy_.settings();
  v1::SubmitRequest request = test::submission(kScene, settings_, 1000);
  request.mutable_stop()->set_relmse(1e6);  // ends at the second prefix
  const std::string id = test::submit(*farm_, kScene, request);
  const std::uint64_t half = toy_.plan.chains / 2, second = prefix_after(prefix_of(0, true), true);
  ToyWorker other(channel());
  std::optional<v1::Lease> held;
  std::uint64_t delivered = 0;
  while (delivered < 2 * half * second) {
    const auto lease = other.acquire_soon();
    ASSERT_TRUE(lease) << delivered;
    if (lease->unit().kind() == v1::Unit::KIND_PILOT) {
      ASSERT_TRUE(other.pilot(*lease).ok());
      continue;
    }
    const bool segments = lease->unit().kind() == v1::Unit::KIND_SEGMENTS;
    if (segments) {
      ASSERT_EQ(lease->unit().end() - lease->unit().begin(), 1U);
    }
    if (segments && !held && lease->unit().begin() >= half * (second - 1)) {
      held = lease;
      continue;
    }
    ASSERT_EQ(other.deliver(*lease), v1::DELTA_VERDICT_MERGED);
    delivered += segments ? 1 : 0;
  }
  ASSERT_TRUE(held);
  const std::uint64_t mutations = 2 * half * second * toy_.plan.segment_mutations;
  const auto told = [](const v1::JobStatus& s) {
    std::uint64_t sum = 0;
    for (const auto& group : s.chains().groups()) sum += group.mutations();
    return sum;
  };
  const std::uint64_t shown = ledger(id).chain_segments();
  ASSERT_LT(shown, 2 * half * second) << "nothing lies beyond the prefix";
  wait_for(id, [&](const v1::JobStatus& s) { return told(s) == shown * toy_.plan.segment_mutations; });
  ASSERT_EQ(other.deliver(*held), v1::DELTA_VERDICT_MERGED);
  const v1::JobStatus end = wait_end(id);
  EXPECT_EQ(end.iterations(), second);
  EXPECT_EQ(told(end), mutations);
}

// Claim: an image of chains explains itself; the layers it is made of are there only on request, others
// always unless the image alone is wanted; all of them add up.
TEST_F(ChainFarm, ImagesExplainThemselves) {
  toy_.direct = true;
  add_worker(microseconds(0));
  const std::string id = submit(5);
  const v1::JobStatus end = wait_end(id);
  EXPECT_EQ(std::vector<std::string>(end.layers().begin(), end.layers().end()),
            std::vector<std::string>{"segments"});
  const fs::path plain = fetch(id);
  const auto picture = image::read_image(plain);
  ASSERT_TRUE(picture.ok());
  const auto& m = picture->metadata;
  EXPECT_EQ(m.at("candela:iterations"), "5");
  EXPECT_EQ(m.at("candela:chains"), "40");
  EXPECT_EQ(m.at("candela:segments"), "200");
  EXPECT_EQ(m.at("candela:mutations"), "40000");
  EXPECT_EQ(std::stod(m.at("candela:b")), end.chains().b());
  EXPECT_EQ(m.at("candela:b_samples"), std::to_string(end.chains().b_samples()));
  EXPECT_EQ(std::stod(m.at("candela:bootstrap_b")), end.named_state().bootstrap_b());
  EXPECT_EQ(m.at("candela:layers"), "segments");
  EXPECT_GT(std::stod(m.at("candela:acceptance")), 0.1);
  EXPECT_NE(m.at("candela:rejected_infinite"), "0") << "the bootstrap's";
  EXPECT_TRUE(image::read_layer(plain, "segments").ok());
  EXPECT_FALSE(image::read_layer(plain, "independent").ok());
  const fs::path only = fetch(id, [](v1::FetchImageRequest& r) { r.set_image_only(true); });
  EXPECT_FALSE(image::read_layer(only, "segments").ok());
  EXPECT_EQ(image::read_image(only)->rgb, picture->rgb);
  const fs::path raw = fetch(id, [](v1::FetchImageRequest& r) { r.set_chain_layers(true); });
  const auto chains_part = image::read_layer(raw, "raw.chains"),
             other = image::read_layer(raw, "raw.independent");
  ASSERT_TRUE(chains_part.ok() && other.ok());
  const double factor = end.chains().b() / end.named_state().bootstrap_b();
  for (std::size_t i = 0; i < picture->rgb.size(); ++i)
    ASSERT_NEAR(factor * static_cast<double>(chains_part->rgb[i]) + static_cast<double>(other->rgb[i]),
                static_cast<double>(picture->rgb[i]), 1e-5);
}

// Claim: the image of a half is that of every other chain with the b of all; its counts are of these chains.
TEST_F(ChainFarm, ImagesOfHalves) {
  toy_.direct = true;
  add_worker(microseconds(0));
  const std::string id = submit(5);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  const Expected& expected = expected_after(5);
  const auto whole = image::read_image(fetch(id))->metadata;
  std::uint64_t stays = 0;
  for (const bool second : {false, true}) {
    const auto half = image::read_image(fetch(id, [second](v1::FetchImageRequest& r) {
      r.set_half(second ? v1::FetchImageRequest::HALF_B : v1::FetchImageRequest::HALF_A);
    }));
    ASSERT_TRUE(half.ok());
    EXPECT_EQ(half->rgb,
              film::develop_image(expected.film, expected.development(),
                                  second ? film::MergedFilm::Which::half1 : film::MergedFilm::Which::half0));
    const auto& m = half->metadata;
    EXPECT_EQ(m.at("candela:half"), second ? "B" : "A");
    EXPECT_EQ(m.at("candela:iterations"), "5");
    EXPECT_EQ(m.at("candela:chains"), "20");
    EXPECT_EQ(m.at("candela:segments"), "100");
    EXPECT_EQ(m.at("candela:mutations"), "20000");
    EXPECT_EQ(m.at("candela:b"), whole.at("candela:b"));
    std::uint64_t stay = 0;
    const auto counts = expected.counts();
    for (std::size_t c = second ? 1 : 0; c < counts.size(); c += 2)
      stay = std::max(stay, counts[c].longest_stay);
    EXPECT_EQ(m.at("candela:longest_stay"), std::to_string(stay));
    stays = std::max(stays, stay);
  }
  EXPECT_EQ(whole.at("candela:longest_stay"), std::to_string(stays));
}

// Claim: a job without light ends soon after its bootstrap, black, and says why; light that needs no chain is
// rendered all the same.
TEST_F(ChainFarm, BlackJobs) {
  toy_.black = true;
  for (int i = 0; i < 2; ++i) add_worker(microseconds(0));
  const std::string black = submit(1000000);
  const v1::JobStatus end = wait_end(black);
  EXPECT_EQ(end.state(), v1::JOB_STATE_DONE);
  EXPECT_NE(end.message().find("none of 1000 bootstrap samples found light"), std::string::npos)
      << end.message();
  EXPECT_EQ(end.named_state().film_scale_log2(), kPilotScale);
  EXPECT_EQ(end.chains().b(), 0);
  const auto picture = image::read_image(fetch(black));
  ASSERT_TRUE(picture.ok());
  EXPECT_EQ(picture->rgb, std::vector<float>(std::size_t{kWidth} * kHeight * 3));
  toy_.direct = true;
  const std::string lit = submit(20);
  EXPECT_EQ(wait_end(lit).state(), v1::JOB_STATE_DONE);
  check(lit, 20);
}

// Claim: extended jobs of chains are jobs of all rounds, exactly; paused and resumed on the way.
TEST_F(ChainFarm, PauseAndExtend) {
  add_worker(microseconds(200));
  const std::string id = submit(10);
  wait_for(id, [](const v1::JobStatus& s) { return s.units_merged() > 0; });
  v1::JobRequest request;
  request.set_job_id(id);
  v1::JobStatus out;
  {
    grpc::ClientContext context;
    ASSERT_TRUE(farm_->PauseJob(&context, request, &out).ok());
  }
  restart(false);
  EXPECT_EQ(show(id).state(), v1::JOB_STATE_PAUSED);
  {
    grpc::ClientContext context;
    ASSERT_TRUE(farm_->ResumeJob(&context, request, &out).ok());
  }
  EXPECT_EQ(wait_end(id).iterations(), 10U);
  check(id, 10);
  restart(false);  // what is told of an ended job does not need its film
  EXPECT_EQ(show(id).chains().b_samples(),
            chains::pool(expected_after(10).bootstrap, expected_after(10).counts()).samples);
  v1::ExtendJobRequest more;
  more.set_job_id(id);
  more.set_add_iterations(7);
  grpc::ClientContext context;
  ASSERT_TRUE(farm_->ExtendJob(&context, more, &out).ok());
  EXPECT_EQ(wait_end(id).iterations(), 17U);
  check(id, 17);
}

// Claim: leases of chains with large states stay small enough for a message.
TEST_F(ChainFarm, LargeStatesMakeSmallLeases) {
  toy_.plan.chains = 400;
  toy_.plan.segment_mutations = 2;
  toy_.state_bytes = 60000;
  const std::string id = submit(2);
  ToyWorker w(channel());
  std::size_t largest = 0;
  while (const auto lease = w.acquire()) {
    largest = std::max(largest, lease->ByteSizeLong());
    if (lease->unit().kind() == v1::Unit::KIND_PILOT)
      ASSERT_TRUE(w.pilot(*lease).ok());
    else
      ASSERT_EQ(w.deliver(*lease), v1::DELTA_VERDICT_MERGED);
  }
  EXPECT_GT(largest, 1U << 20);
  EXPECT_LT(largest, 2200000U);
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  check(id, 2);
}

}  // namespace
}  // namespace candela::toy
