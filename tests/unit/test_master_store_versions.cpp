// Stores of later versions than the first ones, as the present one takes them over.
#include <gtest/gtest.h>

#include <filesystem>
#include <set>
#include <string>

#include "tests/temporary_folder.h"
#include "tests/unit/store_database.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;

// Claim: a store of version 5, which counted neither rejected statistics nor repeated merges, becomes the
// present one with its rows as they were, and then holds both counts.
TEST(StoreVersions, TheFifthLearnsToCountStatistics) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "version5.sqlite";
  JobRow j;
  j.id = "j";
  j.bundle_sha256 = "hash";
  j.settings.width = 30;
  j.settings.height = 20;
  j.layers = {"independent"};
  j.chains = ChainPlan{2, 1, 1};
  j.sample_counts.rejected = {1, 2, 3, 4};
  j.bootstrap_rejected = {5, 6, 7, 8};
  BootstrapRow bootstrap;
  bootstrap.job_id = "j";
  bootstrap.contributions = {1};
  bootstrap.rejected = {9, 10, 11, 12};
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{j}, PutBootstrap{bootstrap}}).ok());
  }
  const std::set<std::string> present = Database(path).shape();
  {
    Database old(path);
    old.execute(kWithoutIndices);
    old.execute(kWithoutAudits);
    for (const char* column : {"rejected_statistics", "bootstrap_statistics", "sampled_merges",
                               "repeated_merges", "bounded_walks", "submitter"})
      old.execute(std::string("ALTER TABLE jobs DROP COLUMN ") + column);
    old.execute(
        "ALTER TABLE bootstraps DROP COLUMN rejected_statistics; DROP TABLE overdue; "
        "ALTER TABLE workers DROP COLUMN paused; PRAGMA user_version=5");
    EXPECT_NE(old.shape(), present) << "nothing is tested";
  }
  expect_present(path, present, [&](Store& store, const StoredState& state) {
    EXPECT_EQ(state.jobs.at(0).sample_counts, j.sample_counts);
    EXPECT_EQ(state.jobs[0].bootstrap_rejected, j.bootstrap_rejected);
    EXPECT_EQ(state.bootstraps.at(0).rejected, bootstrap.rejected);
    j.sample_counts.rejected[4] = 13;
    j.bootstrap_rejected[4] = 14;
    j.sample_counts.sampled_merges = 15;
    j.sample_counts.repeated_merges = 16;
    j.sample_counts.bounded_walks = 18;
    bootstrap.rejected[4] = 17;
    ASSERT_TRUE(store.write(std::vector<Change>{PutJob{j}, PutBootstrap{bootstrap}}).ok());
  });
}

// Claim: a store of version 6, which did not count walks that roulette's bound ended, becomes the present one
// with its rows as they were, and then holds the count.
TEST(StoreVersions, TheSixthLearnsToCountBoundedWalks) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "version6.sqlite";
  JobRow j;
  j.id = "j";
  j.bundle_sha256 = "hash";
  j.settings.width = 30;
  j.settings.height = 20;
  j.sample_counts.rejected = {1, 2, 3, 4, 5};
  j.sample_counts.repeated_merges = 6;
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{j}}).ok());
  }
  const std::set<std::string> present = Database(path).shape();
  {
    Database old(path);
    old.execute(kWithoutIndices);
    old.execute(kWithoutAudits);
    old.execute(
        "ALTER TABLE jobs DROP COLUMN bounded_walks; ALTER TABLE jobs DROP COLUMN submitter; "
        "ALTER TABLE workers DROP COLUMN paused; "
        "PRAGMA user_version=6");
    EXPECT_NE(old.shape(), present) << "nothing is tested";
  }
  expect_present(path, present, [&](Store& store, const StoredState& state) {
    EXPECT_EQ(state.jobs.at(0).sample_counts, j.sample_counts);
    j.sample_counts.bounded_walks = 7;
    ASSERT_TRUE(store.write(std::vector<Change>{PutJob{j}}).ok());
  });
}

