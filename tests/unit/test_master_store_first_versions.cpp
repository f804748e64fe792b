// Stores of the first versions, made with the tables that those versions made, as the present one takes them
// over.
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <set>
#include <string>

#include "common/wire/wire.h"
#include "tests/temporary_folder.h"
#include "tests/unit/store_database.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;

// The tables of version 1 in full; version 2 had one more column of jobs.
std::string tables_of_version(int version) {
  return std::string(R"sql(
CREATE TABLE counters (name TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE jobs (
  id TEXT PRIMARY KEY, name TEXT NOT NULL, bundle TEXT NOT NULL, settings BLOB NOT NULL,
  stop_iterations INTEGER NOT NULL, stop_time_seconds REAL NOT NULL, stop_relmse REAL NOT NULL,
  priority INTEGER NOT NULL, share REAL NOT NULL, token TEXT NOT NULL, digest TEXT NOT NULL,
  state TEXT NOT NULL, message TEXT NOT NULL, stop_reason TEXT NOT NULL,
  film_scale_log2 INTEGER, plan TEXT NOT NULL, thread_seconds_per_iteration REAL NOT NULL,
  submitted_unix_ms INTEGER NOT NULL, finished_unix_ms INTEGER NOT NULL,
  elapsed_seconds REAL NOT NULL, worker_seconds REAL NOT NULL,
  units_merged INTEGER NOT NULL, iterations INTEGER NOT NULL,
  eye_samples INTEGER NOT NULL, light_paths INTEGER NOT NULL, rays INTEGER NOT NULL,
  rejected_nan INTEGER NOT NULL, rejected_infinite INTEGER NOT NULL, rejected_negative INTEGER NOT NULL,
  rejected_saturated INTEGER NOT NULL, relmse REAL,
  checkpoint_generation INTEGER NOT NULL, checkpoint_iterations INTEGER NOT NULL)sql") +
         (version > 1 ? ",\n  layers TEXT NOT NULL DEFAULT ''" : "") + R"sql() WITHOUT ROWID;
CREATE TABLE units (
  id INTEGER PRIMARY KEY, job TEXT NOT NULL, kind INTEGER NOT NULL, half INTEGER NOT NULL,
  first INTEGER NOT NULL, last INTEGER NOT NULL, state INTEGER NOT NULL, failures INTEGER NOT NULL,
  worker TEXT NOT NULL, token INTEGER NOT NULL, seconds REAL NOT NULL);
CREATE INDEX units_by_job ON units (job, state);
CREATE TABLE leases (
  token INTEGER PRIMARY KEY, unit INTEGER NOT NULL, job TEXT NOT NULL, worker TEXT NOT NULL,
  expected_seconds REAL NOT NULL, speculative INTEGER NOT NULL);
CREATE TABLE workers (
  id TEXT PRIMARY KEY, session TEXT NOT NULL, name TEXT NOT NULL, host TEXT NOT NULL, build_id TEXT NOT NULL,
  threads INTEGER NOT NULL, isas TEXT NOT NULL, draining INTEGER NOT NULL, units_merged INTEGER NOT NULL,
  units_failed INTEGER NOT NULL, last_seen_unix_ms INTEGER NOT NULL) WITHOUT ROWID;
CREATE TABLE events (
  id INTEGER PRIMARY KEY AUTOINCREMENT, unix_ms INTEGER NOT NULL, job TEXT NOT NULL, worker TEXT NOT NULL,
  kind TEXT NOT NULL, message TEXT NOT NULL);
CREATE INDEX events_by_job ON events (job, id);
CREATE TABLE bundles (sha256 TEXT PRIMARY KEY, bytes BLOB NOT NULL) WITHOUT ROWID;
INSERT INTO counters VALUES ('epoch', 3);
INSERT INTO units VALUES (7, 'j', 2, 1, 4, 6, 1, 2, 'w', 99, 0.5);
INSERT INTO units VALUES (8, 'j', 2, 0, 0, 4, 2, 0, 'w', 98, 0.25);
INSERT INTO leases VALUES (99, 7, 'j', 'w', 1.5, 0);
INSERT INTO workers VALUES ('w', 's', 'name', 'host', 'b', 4, 'avx2', 0, 5, 1, 1000);
INSERT INTO events (unix_ms, job, worker, kind, message) VALUES (5, 'j', 'w', 'kind', 'text');
INSERT INTO bundles VALUES ('hash', x'0102');
PRAGMA user_version=)sql" +
         std::to_string(version) + ";";
}

void put_job(sqlite3* db, const JobSettings& settings, int version) {
  v1::JobSettings message;
  wire::to_proto(settings, message);
  const std::string bytes = message.SerializeAsString();
  const std::string sql =
      std::string(
          "INSERT INTO jobs VALUES ('j', 'a job', 'hash', ?, 7, 0, 0, 0, 1, '', '', 'running', '', "
          "'', 13, 'the plan', 0.5, 1, 0, 2, 3, 1, 4, 100, 0, 200, 1, 2, 3, 4, NULL, 5, 4") +
      (version > 1 ? ", 's2.t3,s3.t2')" : ")");
  sqlite3_stmt* statement = nullptr;
  ASSERT_EQ(sqlite3_prepare_v2(db, sql.c_str(), -1, &statement, nullptr), SQLITE_OK) << sqlite3_errmsg(db);
  sqlite3_bind_blob(statement, 1, bytes.data(), static_cast<int>(bytes.size()), SQLITE_TRANSIENT);
  EXPECT_EQ(sqlite3_step(statement), SQLITE_DONE) << sqlite3_errmsg(db);
  sqlite3_finalize(statement);
}

// Claim: a store of version 1 or 2 becomes one that differs in nothing from a new one but for its rows, and
// those are read as they were: jobs without layers or chains that they could not have, units, leases,
// workers, events, bundles, the epoch. Then it holds jobs of chains, and opening it again changes nothing.
TEST(StoreVersions, EarlierOnesBecomeThePresentOne) {
  JobSettings settings;
  settings.width = 30;
  settings.height = 20;
  settings.integrator_settings = {{"max_depth", "7"}};
  const test::TemporaryFolder folder;
  const fs::path fresh = folder.path() / "fresh.sqlite";
  ASSERT_TRUE(open_sqlite_store(fresh).ok());
  const std::set<std::string> present = Database(fresh).shape();
  ASSERT_GT(present.size(), 50U);
  for (const int version : {1, 2}) {
    SCOPED_TRACE(version);
    const fs::path path = folder.path() / ("version" + std::to_string(version) + ".sqlite");
    {
      Database old(path);
      old.execute(tables_of_version(version));
      put_job(old.handle(), settings, version);
      EXPECT_NE(old.shape(), present) << "nothing is tested";
    }
    for (int opening = 0; opening < 2; ++opening) {
      auto store = open_sqlite_store(path);
      ASSERT_TRUE(store.ok()) << store.error().to_string();
      EXPECT_EQ(Database(path).shape(), present);
      const auto state = (*store)->load();
      ASSERT_TRUE(state.ok()) << state.error().to_string();
      ASSERT_EQ(state->jobs.size(), static_cast<std::size_t>(1 + opening));
      const JobRow& j = state->jobs[0];
      EXPECT_EQ(j.id, "j");
      EXPECT_EQ(j.settings.width, 30U);
      EXPECT_EQ(j.settings.integrator_settings, settings.integrator_settings);
      EXPECT_EQ(j.named_state->film_scale_log2, 13);
      EXPECT_EQ(j.plan, "the plan");
      EXPECT_EQ(j.sample_counts.rejected, (std::array<std::uint64_t, film::kRejectCauses>{1, 2, 3, 4}));
      EXPECT_EQ(j.sample_counts.sampled_merges, 0U);
      EXPECT_EQ(j.checkpoint_generation, 5U);
      EXPECT_EQ(j.layers,
                version == 1 ? std::vector<std::string>() : (std::vector<std::string>{"s2.t3", "s3.t2"}));
      EXPECT_FALSE(j.chains);
      EXPECT_EQ(j.named_state->bootstrap_b, 0);
      ASSERT_EQ(state->unmerged_units.size(), 1U);
      EXPECT_EQ(state->unmerged_units[0].id, 7U);
      EXPECT_EQ(state->unmerged_units[0].unit.kind, Unit::Kind::iterations);
      EXPECT_EQ((*store)->merged_units("j")->at(0).unit.end, 4U);
      ASSERT_EQ(state->leases.size(), 1U);
      EXPECT_EQ(state->leases[0].token, 99U);
      ASSERT_EQ(state->workers.size(), 1U);
      EXPECT_EQ(state->workers[0].threads, 4U);
      EXPECT_EQ((*store)->events("j", 10)->size(), 1U);
      EXPECT_EQ((*store)->bundle("hash")->value(), std::string("\x01\x02"));
      EXPECT_TRUE(state->bootstraps.empty());
      EXPECT_EQ(*(*store)->next_epoch(), static_cast<std::uint64_t>(4 + opening));
      JobRow chains = j;
      chains.id = "k";
      chains.layers = {"independent"};
      chains.chains = ChainPlan{2, 1, 1};
      ASSERT_TRUE((*store)->write(std::vector<Change>{PutJob{chains}, PutStarts{"k", {0, 0}}}).ok());
      EXPECT_EQ((*store)->load()->jobs.at(1).chains->chains, 2U);
      EXPECT_FALSE(j.epochs);
      EXPECT_TRUE(j.accumulators.empty());
      EXPECT_TRUE(state->states.empty() || opening > 0);
      JobRow epochs = j;
      epochs.id = "k";
      epochs.layers.clear();
      epochs.accumulators = {{"squares", 3, 12, film::AccumulatorSpec::Per::epoch}};
      epochs.epochs = EpochPlan{8, 16, 1, "rule", {{"threshold", "7"}}};
      epochs.development = DevelopmentPlan{"mis", {{"estimator", "direct"}}};
      const std::vector<StateRow> states{{"k", 0, "rule", std::string(64, 'a'), 5},
                                         {"k", 1, "rule", std::string(64, 'b'), 6}};
      ASSERT_TRUE((*store)
                      ->write(std::vector<Change>{PutJob{epochs}, PutState{states[1]}, PutState{states[0]},
                                                  PutState{states[1]}})
                      .ok());
      const auto again = (*store)->load();
      ASSERT_TRUE(again.ok()) << again.error().to_string();
      EXPECT_EQ(again->jobs.at(1).epochs, epochs.epochs);
      EXPECT_EQ(again->jobs.at(1).development, epochs.development);
      EXPECT_EQ(again->jobs.at(1).accumulators, epochs.accumulators);
      EXPECT_EQ(again->states.at("k"), states);
    }
  }
}

}  // namespace
}  // namespace candela::master
