// The columns of the store's tables by name, one list for reading and for writing: columns(row, record) calls
// row(name, value) for each column, where `row` is a Reader or a Writer.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "master/store/records.h"
#include "master/store/sqlite_statement.h"

namespace candela::master {

// Numbers are stored as little-endian bytes.
static_assert(std::endian::native == std::endian::little);

// A list of texts: each with `end` after it.
template <class V>
struct Parts {
  V& value;
  char end;
};
template <class V>
Parts(V&, char) -> Parts<V>;

// An enumeration: its first value is stored as `first`, its last as `last`.
template <class V>
struct Code {
  V& value;
  int first, last;
};
template <class V>
Code(V&, int, int) -> Code<V>;

struct Bytes {
  std::string text;
};

// The columns of a job that the record has in another form.
struct JobCells {
  Bytes settings, work, chain_status, audit;  // messages of candela.v1
  Bytes decided;
  int pilot_form = 0;  // 1: what it decided was kept
  std::string state, repairs_to;
  double film_scale_log2 = 0;  // NaN: no named state yet
  ChainPlan plan;
  double bootstrap_b = 0;
  FrameRow frame;  // without an id: the job is of no group
};

// Read into or, if const, written.
template <class T, class Record>
concept Of = std::same_as<std::remove_const_t<T>, Record>;

// One column for each of film::RejectCause.
void rejected_columns(auto& row, const std::string& prefix, auto& counts) {
  constexpr const char* kNames[film::kRejectCauses] = {"nan", "infinite", "negative", "saturated",
                                                       "statistics"};
  for (std::size_t i = 0; i < counts.size(); ++i) row((prefix + kNames[i]).c_str(), counts[i]);
}

void columns(auto& row, Of<JobRow> auto& j, Of<JobCells> auto& cells) {
  row("id", j.id);
  row("name", j.name);
  row("bundle", j.bundle_sha256);
  row("settings", cells.settings);
  row("stop_iterations", j.stop.iterations);
  row("stop_time_seconds", j.stop.time_seconds);
  row("stop_relmse", j.stop.relmse);
  row("priority", j.priority);
  row("share", j.share);
  row("token", j.idempotency_token);
  row("digest", j.content_digest);
  row("state", cells.state);
  row("message", j.message);
  row("stop_reason", j.stop_reason);
  row("film_scale_log2", cells.film_scale_log2);
  row("plan", j.plan);
  row("thread_seconds_per_iteration", j.thread_seconds_per_iteration);
  row("submitted_unix_ms", j.submitted_unix_ms);
  row("finished_unix_ms", j.finished_unix_ms);
  row("elapsed_seconds", j.elapsed_seconds);
  row("worker_seconds", j.worker_seconds);
  row("units_merged", j.units_merged);
  row("iterations", j.iterations);
  row("eye_samples", j.sample_counts.eye_samples);
  row("light_paths", j.sample_counts.light_paths);
  row("rays", j.sample_counts.rays);
  rejected_columns(row, "rejected_", j.sample_counts.rejected);
  row("relmse", j.relmse);
  row("checkpoint_generation", j.checkpoint_generation);
  row("checkpoint_iterations", j.checkpoint_iterations);
  row("layers", Parts{j.layers, ','});
  row("chains", cells.plan.chains);
  row("bootstrap_samples", cells.plan.bootstrap_samples);
  row("segment_mutations", cells.plan.segment_mutations);
  row("bootstrap_b", cells.bootstrap_b);
  row("bootstrap_sum", j.bootstrap.sum);
  row("bootstrap_square_sum", j.bootstrap.square_sum);
  rejected_columns(row, "bootstrap_", j.bootstrap_rejected);
  row("chain_status", cells.chain_status);
  row("pilot_scale_log2", j.pilot_scale_log2);
  row("promised", j.promised);
  row("repairs_to", cells.repairs_to);
  row("work", cells.work);
  row("sampled_merges", j.sample_counts.sampled_merges);
  row("repeated_merges", j.sample_counts.repeated_merges);
  row("bounded_walks", j.sample_counts.bounded_walks);
  row("submitter", j.submitter);
  row("audit", cells.audit);
  row("stop_indices", j.stop_indices);
  row("scene_path", j.scene_path);
  row("decided", cells.decided);
  row("pilot_form", cells.pilot_form);
  row("group_id", cells.frame.group_id);
  row("group_name", cells.frame.group_name);
  row("frame", cells.frame.frame);
  row("frames", cells.frame.frames);
  row("depends", Parts{j.depends, ','});
  row("builds", Parts{j.builds, ','});
}

void columns(auto& row, Of<UnitRow> auto& u) {
  row("id", u.id);
  row("job", u.job_id);
  row("kind", Code{u.unit.kind, 1, 4});
  row("half", u.unit.half);
  row("first", u.unit.begin);
  row("last", u.unit.end);
  row("state", Code{u.state, 0, 2});
  row("failures", u.failures);
  row("worker", u.worker_id);
  row("token", u.token);
  row("seconds", u.seconds);
  row("made_by", Parts{u.by, '\n'});
  row("sha256", u.sha256);
}

void columns(auto& row, Of<MakerRow> auto& m) {
  row("worker", m.worker_id);
  row("made_by", Parts{m.by, '\n'});
}

void columns(auto& row, Of<LeaseRow> auto& l) {
  row("token", l.token);
  row("unit", l.unit_id);
  row("job", l.job_id);
  row("worker", l.worker_id);
  row("expected_seconds", l.expected_seconds);
  row("speculative", l.speculative);
}

void columns(auto& row, Of<StateRow> auto& s) {
  row("job", s.job_id);
  row("epoch", s.epoch);
  row("name", s.name);
  row("sha256", s.sha256);
  row("size_bytes", s.size_bytes);
}

void columns(auto& row, Of<WorkerRow> auto& w) {
  row("id", w.id);
  row("session", w.session);
  row("name", w.name);
  row("host", w.host);
  row("build_id", w.build_id);
  row("threads", w.threads);
  row("isas", Parts{w.isas, ','});
  row("draining", w.draining);
  row("units_merged", w.units_merged);
  row("units_failed", w.units_failed);
  row("last_seen_unix_ms", w.last_seen_unix_ms);
  row("paused", w.paused);
}

void columns(auto& row, Of<BootstrapRow> auto& b) {
  row("job", b.job_id);
  row("first", b.begin);
  row("contributions", b.contributions);
  rejected_columns(row, "rejected_", b.rejected);
}

void columns(auto& row, Of<PutStarts> auto& c) {
  row("job", c.job_id);
  row("samples", c.starts);
}

void columns(auto& row, Of<DistrustRow> auto& d) {
  row("worker", d.worker);
  row("since_unix_ms", d.since_unix_ms);
  row("reason", d.reason);
}

void columns(auto& row, Of<OverdueRow> auto& o) {
  row("job", o.job_id);
  row("finished_unix_ms", o.finished_unix_ms);
  row("waited_seconds", o.waited_seconds);
}

void columns(auto& row, Of<EventRow> auto& e) {
  row("unix_ms", e.unix_ms);
  row("job", e.job_id);
  row("worker", e.worker_id);
  row("kind", e.kind);
  row("message", e.message);
}

using IndexSets = std::array<film::IndexSet, 2>;  // stored as half, begin and end of each range

// Reads the columns of a statement's row. A column that the statement lacks makes the statement fail.
class Reader {
 public:
  explicit Reader(Statement& s) : s_(s) {}