// Claim: a store of version 7, in which no worker was paused, becomes the present one with its workers as
// they were, and then keeps a pause.
TEST(StoreVersions, TheSeventhLearnsToPauseWorkers) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "version7.sqlite";
  WorkerRow w;
  w.id = "w";
  w.name = "node";
  w.draining = true;
  w.last_seen_unix_ms = 12;
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutWorker{w}}).ok());
  }
  const std::set<std::string> present = Database(path).shape();
  {
    Database old(path);
    old.execute(kWithoutIndices);
    old.execute(kWithoutAudits);
    old.execute("ALTER TABLE jobs DROP COLUMN submitter; ALTER TABLE workers DROP COLUMN paused");
    old.execute("PRAGMA user_version=7");
    EXPECT_NE(old.shape(), present) << "nothing is tested";
  }
  expect_present(path, present, [&](Store& store, const StoredState& state) {
    EXPECT_EQ(state.workers.at(0).paused, w.paused);
    EXPECT_TRUE(state.workers[0].draining);
    EXPECT_EQ(state.workers[0].last_seen_unix_ms, 12);
    w.paused = true;
    ASSERT_TRUE(store.write(std::vector<Change>{PutWorker{w}}).ok());
  });
}

// Claim: a store of version 8, which did not keep who submitted a job, becomes the present one: nobody is
// known to have submitted its jobs. Then it keeps submitters.
TEST(StoreVersions, TheEighthLearnsSubmitters) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "version8.sqlite";
  JobRow j;
  j.id = "j";
  j.bundle_sha256 = "hash";
  j.submitter = "forgotten";
  j.settings.width = 30;
  j.settings.height = 20;
  j.sample_counts.bounded_walks = 7;
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{j}}).ok());
  }
  const std::set<std::string> present = Database(path).shape();
  {
    Database old(path);
    old.execute(kWithoutIndices);
    old.execute(kWithoutAudits);
    old.execute("ALTER TABLE jobs DROP COLUMN submitter; PRAGMA user_version=8");
    EXPECT_NE(old.shape(), present) << "nothing is tested";
  }
  std::string expected;
  expect_present(path, present, [&](Store& store, const StoredState& state) {
    EXPECT_EQ(state.jobs.at(0).sample_counts, j.sample_counts);
    EXPECT_EQ(state.jobs[0].submitter, expected);
    j.submitter = expected = "alice@somewhere";
    ASSERT_TRUE(store.write(std::vector<Change>{PutJob{j}}).ok());
  });
}

