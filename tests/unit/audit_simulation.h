// A farm without films and bytes: the scheduler, workers that answer with words for contents, and what a
// master does for it (store, films, AuditKeeper). Everything follows from a seed.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "master/scheduler/scheduler.h"
#include "tests/scheduler_invariants.h"

namespace candela::master {

class AuditSimulation {
 public:
  // Answer of a worker for a unit; empty: the truth.
  using Lie = std::function<std::string(const Unit&)>;
  struct SimWorker {
    std::string id, host;
    Lie lie;
    int pilot_scale = 20;
    std::string decided = "the truth";
    bool away = false;
    double seconds = 1;                              // that a unit takes
    std::deque<std::pair<double, Lease>> under_way;  // when they end
    std::map<std::uint64_t, Unit> units;             // by token
    std::uint64_t leases = 0;
  };

  explicit AuditSimulation(double share, std::uint64_t seed = 1, std::uint64_t secret = 5)
      : random(seed), share_(share), secret_(secret) {
    start(1);
  }

  void worker(const std::string& id, Lie lie = {}, const std::string& host = "") {
    SimWorker w;
    w.id = id;
    w.host = host.empty() ? "host-" + id : host;
    w.lie = std::move(lie);
    enrol(w);
    workers[id] = std::move(w);
  }
  void enrol(const SimWorker& w) {
    WorkerRow row;
    row.id = w.id;
    row.session = "session-" + w.id;
    row.name = w.id;
    row.host = w.host;
    row.isas = {"avx2"};
    ASSERT_TRUE(s->register_worker(row, now()).ok());
  }
  // `plan`: as the pilot's answer.
  void submit(const std::string& id, std::uint64_t iterations, WorkPlan plan = {}) {
    JobRow row;
    row.id = id;
    row.settings.width = row.settings.height = 8;
    row.stop.iterations = iterations;
    row.bundle_sha256 = "bundle";
    plans[id] = std::move(plan);
    s->submit(row, now());
    publish();
  }

  Now now() const { return {clock, static_cast<std::int64_t>(clock * 1000)}; }
  static std::string truth(const Unit& u) {
    return fmt::format("true {} {} {} {}", static_cast<int>(u.kind), u.half, u.begin, u.end);
  }
  const Job& job(const std::string& id) const { return *s->job(id); }
  bool ended(const std::string& id) const { return has_ended(job(id).row.state); }
  bool distrusts(const std::string& id) const {
    return s->distrusted().contains(workers.at(id).host + "/" + id);
  }
  std::set<std::string> distrusted() const {
    std::set<std::string> out;
    for (const auto& [who, row] : s->distrusted()) out.insert(who.substr(who.find('/') + 1));
    return out;
  }

  // Until the job has ended, or so many seconds have passed.
  void run(const std::string& id, double seconds = 2000) {
    const double end = clock + seconds;
    while (!ended(id) && clock < end) step();
  }
  void step() {
    clock += 0.1;
    std::vector<std::string> order;
    for (const auto& [id, w] : workers) order.push_back(id);
    std::shuffle(order.begin(), order.end(), random);
    for (const std::string& id : order) act(workers.at(id));
    s->tick(now());
    publish();
    keep();
  }
  // All films as words, by job, half and index.
  using Film = std::map<std::pair<std::uint32_t, std::uint64_t>, std::string>;
  std::map<std::string, Film> films;
  std::map<std::uint64_t, UnitRow> rows;  // of merged units, by id, as the store has them
  std::vector<EventRow> events;

  // The film has these iterations, each once, and all are true.
  void expect_true(const std::string& id, std::uint64_t iterations) {
    EXPECT_EQ(job(id).row.state, JobState::done) << s->message_of(job(id), now());
    EXPECT_EQ(films[id].size(), iterations);
    for (const auto& [place, word] : films[id]) ASSERT_EQ(word, "true") << place.first << " " << place.second;
  }
  std::size_t events_of(const std::string& kind) const {
    return static_cast<std::size_t>(
        std::count_if(events.begin(), events.end(), [&](const EventRow& e) { return e.kind == kind; }));
  }

  // The master's process ends; another goes on with what the store and the films have.
  void restart() {
    publish();
    const std::map<std::string, Job> before = [&] {
      std::map<std::string, Job> out;
      for (const auto& [id, j] : s->jobs()) out[id].row = j.row;
      return out;
    }();
    std::vector<DistrustRow> distrusted;
    for (const auto& [who, row] : s->distrusted()) distrusted.push_back(row);
    start(++epoch_);
    for (const DistrustRow& row : distrusted) s->restore_distrust(row);
    for (const auto& [id, j] : before) {
      std::vector<UnitRow> merged;
      HalfSets sets;
      for (const auto& [unit_id, row] : rows)
        if (row.job_id == id && row.state == UnitRow::State::merged) {
          merged.push_back(row);
          sets[row.unit.half].insert(row.unit.begin, row.unit.end);
        }
      s->restore(j.row, sets, {}, {}, merged, now());
    }
    for (auto& [id, w] : workers) {
      w.under_way.clear();
      enrol(w);
    }
    publish();
  }

  std::mt19937_64 random;
  double clock = 100;
  std::unique_ptr<Scheduler> s;
  std::map<std::string, SimWorker> workers;
  std::map<std::string, WorkPlan> plans;
  std::size_t held_most = 0;  // units at a time

