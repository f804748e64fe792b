// The tables of the store, and how older ones become the present ones. New columns go last, where kSchema has
// them, too, and into their list in columns.h.
#pragma once

namespace candela::master {

// 1: the first. 2: jobs.layers. 3: Markov chains. 4: what a job had and has lost. 5:
// epochs and accumulators. 6: jobs that wait for their removal, statistics that were rejected, repeated
// merges. 7: walks that were ended by a bound. 8: workers that are paused. 9: submitters. 10: audits. 11:
// exact indices as stop rules, paths of scenes. 12: what pilots decided. 13: groups of frames, jobs that wait
// for others. 14: builds of jobs. 15: no other tables; checkpoints have sums of the movement, and records of
// chains two means, which older programs take for damaged.
inline constexpr int kSchemaVersion = 15;

inline constexpr const char* kSchema = R"sql(
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
  checkpoint_generation INTEGER NOT NULL, checkpoint_iterations INTEGER NOT NULL,
  layers TEXT NOT NULL DEFAULT '',
  chains INTEGER NOT NULL DEFAULT 0, bootstrap_samples INTEGER NOT NULL DEFAULT 0,
  segment_mutations INTEGER NOT NULL DEFAULT 0, bootstrap_b REAL NOT NULL DEFAULT 0,
  bootstrap_sum REAL NOT NULL DEFAULT 0, bootstrap_square_sum REAL NOT NULL DEFAULT 0,
  bootstrap_nan INTEGER NOT NULL DEFAULT 0, bootstrap_infinite INTEGER NOT NULL DEFAULT 0,
  bootstrap_negative INTEGER NOT NULL DEFAULT 0, bootstrap_saturated INTEGER NOT NULL DEFAULT 0,
  chain_status BLOB NOT NULL DEFAULT x'', pilot_scale_log2 INTEGER NOT NULL DEFAULT 0,
  promised BLOB NOT NULL DEFAULT x'', repairs_to TEXT NOT NULL DEFAULT '',
  work BLOB NOT NULL DEFAULT x'', rejected_statistics INTEGER NOT NULL DEFAULT 0,
  bootstrap_statistics INTEGER NOT NULL DEFAULT 0, sampled_merges INTEGER NOT NULL DEFAULT 0,
  repeated_merges INTEGER NOT NULL DEFAULT 0, bounded_walks INTEGER NOT NULL DEFAULT 0,
  submitter TEXT NOT NULL DEFAULT '', audit BLOB NOT NULL DEFAULT x'',
  stop_indices BLOB NOT NULL DEFAULT x'', scene_path TEXT NOT NULL DEFAULT '',
  decided BLOB NOT NULL DEFAULT x'', pilot_form INTEGER NOT NULL DEFAULT 0,
  group_id TEXT NOT NULL DEFAULT '', group_name TEXT NOT NULL DEFAULT '', frame INTEGER NOT NULL DEFAULT 0,
  frames INTEGER NOT NULL DEFAULT 0, depends TEXT NOT NULL DEFAULT '',
  builds TEXT NOT NULL DEFAULT '') WITHOUT ROWID;
CREATE TABLE units (
  id INTEGER PRIMARY KEY, job TEXT NOT NULL, kind INTEGER NOT NULL, half INTEGER NOT NULL,
  first INTEGER NOT NULL, last INTEGER NOT NULL, state INTEGER NOT NULL, failures INTEGER NOT NULL,
  worker TEXT NOT NULL, token INTEGER NOT NULL, seconds REAL NOT NULL,
  made_by TEXT NOT NULL DEFAULT '', sha256 TEXT NOT NULL DEFAULT '');
CREATE INDEX units_by_job ON units (job, state);
CREATE TABLE leases (
  token INTEGER PRIMARY KEY, unit INTEGER NOT NULL, job TEXT NOT NULL, worker TEXT NOT NULL,
  expected_seconds REAL NOT NULL, speculative INTEGER NOT NULL);
CREATE TABLE workers (
  id TEXT PRIMARY KEY, session TEXT NOT NULL, name TEXT NOT NULL, host TEXT NOT NULL, build_id TEXT NOT NULL,
  threads INTEGER NOT NULL, isas TEXT NOT NULL, draining INTEGER NOT NULL, units_merged INTEGER NOT NULL,
  units_failed INTEGER NOT NULL, last_seen_unix_ms INTEGER NOT NULL,
  paused INTEGER NOT NULL DEFAULT 0) WITHOUT ROWID;
CREATE TABLE events (
  id INTEGER PRIMARY KEY AUTOINCREMENT, unix_ms INTEGER NOT NULL, job TEXT NOT NULL, worker TEXT NOT NULL,
  kind TEXT NOT NULL, message TEXT NOT NULL);
CREATE INDEX events_by_job ON events (job, id);
CREATE TABLE bundles (sha256 TEXT PRIMARY KEY, bytes BLOB NOT NULL) WITHOUT ROWID;
)sql";

// Contributions are floats, starts are 64-bit numbers, both little-endian.
inline constexpr const char* kChainTables = R"sql(
CREATE TABLE bootstraps (
  id INTEGER PRIMARY KEY, job TEXT NOT NULL, first INTEGER NOT NULL, contributions BLOB NOT NULL,
  rejected_nan INTEGER NOT NULL, rejected_infinite INTEGER NOT NULL, rejected_negative INTEGER NOT NULL,
  rejected_saturated INTEGER NOT NULL, rejected_statistics INTEGER NOT NULL DEFAULT 0, UNIQUE (job, first));
CREATE TABLE chain_starts (job TEXT PRIMARY KEY, samples BLOB NOT NULL);
)sql";