// Claim: a store of version 9, in which nobody was distrusted and no unit told its content, becomes the
// present one with its rows as they were and a secret of its own, which stays. Then it keeps who made what,
// and who is distrusted; a job that begins anew loses its units.
TEST(StoreVersions, TheNinthLearnsAudits) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "version9.sqlite";
  JobRow j;
  j.id = "j";
  j.bundle_sha256 = "hash";
  j.submitter = "alice@somewhere";
  j.settings.width = 30;
  j.settings.height = 20;
  UnitRow u;
  u.id = 7;
  u.job_id = "j";
  u.unit = {Unit::Kind::iterations, 1, 4, 6};
  u.state = UnitRow::State::merged;
  u.worker_id = "w";
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{j}, PutUnit{u}}).ok());
  }
  const std::set<std::string> present = Database(path).shape();
  {
    Database old(path);
    old.execute(kWithoutIndices);
    old.execute(kWithoutAudits);
    old.execute("PRAGMA user_version=9");
    EXPECT_NE(old.shape(), present) << "nothing is tested";
  }
  JobAudit audit;
  std::vector<std::string> by;
  std::string sha256;
  std::uint64_t secret = 0;
  std::size_t distrusted = 0;
  expect_present(path, present, [&](Store& store, const StoredState& state) {
    EXPECT_EQ(state.jobs.at(0).submitter, j.submitter);
    EXPECT_EQ(state.jobs[0].audit, audit);
    EXPECT_NE(state.audit_secret, 0U);
    if (secret != 0) {
      EXPECT_EQ(state.audit_secret, secret);
    }
    secret = state.audit_secret;
    EXPECT_EQ(state.distrusted.size(), distrusted);
    const auto merged = store.merged_units("j");
    ASSERT_TRUE(merged.ok());
    ASSERT_EQ(merged->size(), 1U);
    EXPECT_EQ(merged->at(0).by, by);
    EXPECT_EQ(merged->at(0).sha256, sha256);
    // Before a unit tells who made it, the worker's id does.
    const std::map<std::string, std::uint64_t> one{{"j", 1}};
    EXPECT_EQ(*store.units_by("host/x", {"v", "w"}, ""), one);
    EXPECT_EQ(store.units_by("host/x", {"v"}, "")->size(), by.empty() ? 0U : 1U);
    EXPECT_EQ(store.units_by("host/x", {"w"}, "k")->size(), 0U);
    EXPECT_EQ(store.units_by("host", {}, "")->size(), 0U);
    audit = {"hash", {"host/a", "host/b"}, true, {"host/c"}, "why", {{"host/x", 5, 6}}};
    by = {"host/a b", "host/x"};
    sha256 = std::string(64, 'a');
    JobRow changed = j;
    changed.audit = audit;
    UnitRow unit = u;
    unit.by = by;
    unit.sha256 = sha256;
    distrusted = 1;
    ASSERT_TRUE(
        store
            .write(std::vector<Change>{PutJob{changed}, PutUnit{unit}, PutDistrust{{"host/x", 5, "a reason"}},
                                       PutDistrust{{"host/y", 6, "another"}}, DropDistrust{"host/y"}})
            .ok());
  });
  auto store = open_sqlite_store(path);
  ASSERT_TRUE(store.ok());
  const auto state = (*store)->load();
  ASSERT_TRUE(state.ok());
  EXPECT_EQ(state->distrusted.at(0).worker, "host/x");
  EXPECT_EQ(state->distrusted[0].reason, "a reason");
  EXPECT_EQ(state->distrusted[0].since_unix_ms, 5);
  ASSERT_TRUE((*store)->write(std::vector<Change>{ForgetWork{"j"}}).ok());
  EXPECT_TRUE((*store)->merged_units("j")->empty());
  EXPECT_EQ((*store)->load()->jobs.size(), 1U);
}

// Claim: a store of version 10, which knew neither exact indices nor paths of scenes, becomes the present one
// with its jobs as they were, and then keeps both.
TEST(StoreVersions, TheTenthLearnsExactIndices) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "version10.sqlite";
  JobRow j;
  j.id = "j";
  j.bundle_sha256 = "hash";
  j.settings.width = 30;
  j.settings.height = 20;
  j.stop.iterations = 5;
  j.audit.anew = "why";
  j.promised[1].insert(2, 4);
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{j}}).ok());
  }
  const std::set<std::string> present = Database(path).shape();
  {
    Database old(path);
    old.execute(kWithoutIndices);
    old.execute("PRAGMA user_version=10");
    EXPECT_NE(old.shape(), present) << "nothing is tested";
  }
  expect_present(path, present, [&](Store& store, const StoredState& state) {
    const JobRow& read = state.jobs.at(0);
    EXPECT_EQ(read.stop.iterations, j.stop.iterations);
    EXPECT_EQ(read.audit, j.audit);
    EXPECT_EQ(read.promised, j.promised);
    EXPECT_EQ(read.stop_indices, j.stop_indices);
    EXPECT_EQ(read.scene_path, j.scene_path);
    j.stop.iterations = 0;
    j.stop_indices = *film::parse_half_indices("0-31,40-47/none");
    j.scene_path = "scenes/a box.xml";
    ASSERT_TRUE(store.write(std::vector<Change>{PutJob{j}}).ok());
  });
}