  void operator()(const char* name, std::string& v) { v = s_.column(name).text(); }
  void operator()(const char* name, Bytes& v) { v.text = s_.column(name).text(); }
  void operator()(const char* name, double& v) { v = s_.column(name).real(); }
  template <std::integral T>
  void operator()(const char* name, T& v) {
    v = static_cast<T>(s_.column(name).integer());
  }
  template <class V>
  void operator()(const char* name, Code<V> v) {
    v.value = static_cast<V>(std::clamp<std::int64_t>(s_.column(name).integer(), v.first, v.last) - v.first);
  }
  template <class V>
  void operator()(const char* name, Parts<V> v) {
    const std::string text = s_.column(name).text();
    v.value.clear();
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t end = std::min(text.find(v.end, at), text.size());
      v.value.push_back(text.substr(at, end - at));
      at = end + 1;
    }
  }
  // Bytes that are no whole numbers give none.
  template <class T>
  void operator()(const char* name, std::vector<T>& v) {
    const std::string bytes = s_.column(name).text();
    v.assign(bytes.size() % sizeof(T) == 0 ? bytes.size() / sizeof(T) : 0, T());
    if (!v.empty()) std::memcpy(v.data(), bytes.data(), bytes.size());
  }
  void operator()(const char* name, IndexSets& v) {
    std::vector<std::uint64_t> ranges;
    (*this)(name, ranges);
    for (std::size_t i = 0; i + 2 < ranges.size(); i += 3)
      if (ranges[i] < 2) v[ranges[i]].insert(ranges[i + 1], ranges[i + 2]);
  }

 private:
  Statement& s_;
};

// Binds the columns in their order.
class Writer {
 public:
  explicit Writer(Statement& s) : s_(s) {}

  void operator()(const char*, const std::string& v) { s_.bind(v); }
  void operator()(const char*, const Bytes& v) { s_.bind_blob(v.text); }
  void operator()(const char*, double v) { s_.bind(v); }
  void operator()(const char*, std::integral auto v) { s_.bind(static_cast<std::int64_t>(v)); }
  template <class V>
  void operator()(const char*, Code<V> v) {
    s_.bind(v.first + static_cast<int>(v.value));
  }
  template <class V>
  void operator()(const char*, Parts<V> v) {
    std::string text;
    for (const std::string& part : v.value) text += part + v.end;
    s_.bind(text);
  }
  template <class T>
  void operator()(const char*, const std::vector<T>& v) {
    s_.bind_blob({reinterpret_cast<const char*>(v.data()), v.size() * sizeof(T)});
  }
  void operator()(const char* name, const IndexSets& v) {
    std::vector<std::uint64_t> ranges;
    for (std::uint64_t h = 0; h < 2; ++h)
      for (const auto& [begin, end] : v[h].ranges()) ranges.insert(ranges.end(), {h, begin, end});
    (*this)(name, ranges);
  }

 private:
  Statement& s_;
};

// Puts a row in the place of the one with its key.
bool put_row(sqlite3* db, const std::string& table, const auto&... record) {
  std::string names, places;
  const auto list = [&](const char* name, const auto&) {
    names += names.empty() ? name : std::string(",") + name;
    places += places.empty() ? "?" : ",?";
  };
  columns(list, record...);
  Statement s(db, ("INSERT OR REPLACE INTO " + table + " (" + names + ") VALUES (" + places + ")").c_str());
  Writer row(s);
  columns(row, record...);
  return s.run();
}

}  // namespace candela::master
