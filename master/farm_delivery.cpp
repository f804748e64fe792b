// Deltas: what happens between a worker's bytes and the merged film.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/base/version.h"
#include "common/wire/wire.h"
#include "master/farm.h"

namespace candela::master {
namespace {

// An upper bound of an encoded delta: raw sums, an eighth more for incompressible planes, and headers.
std::uint64_t largest_delta(const film::Layout& layout, std::uint64_t record_count) {
  const std::uint64_t raw =
      std::uint64_t{layout.pixel_count()} * layout.layers * film::kChannels * sizeof(std::int64_t);
  return raw + raw / 8 + (1 << 20) + record_count * (chains::kMaxRecordBytes + sizeof(std::uint32_t));
}

}  // namespace

Result<std::optional<Farm::Verdict>> Farm::admit(const v1::DeltaHeader& header) {
  CANDELA_ASSIGN(const Unit unit, wire::from_proto(header.unit()));
  if (!is_sha256_hex(header.sha256()))
    return input_error("must be 64 lower-case hex digits").with_field("header.sha256");
  if (!(header.render_seconds() >= 0) || header.render_seconds() > 1e9)
    return input_error("must be seconds, 0 or more").with_field("header.render_seconds");
  const bool segments = unit.kind == Unit::Kind::segments;
  if (segments ? header.records_bytes() == 0 || header.records_bytes() > header.size_bytes()
               : header.records_bytes() != 0)
    return input_error(fmt::format("{} of {} bytes are not possible for this kind of unit",
                                   header.records_bytes(), header.size_bytes()))
        .with_field("header.records_bytes");
  struct Answer {
    Delivery delivery;
    std::uint64_t largest = 0;
  };
  const Answer answer = with_scheduler([&](Scheduler& s) {
    Answer a{
        s.check_delivery(header.worker_id(), header.token(), header.unit_id(), header.job_id(), unit, now()),
        0};
    if (const Job* job = s.job(header.job_id()))
      a.largest = largest_delta(layout_of(job->row), segments ? unit.end - unit.begin : 0);
    if (a.delivery == Delivery::ok) s.touch_lease(header.token(), now());
    return a;
  });
  Verdict verdict;
  switch (answer.delivery) {
    case Delivery::duplicate:
      verdict = {v1::DELTA_VERDICT_DUPLICATE, "the unit is merged already"};
      break;
    case Delivery::stale:
      verdict = {v1::DELTA_VERDICT_STALE, "the lease is not the sender's any more"};
      break;
    case Delivery::job_ended:
      verdict = {v1::DELTA_VERDICT_JOB_ENDED, "the job has ended"};
      break;
    case Delivery::ok: {
      std::string wrong;
      if (header.build_id() != build_id()) {
        verdict = {v1::DELTA_VERDICT_WRONG_BUILD,
                   fmt::format("made by build {}, the farm runs {}", header.build_id(), build_id())};
      } else if (header.size_bytes() == 0 || header.size_bytes() > answer.largest) {
        verdict = {v1::DELTA_VERDICT_CORRUPT,
                   fmt::format("{} bytes cannot be a delta of this job (at most {})", header.size_bytes(),
                               answer.largest)};
      } else {
        return std::optional<Verdict>();
      }
      with_scheduler([&](Scheduler& s) {
        s.fail_unit(header.worker_id(), header.token(), FailureCause::worker, verdict.message, now());
      });
      break;
    }
  }
  ++counters_.verdicts[verdict.verdict];
  log::info(fmt::format("delta refused: {}", verdict.message),
            {.job = header.job_id(),
             .unit = static_cast<std::int64_t>(header.unit_id()),
             .worker = header.worker_id()});
  return std::optional<Verdict>(verdict);
}

Farm::Verdict Farm::deliver(const v1::DeltaHeader& header, const std::string& bytes, double receive_seconds) {
  const log::Ids ids{.job = header.job_id(),
                     .unit = static_cast<std::int64_t>(header.unit_id()),
                     .worker = header.worker_id()};
  counters_.delta_bytes += bytes.size();
  // Without a cause nobody has failed.
  const auto refuse = [&](v1::DeltaVerdict verdict, std::string message,
                          std::optional<FailureCause> cause = {}) {
    ++counters_.verdicts[verdict];
    log::warn(fmt::format("delta refused: {}", message), ids);
    with_scheduler([&](Scheduler& s) {
      s.event(now(), header.job_id(), header.worker_id(), "refused", message);
      if (cause == FailureCause::master)
        s.lack_inputs(header.worker_id(), header.token(), message, now());
      else if (cause)
        s.fail_unit(header.worker_id(), header.token(), *cause, message, now());
    });
    return Verdict{verdict, std::move(message)};
  };
  if (bytes.size() != header.size_bytes())
    return refuse(v1::DELTA_VERDICT_CORRUPT,
                  fmt::format("{} bytes came, {} were announced", bytes.size(), header.size_bytes()),
                  FailureCause::network);
  if (sha256_hex(bytes) != header.sha256())
    return refuse(v1::DELTA_VERDICT_CORRUPT, "the bytes do not have the announced hash",
                  FailureCause::network);

  const auto started = std::chrono::steady_clock::now();
  const PushGate::MergeTurn turn(*gate_);
  const auto unit = wire::from_proto(header.unit());
  const std::shared_ptr<JobFilm> film = film_of(header.job_id());
  if (!unit.ok() || !film) return refuse(v1::DELTA_VERDICT_STALE, "the job has no film");
  struct Expected {
    film::Layout layout;
    int scale_log2 = 0;
  };
  const Expected expected = with_scheduler([&](Scheduler& s) {
    const JobRow& row = s.job(header.job_id())->row;
    Expected e;
    e.layout = layout_of(row);
    e.scale_log2 = row.named_state ? row.named_state->film_scale_log2 : 0;
    return e;
  });
  const std::string_view records_bytes = std::string_view(bytes).substr(
      bytes.size() - std::min<std::size_t>(header.records_bytes(), bytes.size()));
  auto delta = film::Delta::decode(std::string_view(bytes).substr(0, bytes.size() - records_bytes.size()),
                                   expected.layout);
  if (!delta.ok()) return refuse(v1::DELTA_VERDICT_CORRUPT, delta.error().to_string(), FailureCause::worker);
  const film::DeltaInfo& info = delta->info();
  if (info.build_id != build_id())
    return refuse(v1::DELTA_VERDICT_WRONG_BUILD,
                  fmt::format("made by build {}, the farm runs {}", info.build_id, build_id()),
                  FailureCause::worker);
  if (info.job_id != header.job_id() || info.scale_log2 != expected.scale_log2 ||
      info.unit.kind != unit->kind || info.unit.half != unit->half || info.unit.begin != unit->begin ||
      info.unit.end != unit->end)
    return refuse(v1::DELTA_VERDICT_CORRUPT,
                  "the delta is of another unit, job or scale than its header says", FailureCause::worker);

  std::vector<chains::ChainRecord> records;
  std::size_t largest_record = 0;
  if (unit->kind == Unit::Kind::segments) {
    auto decoded = chains::decode(records_bytes, unit->end - unit->begin);
    if (!decoded.ok())
      return refuse(v1::DELTA_VERDICT_CORRUPT, decoded.error().to_string(), FailureCause::worker);
    records = std::move(*decoded);
    for (const chains::ChainRecord& r : records)
      largest_record = std::max(largest_record, chains::encoded_bytes(r));
  }

  // The lease may have run out while the bytes came.
  const Delivery again = with_scheduler([&](Scheduler& s) {
    return s.check_delivery(header.worker_id(), header.token(), header.unit_id(), header.job_id(), *unit,
                            now());
  });
  switch (again) {
    case Delivery::ok:
      break;
    case Delivery::duplicate:
      return refuse(v1::DELTA_VERDICT_DUPLICATE, "the unit is merged already");
    case Delivery::stale:
      return refuse(v1::DELTA_VERDICT_STALE, "the lease is not the sender's any more");
    case Delivery::job_ended:
      return refuse(v1::DELTA_VERDICT_JOB_ENDED, "the job has ended");
  }
  if (auto opened = truth_->open_film(header.job_id()); !opened.ok())
    return refuse(v1::DELTA_VERDICT_STALE, opened.error().to_string(), FailureCause::master);
  const auto outcome = film->merge(*delta, std::move(records));
  // A chain whose segment before is not in the film: no fault of the sender's. It is rendered again in its
  // turn.
  if (!outcome.ok() && outcome.error().kind == ErrorKind::refused && unit->kind == Unit::Kind::segments)
    return refuse(v1::DELTA_VERDICT_STALE, outcome.error().to_string());
  if (!outcome.ok())
    return refuse(v1::DELTA_VERDICT_CORRUPT, outcome.error().to_string(), FailureCause::worker);
  if (*outcome == JobFilm::Outcome::duplicate)
    return refuse(v1::DELTA_VERDICT_DUPLICATE, "the unit is merged already");
  if (*outcome == JobFilm::Outcome::closed) return refuse(v1::DELTA_VERDICT_JOB_ENDED, "the job has ended");
  const double merge_seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
  counters_.merge_microseconds += static_cast<std::uint64_t>(merge_seconds * 1e6);
  with_scheduler([&](Scheduler& s) {
    s.merged(header.worker_id(), header.token(), header.unit_id(), header.job_id(), *unit, delta->tallies(),
             header.render_seconds(), receive_seconds + merge_seconds, now(), largest_record);
  });
  ++counters_.verdicts[v1::DELTA_VERDICT_MERGED];
  log::debug("merged", ids);
  wake_.notify_all();
  return {v1::DELTA_VERDICT_MERGED, ""};
}

}  // namespace candela::master