// Claim: a store of version 11, which kept nothing of what pilots decided, becomes the present one: jobs
// whose pilot is done are known to lack that, but for those of chains, and others are not. Then it is kept,
// whatever its bytes.
TEST(StoreVersions, TheEleventhLearnsDecisions) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "version11.sqlite";
  JobRow planned;
  planned.id = "a";
  planned.bundle_sha256 = "hash";
  planned.settings.width = planned.settings.height = 20;
  planned.named_state = NamedState{3};
  planned.decided = "what nobody kept";
  JobRow waits = planned, chains = planned;
  waits.id = "b";
  waits.named_state.reset();
  chains.id = "c";
  chains.layers = {"independent"};
  chains.chains = ChainPlan{2, 1, 1};
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{planned}, PutJob{waits}, PutJob{chains}}).ok());
  }
  const std::set<std::string> present = Database(path).shape();
  {
    Database old(path);
    old.execute(kWithoutDecisions);
    old.execute("PRAGMA user_version=11");
    EXPECT_NE(old.shape(), present) << "nothing is tested";
  }
  const std::string bytes("\0\xff'\n", 4);
  bool first = true;
  expect_present(path, present, [&](Store& store, const StoredState& state) {
    ASSERT_EQ(state.jobs.size(), 3U);
    EXPECT_EQ(state.jobs[0].pilot_outdated, first);
    EXPECT_EQ(state.jobs[0].decided, first ? "" : bytes);
    EXPECT_FALSE(state.jobs[1].pilot_outdated || state.jobs[2].pilot_outdated);
    JobRow row = state.jobs[0];
    ASSERT_TRUE(store.write(std::vector<Change>{PutJob{row}}).ok());
    EXPECT_EQ(store.load()->jobs[0].pilot_outdated, first) << "a job that is only looked at";
    row.pilot_outdated = false;
    row.decided = bytes;
    ASSERT_TRUE(store.write(std::vector<Change>{PutJob{row}}).ok());
    first = false;
  });
}

// Claim: a store of version 12, which knew neither groups nor jobs that wait for others, becomes the present
// one with its jobs as they were, and then keeps both.
TEST(StoreVersions, TheTwelfthLearnsGroups) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "version12.sqlite";
  JobRow j;
  j.id = "j";
  j.bundle_sha256 = "hash";
  j.settings.width = 30;
  j.settings.height = 20;
  j.scene_path = "scenes/a box.xml";
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{j}}).ok());
  }
  const std::set<std::string> present = Database(path).shape();
  {
    Database old(path);
    old.execute(kWithoutGroups);
    old.execute("PRAGMA user_version=12");
    EXPECT_NE(old.shape(), present) << "nothing is tested";
  }
  expect_present(path, present, [&](Store& store, const StoredState& state) {
    const JobRow& read = state.jobs.at(0);
    EXPECT_EQ(read.scene_path, j.scene_path);
    EXPECT_EQ(read.frame, j.frame);
    EXPECT_EQ(read.depends, j.depends);
    j.frame = FrameRow{"gabc", "a shot", -7, 240};
    j.depends = {"jone", "gtwo"};
    ASSERT_TRUE(store.write(std::vector<Change>{PutJob{j}}).ok());
  });
}

// Claim: a store of version 13, which did not keep whose work a job has, becomes the present one; a job that
// had work is of a build that is not known, one without work of none, and then builds are kept.
TEST(StoreVersions, TheThirteenthLearnsBuilds) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "version13.sqlite";
  JobRow begun;
  begun.id = "j1";
  begun.bundle_sha256 = "hash";
  begun.settings.width = 30;
  begun.settings.height = 20;
  begun.named_state = NamedState{3};
  JobRow queued = begun;
  queued.id = "j2";
  queued.named_state.reset();
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{begun}, PutJob{queued}}).ok());
  }
  const std::set<std::string> present = Database(path).shape();
  Database(path).execute("ALTER TABLE jobs DROP COLUMN builds; PRAGMA user_version=13");
  begun.builds = {kUnknownBuild};
  expect_present(path, present, [&](Store& store, const StoredState& state) {
    EXPECT_EQ(state.jobs.at(0).builds, begun.builds);
    EXPECT_EQ(state.jobs.at(1).builds, queued.builds);
    begun.builds = queued.builds = {"0.1.0-a", "0.1.0-b"};
    ASSERT_TRUE(store.write(std::vector<Change>{PutJob{begun}, PutJob{queued}}).ok());
  });
  // Version 14 has the present tables.
  Database(path).execute("PRAGMA user_version=14");
  expect_present(path, present,
                 [&](Store&, const StoredState& state) { EXPECT_EQ(state.jobs.at(0).builds, begun.builds); });
}

