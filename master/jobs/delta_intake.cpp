#include "master/jobs/delta_intake.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/base/thread_cpu.h"
#include "common/base/version.h"
#include "common/stages/epochs.h"

namespace candela::master {

// Without a cause nobody has failed.
struct DeltaRefusal {
  DeltaVerdict verdict = DeltaVerdict::merged;
  std::string message;
  std::optional<FailureCause> cause = {};
};

namespace {

// An upper bound of the encoded delta of a unit: raw integers, an eighth more for incompressible planes,
// records, and headers.
std::uint64_t largest_delta(const film::DeltaShape& shape, const Unit& unit) {
  const std::uint64_t count = unit.end - unit.begin;
  constexpr std::uint64_t kHeaders = 1 << 20;
  if (!makes_film(unit.kind)) return count * sizeof(float) + kHeaders;
  const std::uint64_t integers = std::uint64_t{shape.film.layers} * film::kChannels;
  std::uint64_t raw = shape.film.pixel_count() * integers * sizeof(std::int64_t);
  for (const film::AccumulatorSpec& spec : shape.accumulators)
    raw += film::sums_bytes(spec, shape.film.width, shape.film.height);
  const std::uint64_t records = unit.kind == Unit::Kind::segments ? count : 0;
  return raw + raw / 8 + kHeaders + records * (chains::kMaxRecordBytes + sizeof(std::uint32_t));
}

film::DeltaShape shape_of(const JobRow& row) {
  return {layout_of(row), row.accumulators};
}

using Refusal = DeltaRefusal;

Refusal corrupt(std::string message, FailureCause cause = FailureCause::worker) {
  return {DeltaVerdict::corrupt, std::move(message), cause};
}
std::optional<Refusal> check_build(const std::string& build) {
  if (build == build_id()) return std::nullopt;
  return Refusal{DeltaVerdict::wrong_build,
                 fmt::format("made by build {}, the farm runs {}", build, build_id()), FailureCause::worker};
}
std::optional<Refusal> refusal_of(Delivery delivery) {
  switch (delivery) {
    case Delivery::ok:
      break;
    case Delivery::duplicate:
      return Refusal{DeltaVerdict::duplicate, "the unit is merged already"};
    case Delivery::stale:
      return Refusal{DeltaVerdict::stale, "the lease is not the sender's any more"};
    case Delivery::job_ended:
      return Refusal{DeltaVerdict::job_ended, "the job has ended"};
  }
  return std::nullopt;
}

// The job's part of the contract on deltas.
struct Expected {
  film::DeltaShape shape;
  std::optional<NamedState> state;
  std::optional<EpochPlan> epochs;
};

// Checks that a decoded delta is what its header says and the job expects.
std::optional<Refusal> check(const film::Delta& delta, const DeltaHeader& header, const Unit& unit,
                             const Expected& expected) {
  const film::DeltaInfo& info = delta.info();
  if (auto wrong = check_build(info.build_id)) return wrong;
  if (info.job_id != header.job_id || info.unit.kind != unit.kind || info.unit.half != unit.half ||
      info.unit.begin != unit.begin || info.unit.end != unit.end ||
      (makes_film(unit.kind) && info.scale_log2 != expected.state->film_scale_log2))
    return corrupt("the delta is of another unit, job or scale than its header says");
  const auto& rejected = delta.sample_counts().rejected;
  if (!makes_film(unit.kind) && *std::max_element(rejected.begin(), rejected.end()) > unit.end - unit.begin)
    return corrupt("more samples are rejected than there are");
  if (!expected.epochs) return std::nullopt;
  const std::uint64_t epoch = Epochs(expected.epochs->first, expected.epochs->growth).of_index(unit.begin);
  for (std::size_t i = 0; i < delta.accumulators().size(); ++i)
    if (expected.shape.accumulators[i].per == film::AccumulatorSpec::Per::epoch &&
        delta.accumulators()[i].epoch != epoch)
      return corrupt("an accumulator is of another epoch than the unit");
  return std::nullopt;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace

struct DeltaIntake::Admission {
  std::optional<DeltaRefusal> refusal;
  bool merge = true;              // false: it is an answer of an audit
  std::shared_ptr<JobFilm> film;  // of a delta that has one
  PrefixBorder border;
};

// The lease may have run out while the bytes came. The film is that of this lease: a job that begins anew has
// another.
DeltaIntake::Admission DeltaIntake::receive(const DeltaHeader& header, const film::Delta& delta,
                                            Course& course) {
  struct Turn {
    Delivery delivery = Delivery::ok;
    Reception reception = Reception::merge;
    std::shared_ptr<JobFilm> film;
    PrefixBorder border;
  };
  Delivered delivered{header.worker_id, header.token, header.unit_id,       header.job_id, header.unit,
                      header.sha256,    "",           header.render_seconds};
  for (;;) {
    const Turn turn = table_.with_films([&](Scheduler& s, const JobFilms& films) {
      Turn t;
      const Now now = JobTable::now();
      t.delivery =
          s.check_delivery(header.worker_id, header.token, header.unit_id, header.job_id, header.unit, now);
      if (t.delivery != Delivery::ok) return t;
      if (const auto film = films.find(header.job_id); film != films.end()) t.film = film->second;
      t.border = s.job(header.job_id)->border();
      t.reception = s.receive(delivered, now);
      return t;
    });
    if (auto late = refusal_of(turn.delivery)) return {std::move(late), false, nullptr, {}};
    switch (turn.reception) {
      case Reception::merge:
        return {std::nullopt, true, turn.film, turn.border};
      case Reception::taken:
        return {std::nullopt, false, nullptr, {}};
      case Reception::refused:
        return {Refusal{DeltaVerdict::stale, "the samples are not what other workers give for this unit"},
                false,
                nullptr,
                {}};
      case Reception::unknown:
        break;
    }
    delivered.content =
        bulk_.run([&] { return with_cpu_time(course.cpu_seconds, [&] { return delta.content_sha256(); }); });
  }
}

std::optional<DeltaRefusal> DeltaIntake::merge_film(const DeltaHeader& header, const film::Delta& delta,
                                                    const Admission& admission,
                                                    std::vector<chains::ChainRecord> records,
                                                    Course& course) {
  JobFilm& film = *admission.film;
  const Unit& unit = header.unit;
  const bool segments = unit.kind == Unit::Kind::segments;
  std::size_t largest_record = 0;
  for (const chains::ChainRecord& r : records)
    largest_record = std::max(largest_record, chains::encoded_bytes(r));
  const auto outcome = bulk_.run([&] {
    return with_cpu_time(course.cpu_seconds,
                         [&] { return film.merge(delta, std::move(records), admission.border); });
  });
  // The film lacks the segment before this one, through no fault of the sender: the unit is rendered again
  // later.
  if (!outcome.ok() && outcome.error().kind == ErrorKind::refused && segments)
    return Refusal{DeltaVerdict::stale, outcome.error().to_string()};
  if (!outcome.ok())
    return corrupt(outcome.error().to_string(),
                   outcome.error().kind == ErrorKind::usage ? FailureCause::scene : FailureCause::worker);
  if (*outcome == JobFilm::Outcome::duplicate) return refusal_of(Delivery::duplicate);
  if (*outcome == JobFilm::Outcome::closed) return refusal_of(Delivery::job_ended);
  film.received_statistics(delta.accumulator_bytes());
  // On idle processors receiving takes as much as merging, and beside it; on busy ones a merge takes longer.
  const double merge_seconds = std::max(course.hash_seconds + seconds_since(course.turn), course.cpu_seconds);
  table_.with_scheduler([&](Scheduler& s) {
    s.merged(header.worker_id, header.token, header.unit_id, header.job_id, unit, delta.sample_counts(),
             header.render_seconds, course.receive_seconds + seconds_since(course.here), JobTable::now(),
             largest_record, merge_seconds, header.sha256);
  });
  return std::nullopt;
}

std::optional<DeltaRefusal> DeltaIntake::merge_table(const DeltaHeader& header, const film::Delta& delta) {
  const auto taken = table_.with_scheduler([&](Scheduler& s) {
    return s.complete_bootstrap(header.worker_id, header.token, delta.table(), delta.sample_counts().rejected,
                                header.render_seconds, JobTable::now());
  });
  if (!taken.ok()) return corrupt(taken.error().to_string());
  return *taken ? std::nullopt : refusal_of(Delivery::stale);
}

PushGate::Order DeltaIntake::order_of(const std::string& job_id) const {
  return table_.with_scheduler([&](Scheduler& s) {
    const Job* mine = s.job(job_id);
    const bool yields =
        mine != nullptr && std::any_of(s.jobs().begin(), s.jobs().end(), [&](const auto& one) {
          const Job& other = one.second;
          return other.row.priority > mine->row.priority && other.leases > 0 && other.open_for_leases();
        });
    return yields ? PushGate::Order::yields : PushGate::Order::at_once;
  });
}

std::optional<DeltaIntake::Verdict> DeltaIntake::admit(const DeltaHeader& header) {
  const Unit& unit = header.unit;
  struct Answer {
    Delivery delivery;
    std::uint64_t largest = 0;
  };
  const Answer answer = table_.with_scheduler([&](Scheduler& s) {
    Answer a{s.check_delivery(header.worker_id, header.token, header.unit_id, header.job_id, unit,
                              JobTable::now()),
             0};
    if (const Job* job = s.job(header.job_id)) a.largest = largest_delta(shape_of(job->row), unit);
    if (a.delivery == Delivery::ok) s.touch_lease(header.token, JobTable::now());
    return a;
  });
  std::optional<Refusal> refusal = refusal_of(answer.delivery);
  if (!refusal) refusal = check_build(header.build_id);
  if (!refusal && (header.size_bytes == 0 || header.size_bytes > answer.largest))
    refusal = corrupt(fmt::format("{} bytes cannot be a delta of this job (at most {})", header.size_bytes,
                                  answer.largest));
  if (!refusal) return std::nullopt;
  if (refusal->cause)
    table_.with_scheduler([&](Scheduler& s) {
      s.fail_unit(header.worker_id, header.token, *refusal->cause, refusal->message, JobTable::now());
    });
  ++counters_.verdicts[index_of(refusal->verdict)];
  log::info(
      fmt::format("delta refused: {}", refusal->message),
      {.job = header.job_id, .unit = static_cast<std::int64_t>(header.unit_id), .worker = header.worker_id});
  return Verdict{refusal->verdict, refusal->message};
}

DeltaIntake::Verdict DeltaIntake::deliver(const DeltaHeader& header, const std::string& bytes,
                                          const Receipt& receipt) {
  const log::Ids ids{
      .job = header.job_id, .unit = static_cast<std::int64_t>(header.unit_id), .worker = header.worker_id};
  counters_.delta_bytes += bytes.size();
  const auto refuse = [&](Refusal refusal) {
    ++counters_.verdicts[index_of(refusal.verdict)];
    log::warn(fmt::format("delta refused: {}", refusal.message), ids);
    table_.with_scheduler([&](Scheduler& s) {
      s.event(JobTable::now(), header.job_id, header.worker_id, "refused", refusal.message);
      if (refusal.cause == FailureCause::master)
        s.lack_inputs(header.worker_id, header.token, refusal.message, JobTable::now());
      else if (refusal.cause)
        s.fail_unit(header.worker_id, header.token, *refusal.cause, refusal.message, JobTable::now());
    });
    return Verdict{refusal.verdict, std::move(refusal.message)};
  };
  if (bytes.size() != header.size_bytes)
    return refuse(corrupt(fmt::format("{} bytes came, {} were announced", bytes.size(), header.size_bytes),
                          FailureCause::network));
  const auto came = std::chrono::steady_clock::now();
  Course course;
  course.cpu_seconds = receipt.cpu_seconds;
  const std::string sha256 =
      bulk_.run([&] { return with_cpu_time(course.cpu_seconds, [&] { return sha256_hex(bytes); }); });
  if (sha256 != header.sha256)
    return refuse(corrupt("the bytes do not have the announced hash", FailureCause::network));

  course.receive_seconds = receipt.seconds;
  course.hash_seconds = seconds_since(came);
  course.here = std::chrono::steady_clock::now();
  const PushGate::MergeTurn turn(gate_, order_of(header.job_id));
  course.turn = std::chrono::steady_clock::now();
  const Unit& unit = header.unit;
  const auto expected = table_.with_scheduler([&](Scheduler& s) -> std::optional<Expected> {
    const Job* job = s.job(header.job_id);
    if (job == nullptr) return std::nullopt;
    return Expected{shape_of(job->row), job->row.named_state, job->row.epochs};
  });
  if (!expected || (makes_film(unit.kind) && !expected->state))
    return refuse({DeltaVerdict::stale, "the job has no film"});
  auto delta = bulk_.run([&] {
    return with_cpu_time(course.cpu_seconds, [&] { return film::Delta::decode(bytes, expected->shape); });
  });
  if (!delta.ok()) return refuse(corrupt(delta.error().to_string()));
  if (auto wrong = check(*delta, header, unit, *expected)) return refuse(std::move(*wrong));

  const bool segments = unit.kind == Unit::Kind::segments;
  auto records = chains::decode(delta->records(), segments ? unit.end - unit.begin : 0);
  if (!records.ok()) return refuse(corrupt(records.error().to_string()));
  if (makes_film(unit.kind))
    if (auto opened = truth_.open_film(header.job_id); !opened.ok())
      return refuse({DeltaVerdict::stale, opened.error().to_string(), FailureCause::master});
  Admission admission = receive(header, *delta, course);
  if (admission.refusal) return refuse(std::move(*admission.refusal));
  if (admission.merge) {
    if (makes_film(unit.kind) && !admission.film) return refuse({DeltaVerdict::stale, "the job has no film"});
    auto refusal = makes_film(unit.kind) ? merge_film(header, *delta, admission, std::move(*records), course)
                                         : merge_table(header, *delta);
    if (refusal) return refuse(std::move(*refusal));
  }
  counters_.merge_microseconds += static_cast<std::uint64_t>(seconds_since(course.here) * 1e6);
  ++counters_.verdicts[index_of(DeltaVerdict::merged)];
  log::debug("merged", ids);
  wake_.wake();
  return {DeltaVerdict::merged, ""};
}

}  // namespace candela::master