 private:
  void start(std::uint64_t epoch) {
    SchedulerOptions o;
    o.lease_seconds = 10;
    o.unit_seconds = 4;
    o.audit_share = share_;
    o.audit_secret = secret_;
    std::uint64_t next = 1;
    for (const auto& [id, row] : rows) next = std::max(next, id + 1);
    s = std::make_unique<Scheduler>(o, epoch, next);
  }

  void act(SimWorker& w) {
    if (w.away) return;
    if (s->authenticate(w.id, "session-" + w.id, now()) == nullptr) return;
    std::vector<UnitReport> held;
    for (const auto& [end, l] : w.under_way) held.emplace_back(l.row.token);
    const HeartbeatResult beat = s->heartbeat(w.id, held, now());
    std::erase_if(w.under_way, [&](const auto& entry) {
      return std::count(beat.revoked.begin(), beat.revoked.end(), entry.second.row.token) > 0;
    });
    while (!w.under_way.empty() && w.under_way.front().first <= clock) {
      const Lease l = w.under_way.front().second;
      w.under_way.pop_front();
      Unit unit = w.units.at(l.row.token);
      if (std::count(beat.cut.begin(), beat.cut.end(), l.row.token) > 0 && unit.end - unit.begin > 1 &&
          unit.kind == Unit::Kind::iterations)
        unit.end = unit.begin + (unit.end - unit.begin + 1) / 2;
      deliver(w, l, unit);
    }
    const AcquireResult got = s->acquire(w.id, {}, {.prefetch = !w.under_way.empty()}, now());
    publish();
    if (!got.lease) return;
    EXPECT_FALSE(distrusts(w.id)) << "a worker that is distrusted has a lease";
    ++w.leases;
    const double begin = w.under_way.empty() ? clock : w.under_way.back().first;
    w.units[got.lease->row.token] = job(got.lease->row.job_id).units.at(got.lease->row.unit_id).row.unit;
    w.under_way.emplace_back(begin + w.seconds * std::uniform_real_distribution<>(0.3, 1.7)(random),
                             *got.lease);
  }

  void deliver(SimWorker& w, const Lease& l, const Unit& unit) {
    const std::string id = l.row.job_id;
    if (unit.kind == Unit::Kind::pilot) {
      PilotResult result;
      result.state.film_scale_log2 = w.pilot_scale;
      result.state.decided = w.decided;
      result.seconds_per_iteration = 0.5;
      result.work = plans[id];
      s->complete_pilot(w.id, l.row.token, result, now());
      return publish();
    }
    const std::string lie = w.lie ? w.lie(unit) : "";
    if (s->check_delivery(w.id, l.row.token, l.row.unit_id, id, unit, now()) != Delivery::ok) return;
    const std::string content = lie.empty() ? truth(unit) : lie;
    Delivered d{w.id, l.row.token, l.row.unit_id, id, unit, "bytes " + content, "", w.seconds};
    Reception reception = s->receive(d, now());
    if (reception == Reception::unknown) {
      d.content = content;
      reception = s->receive(d, now());
    }
    EXPECT_NE(reception, Reception::unknown);
    if (reception == Reception::merge) {
      for (std::uint64_t i = unit.begin; i < unit.end; ++i)
        EXPECT_TRUE(films[id].try_emplace({unit.half, i}, lie.empty() ? "true" : lie).second)
            << "merged twice";
      s->merged(w.id, l.row.token, l.row.unit_id, id, unit, {}, w.seconds, 0.001, now(), 0, 0,
                "bytes " + content);
    }
    publish();
  }

  void publish() {
    for (const std::string& violation : check_invariants(*s)) ADD_FAILURE() << violation;
    for (const Change& change : s->take_changes()) {
      if (const auto* put = std::get_if<PutUnit>(&change)) rows[put->row.id] = put->row;
      if (const auto* drop = std::get_if<DropUnit>(&change)) rows.erase(drop->id);
      if (const auto* forget = std::get_if<ForgetWork>(&change))
        std::erase_if(rows, [&](const auto& entry) { return entry.second.job_id == forget->job_id; });
      if (const auto* e = std::get_if<AddEvent>(&change)) events.push_back(e->row);
    }
    std::size_t held = 0;
    for (const auto& [id, j] : s->jobs()) held += j.held.size();
    held_most = std::max(held_most, held);
  }

  void keep() {
    const AuditWork work = s->audit_work();
    for (const std::string& id : work.anew) {
      films[id].clear();
      s->begin_anew(id, now());
      publish();
    }
    for (const AuditWork::Doubt& doubt : work.doubts) {
      std::vector<UnitRow> merged;
      for (const auto& [id, row] : rows)
        if (row.job_id == doubt.job_id && row.state == UnitRow::State::merged) merged.push_back(row);
      s->doubt(doubt.job_id, doubt.doubts, merged, now());
      publish();
    }
    for (const AuditWork::Tainting& t : work.taints) {
      std::map<std::string, std::uint64_t> units;
      for (const auto& [id, row] : rows)
        if (row.state == UnitRow::State::merged && std::count(row.by.begin(), row.by.end(), t.worker) > 0)
          ++units[row.job_id];
      s->taint(t.worker, units, t.jobs, now());
      publish();
    }
    std::vector<std::string> finishing;
    for (const auto& [id, j] : s->jobs())
      if (j.finishing) finishing.push_back(id);
    for (const std::string& id : finishing) s->finish(id, now());
    publish();
  }

  const double share_;
  const std::uint64_t secret_;
  std::uint64_t epoch_ = 1;
};

}  // namespace candela::master