// Claim: columns are found by their names, wherever in their table they stand; one that is missing is an
// error, not another's value.
TEST(StoreVersions, ColumnsAreFoundByName) {
  const test::TemporaryFolder folder;
  const fs::path path = folder.path() / "store.sqlite";
  JobRow j;
  j.id = "j";
  j.bundle_sha256 = "hash";
  j.settings.width = 30;
  j.settings.height = 20;
  j.layers = {"direct", "indirect"};
  j.named_state = NamedState{3};
  j.share = 2.5;
  j.sample_counts.rays = 77;
  j.submitter = "ann";
  UnitRow u;
  u.id = 5;
  u.job_id = "j";
  u.unit = {Unit::Kind::iterations, 1, 4, 6};
  u.token = 9;
  u.by = {"host/a", "host/b"};
  WorkerRow w;
  w.id = "w";
  w.isas = {"avx2", "avx512"};
  w.units_failed = 6;
  w.paused = true;
  const auto same = [&](const StoredState& state) {
    const JobRow& job = state.jobs.at(0);
    EXPECT_EQ(job.layers, j.layers);
    EXPECT_EQ(job.named_state->film_scale_log2, 3);
    EXPECT_EQ(job.share, j.share);
    EXPECT_EQ(job.sample_counts, j.sample_counts);
    EXPECT_EQ(job.submitter, j.submitter);
    const UnitRow& unit = state.unmerged_units.at(0);
    EXPECT_EQ(unit.unit.half, u.unit.half);
    EXPECT_EQ(unit.unit.begin, u.unit.begin);
    EXPECT_EQ(unit.unit.end, u.unit.end);
    EXPECT_EQ(unit.token, u.token);
    EXPECT_EQ(unit.by, u.by);
    const WorkerRow& worker = state.workers.at(0);
    EXPECT_EQ(worker.isas, w.isas);
    EXPECT_EQ(worker.units_failed, w.units_failed);
    EXPECT_TRUE(worker.paused && !worker.draining);
  };
  const std::vector<Change> all{PutJob{j}, PutUnit{u}, PutWorker{w}};
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    ASSERT_TRUE((*store)->write(all).ok());
  }
  for (const char* moved : {"jobs.name TEXT", "jobs.share REAL", "jobs.rays INTEGER", "units.half INTEGER",
                            "units.token INTEGER", "workers.threads INTEGER", "workers.draining INTEGER"}) {
    const std::string text(moved);
    const std::size_t dot = text.find('.'), space = text.find(' ');
    const std::string table = text.substr(0, dot), column = text.substr(dot + 1, space - dot - 1);
    Database old(path);
    old.execute(("ALTER TABLE " + table + " ADD COLUMN moved" + text.substr(space) + "; UPDATE " + table +
                 " SET moved = " + column + "; ALTER TABLE " + table + " DROP COLUMN " + column +
                 "; ALTER TABLE " + table + " RENAME COLUMN moved TO " + column)
                    .c_str());
  }
  {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok());
    const auto read = (*store)->load();
    ASSERT_TRUE(read.ok()) << read.error().to_string();
    same(*read);
    ASSERT_TRUE((*store)->write(all).ok());
    same(*(*store)->load());
  }
  Database(path).execute("ALTER TABLE workers DROP COLUMN threads");
  auto store = open_sqlite_store(path);
  ASSERT_TRUE(store.ok());
  EXPECT_FALSE((*store)->load().ok());
}

}  // namespace
}  // namespace candela::master