// From version 1: its jobs have no layers.
inline constexpr const char* kFromVersion1 = "ALTER TABLE jobs ADD COLUMN layers TEXT NOT NULL DEFAULT ''";
// From version 2: no job has chains.
inline constexpr const char* kFromVersion2 = R"sql(
ALTER TABLE jobs ADD COLUMN chains INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN bootstrap_samples INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN segment_mutations INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN bootstrap_b REAL NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN bootstrap_sum REAL NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN bootstrap_square_sum REAL NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN bootstrap_nan INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN bootstrap_infinite INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN bootstrap_negative INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN bootstrap_saturated INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN chain_status BLOB NOT NULL DEFAULT x'';
ALTER TABLE jobs ADD COLUMN pilot_scale_log2 INTEGER NOT NULL DEFAULT 0;
)sql";
// From version 3: no job has lost anything. `promised` holds half, begin, end as 64-bit numbers, range by
// range.
inline constexpr const char* kFromVersion3 = R"sql(
ALTER TABLE jobs ADD COLUMN promised BLOB NOT NULL DEFAULT x'';
ALTER TABLE jobs ADD COLUMN repairs_to TEXT NOT NULL DEFAULT '';
)sql";

// From version 4: no job has accumulators or epochs. `work` holds a candela.v1.WorkPlan of them.
inline constexpr const char* kFromVersion4 = "ALTER TABLE jobs ADD COLUMN work BLOB NOT NULL DEFAULT x''";
// From version 5: neither rejected statistics nor repeated merges were counted.
inline constexpr const char* kFromVersion5 = R"sql(
ALTER TABLE jobs ADD COLUMN rejected_statistics INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN bootstrap_statistics INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN sampled_merges INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN repeated_merges INTEGER NOT NULL DEFAULT 0;
)sql";
// From version 6: walks that were ended by a bound were not counted.
inline constexpr const char* kFromVersion6 =
    "ALTER TABLE jobs ADD COLUMN bounded_walks INTEGER NOT NULL DEFAULT 0";
// From version 7: no worker is paused.
inline constexpr const char* kFromVersion7 =
    "ALTER TABLE workers ADD COLUMN paused INTEGER NOT NULL DEFAULT 0";
// From version 8: who submitted a job was not kept.
inline constexpr const char* kFromVersion8 = "ALTER TABLE jobs ADD COLUMN submitter TEXT NOT NULL DEFAULT ''";
// From version 9: nobody is distrusted, and who made what is known by the ids of workers alone. `audit` holds
// a candela.v1.JobAudit, `made_by` identities, one a line.
inline constexpr const char* kFromVersion9 = R"sql(
ALTER TABLE jobs ADD COLUMN audit BLOB NOT NULL DEFAULT x'';
ALTER TABLE units ADD COLUMN made_by TEXT NOT NULL DEFAULT '';
ALTER TABLE units ADD COLUMN sha256 TEXT NOT NULL DEFAULT '';
)sql";
// From version 10: no job was asked for exact indices (`stop_indices` is as `promised`), and where a scene
// lay was not kept.
inline constexpr const char* kFromVersion10 = R"sql(
ALTER TABLE jobs ADD COLUMN stop_indices BLOB NOT NULL DEFAULT x'';
ALTER TABLE jobs ADD COLUMN scene_path TEXT NOT NULL DEFAULT '';
)sql";
// From version 11: workers made anew what a pilot decides; it was not kept. A pilot of form 0 is one of
// these.
inline constexpr const char* kFromVersion11 = R"sql(
ALTER TABLE jobs ADD COLUMN decided BLOB NOT NULL DEFAULT x'';
ALTER TABLE jobs ADD COLUMN pilot_form INTEGER NOT NULL DEFAULT 0;
)sql";
// From version 12: no job is of a group, or waits for another.
inline constexpr const char* kFromVersion12 = R"sql(
ALTER TABLE jobs ADD COLUMN group_id TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN group_name TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN frame INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN frames INTEGER NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN depends TEXT NOT NULL DEFAULT '';
)sql";
// From version 13: whose work a job has was not kept (kUnknownBuild).
inline constexpr const char* kFromVersion13 = R"sql(
ALTER TABLE jobs ADD COLUMN builds TEXT NOT NULL DEFAULT '';
UPDATE jobs SET builds = '?,' WHERE film_scale_log2 IS NOT NULL;
)sql";
inline constexpr const char* kDistrustTable = R"sql(
CREATE TABLE distrusted (
  worker TEXT PRIMARY KEY, since_unix_ms INTEGER NOT NULL, reason TEXT NOT NULL) WITHOUT ROWID;
)sql";
// The choice of audited units must be nothing that a worker can compute.
inline constexpr const char* kAuditSecret =
    "INSERT OR IGNORE INTO counters VALUES ('audit-secret', random())";
// Stores before version 3 had no such table.
inline constexpr const char* kBootstrapsFromVersion5 =
    "ALTER TABLE bootstraps ADD COLUMN rejected_statistics INTEGER NOT NULL DEFAULT 0";
inline constexpr const char* kStateTable = R"sql(
CREATE TABLE states (
  job TEXT NOT NULL, epoch INTEGER NOT NULL, name TEXT NOT NULL, sha256 TEXT NOT NULL,
  size_bytes INTEGER NOT NULL, PRIMARY KEY (job, epoch)) WITHOUT ROWID;
)sql";

// From version 5: no job waits for its removal.
inline constexpr const char* kOverdueTable = R"sql(
CREATE TABLE overdue (
  job TEXT PRIMARY KEY, finished_unix_ms INTEGER NOT NULL, waited_seconds REAL NOT NULL) WITHOUT ROWID;
)sql";

}  // namespace candela::master
