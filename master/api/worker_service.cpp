#include "master/api/worker_service.h"

#include <fmt/format.h>

#include <cmath>

#include "common/base/hash.h"
#include "common/base/log.h"
#include "common/base/memory_limit.h"
#include "common/base/text.h"
#include "common/base/thread_cpu.h"
#include "common/base/version.h"
#include "common/stages/decision.h"
#include "common/stages/development.h"
#include "common/wire/stall_guard.h"
#include "master/api/messages.h"
#include "master/api/service_support.h"

namespace candela::master {
namespace {

constexpr int kMaxHeartbeatUnits = 1024;
constexpr std::size_t kMaxReasonBytes = 4096;

grpc::Status unauthenticated() {
  return {grpc::StatusCode::UNAUTHENTICATED, "this session is not known: register again"};
}

// Runs `f(scheduler, now)` for a worker whose session holds.
template <class F>
grpc::Status as_worker(Farm& farm, const std::string& id, const std::string& session, F&& f) {
  return guarded([&] {
    if (farm.stopping()) return stopping_status();
    return farm.with_scheduler([&](Scheduler& s) {
      const Now now = farm.now();
      if (s.authenticate(id, session, now) == nullptr) return unauthenticated();
      f(s, now);
      return grpc::Status::OK;
    });
  });
}

// A worker hears by its heartbeats that a unit is taken away or is to be cut short. All together are at most
// two hundred a second, but for leases that are very short.
std::uint32_t heartbeat_ms(double lease_seconds, std::size_t workers) {
  const double longest = std::clamp(lease_seconds * 1000 / 6, 50.0, 5000.0);
  return static_cast<std::uint32_t>(std::min(longest, std::max(1000.0, static_cast<double>(workers) * 5)));
}

bool is_worker(Farm& farm, const std::string& id, const std::string& session) {
  return farm.with_scheduler(
      [&](Scheduler& s) { return s.authenticate(id, session, farm.now()) != nullptr; });
}

std::string clipped(const std::string& text) {
  return std::string(
      clip_utf8(text, kMaxReasonBytes));  // half a character would make every later answer invalid
}

Result<void> check(const v1::RegisterRequest& r) {
  if (r.protocol() != kProtocol)
    return refused_error(fmt::format("the worker speaks protocol {}, this farm {}", r.protocol(), kProtocol))
        .with_field("protocol")
        .with_mend("install the same version on both");
  if (r.build_id() != build_id())
    return refused_error(fmt::format("the worker is build {}, this farm {}",
                                     clipped(r.build_id()).substr(0, 128), build_id()))
        .with_field("build_id")
        .with_mend("install the same build on both: only it makes the same bits");
  if (r.name().size() > Limits::max_name_bytes || r.host().size() > Limits::max_name_bytes)
    return input_error(fmt::format("longer than {} bytes", Limits::max_name_bytes)).with_field("name");
  if (r.threads() == 0 || r.threads() > 65536) return input_error("must be 1 to 65536").with_field("threads");
  if (r.isas_size() == 0 || r.isas_size() > 16)
    return input_error("must be 1 to 16 names").with_field("isas");
  for (const std::string& isa : r.isas())
    if (isa.empty() || isa.size() > 32 || isa.find(',') != std::string::npos)
      return input_error("not the name of an instruction set").with_field("isas");
  return {};
}

// Fails (input) on a scale that no film of the job may have.
Result<void> check_scale(const PilotResult& result, const JobSettings& settings) {
  const film::Layout layout{settings.width, settings.height,
                            1 + static_cast<std::uint32_t>(result.work.layers.size())};
  auto valid = film::validate(layout, result.state.film_scale_log2);
  if (valid.ok()) return {};
  return std::move(valid).error().with_field("named_state.film_scale_log2");
}

}  // namespace

grpc::Status WorkerServiceImpl::Register(grpc::ServerContext* context, const v1::RegisterRequest* request,
                                         v1::RegisterResponse* response) {
  return guarded([&] {
    if (farm_.stopping()) return stopping_status();
    if (auto checked = check(*request); !checked.ok()) return wire::to_status(checked.error());
    WorkerRow row;
    row.id = random_id("w", 10);
    row.session = random_id("", 32);
    row.name = request->name().empty() ? row.id : request->name();
    row.host = request->host();
    row.certificate = access_.caller(*context).name;
    row.build_id = request->build_id();
    row.threads = request->threads();
    row.isas.assign(request->isas().begin(), request->isas().end());
    const WorkerRow copy = row;
    auto done =
        farm_.with_scheduler([&](Scheduler& s) { return s.register_worker(std::move(row), farm_.now()); });
    if (!done.ok()) return wire::to_status_with_retry(done.error(), 10000);
    response->set_worker_id(copy.id);
    response->set_session(copy.session);
    const double lease = farm_.options().master.lease_seconds;
    response->set_lease_ms(static_cast<std::uint32_t>(lease * 1000));
    response->set_heartbeat_ms(heartbeat_ms(lease, 1));
    response->set_max_chunk_bytes(Limits::max_chunk_bytes);
    return grpc::Status::OK;
  });
}

grpc::Status WorkerServiceImpl::AcquireLease(grpc::ServerContext*, const v1::AcquireLeaseRequest* request,
                                             v1::AcquireLeaseResponse* response) {
  // Rows that cannot be written pile up in memory; leases would only add to them.
  constexpr std::size_t kMaxBacklog = 20000;
  if (farm_.writer().backlog() > kMaxBacklog) {
    response->set_retry_ms(2000);
    return is_worker(farm_, request->worker_id(), request->session()) ? grpc::Status::OK : unauthenticated();
  }
  return guarded([&] {
    if (farm_.stopping()) return stopping_status();
    std::vector<std::string> warm;
    for (const std::string& bundle : request->warm_bundles())
      if (warm.size() < 64 && is_sha256_hex(bundle)) warm.push_back(bundle);
    auto result =
        farm_.acquire(request->worker_id(), request->session(), warm, {request->prefetch(), request->full()},
                      [&](const Job& job, const Lease& granted) {
                        const LeaseRow& row = granted.row;
                        v1::Lease& lease = *response->mutable_lease();
                        lease.set_token(row.token);
                        lease.set_unit_id(row.unit_id);
                        lease.set_job_id(row.job_id);
                        lease.set_bundle_sha256(job.row.bundle_sha256);
                        wire::to_proto(job.row.settings, *lease.mutable_settings());
                        const Unit& unit = job.units.at(row.unit_id).row.unit;
                        // In an audit, the pilot's lease is what it was before the pilot.
                        if (job.planned() && unit.kind != Unit::Kind::pilot)
                          wire::to_proto(state_of_units(job.row), *lease.mutable_named_state());
                        wire::to_proto(unit, *lease.mutable_unit());
                        lease.set_expected_seconds(row.expected_seconds);
                      });
    if (!result.ok()) return unauthenticated();
    response->set_retry_ms(result->retry_ms);
    response->set_drain(result->drain);
    if (!result->lease) return grpc::Status::OK;
    ++farm_.counters().leases;
    for (const StateRow& state : result->input.states) {
      v1::DecidedState& out = *response->mutable_lease()->add_states();
      out.set_name(state.name);
      out.set_sha256(state.sha256);
      out.set_size_bytes(state.size_bytes);
    }
    for (const UnitStart& start : result->input.chain_starts) {
      v1::ChainStart& out = *response->mutable_lease()->add_chain_starts();
      if (start.record && start.record->segments > 0)
        out.set_record(chains::encode(*start.record));
      else
        out.set_bootstrap_sample(start.bootstrap_sample);
    }
    return grpc::Status::OK;
  });
}

grpc::Status WorkerServiceImpl::Heartbeat(grpc::ServerContext*, const v1::HeartbeatRequest* request,
                                          v1::HeartbeatResponse* response) {
  if (request->units_size() > kMaxHeartbeatUnits)
    return wire::to_status(
        input_error(fmt::format("more than {} units", kMaxHeartbeatUnits)).with_field("units"));
  return as_worker(farm_, request->worker_id(), request->session(), [&](Scheduler& s, Now now) {
    std::vector<UnitReport> units;
    for (const v1::UnitProgress& u : request->units())
      units.push_back({u.token(), wire::from_proto(u.phase()), u.steps()});
    s.note_memory(request->worker_id(), request->resident_bytes());
    const HeartbeatResult result = s.heartbeat(request->worker_id(), units, now);
    for (const std::uint64_t token : result.revoked) response->add_revoked_tokens(token);
    for (const std::uint64_t token : result.cut) response->add_cut_tokens(token);
    response->set_drain(result.drain);
    response->set_heartbeat_ms(heartbeat_ms(farm_.options().master.lease_seconds, s.workers().size()));
  });
}

grpc::Status WorkerServiceImpl::ReturnLease(grpc::ServerContext*, const v1::ReturnLeaseRequest* request,
                                            v1::ReturnLeaseResponse*) {
  return as_worker(farm_, request->worker_id(), request->session(), [&](Scheduler& s, Now now) {
    s.return_lease(request->worker_id(), request->token(), now, request->computing());
  });
}

grpc::Status WorkerServiceImpl::FailUnit(grpc::ServerContext*, const v1::FailUnitRequest* request,
                                         v1::FailUnitResponse*) {
  return as_worker(farm_, request->worker_id(), request->session(), [&](Scheduler& s, Now now) {
    s.fail_unit(request->worker_id(), request->token(), wire::from_proto(request->cause()),
                clipped(request->message()), now);
  });
}

grpc::Status WorkerServiceImpl::CompletePilot(grpc::ServerContext*, const v1::CompletePilotRequest* request,
                                              v1::CompletePilotResponse* response) {
  auto state = wire::from_proto(request->named_state());
  if (!state.ok()) return wire::to_status(state.error());
  if (!std::isfinite(request->seconds_per_iteration()) || request->seconds_per_iteration() < 0)
    return wire::to_status(input_error("must be seconds, 0 or more").with_field("seconds_per_iteration"));
  if (request->plan().size() > (64U << 10))
    return wire::to_status(input_error("longer than 64 KiB").with_field("plan"));
  auto work = wire::from_proto(request->work());
  if (!work.ok()) return wire::to_status(work.error());
  const PilotResult result{*state, request->plan(), request->seconds_per_iteration(), std::move(*work)};
  Result<void> fits;
  const grpc::Status status =
      as_worker(farm_, request->worker_id(), request->session(), [&](Scheduler& s, Now now) {
        if (const Job* job = s.job_of_lease(request->worker_id(), request->token())) {
          const JobSettings& settings = job->row.settings;
          fits = validate(result.work, settings.width, settings.height);
          if (fits.ok() && result.work.epochs)
            if (auto rule = find_rule(result.work.epochs->rule); !rule.ok()) fits = rule.error();
          if (fits.ok()) fits = check_development(result.work);
          if (fits.ok()) fits = check_scale(result, settings);
          if (!fits.ok()) return;
          auto small = check_statistics(result.work, settings, farm_.statistics_limit());
          if (small.ok())
            small = check_memory(need_of(job->row, result.work), settings, farm_.memory_limit());
          if (!small.ok()) {
            const std::string id = job->row.id;
            s.fail_job(id, small.error().to_string(), now);  // no worker can help
            return;
          }
        }
        response->set_accepted(s.complete_pilot(request->worker_id(), request->token(), result, now));
      });
  return fits.ok() ? status : wire::to_status(fits.error());
}

grpc::Status WorkerServiceImpl::PushDelta(grpc::ServerContext* context,
                                          grpc::ServerReader<v1::DeltaChunk>* reader,
                                          v1::PushDeltaResponse* response) {
  return guarded([&] {
    if (farm_.stopping()) return stopping_status();
    // A sender that never says who it is and what it sends is cut off, too.
    const auto cancel = [context] { context->TryCancel(); };
    auto unknown = farm_.gate().enter_unknown(farm_.now().seconds, cancel);
    v1::DeltaChunk chunk;
    if (!reader->Read(&chunk)) return grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, "no chunk came");
    if (!chunk.has_header())
      return answer_early(*context, *reader,
                          wire::to_status(input_error("the first chunk must have it").with_field("header")));
    const auto refuse = [&](const grpc::Status& status) { return answer_early(*context, *reader, status); };
    if (!is_worker(farm_, chunk.header().worker_id(), chunk.header().session()))
      return refuse(unauthenticated());
    const auto parsed = from_message(chunk.header());
    if (!parsed.ok()) return refuse(wire::to_status(parsed.error()));
    const DeltaHeader& header = *parsed;
    if (const auto refusal = farm_.deltas().admit(header)) {
      response->set_verdict(to_message(refusal->verdict));
      response->set_message(refusal->message);
      return refuse(grpc::Status::OK);
    }
    const PushGate::Order order = farm_.deltas().order_of(header.job_id);
    auto ticket = farm_.gate().enter(header.worker_id, header.size_bytes, order, farm_.now().seconds, cancel);
    if (!ticket.ok()) {
      ++farm_.counters().queue_full;
      return refuse(wire::to_status_with_retry(
          ticket.error(), static_cast<std::uint32_t>(farm_.gate().retry_seconds(order) * 1000)));
    }
    unknown.reset();
    reader->SendInitialMetadata();  // there is a place: the sender, who waits for this, may send the bytes
    const double started = farm_.now().seconds, cpu_started = thread_cpu_seconds();
    BufferPool::Buffer buffer = [&] {
      const LargeWork large;
      return buffers_.take(header.size_bytes);
    }();
    std::string& bytes = *buffer;
    bool too_long = false;
    do {
      if (chunk.data().size() > Limits::max_chunk_bytes)
        return refuse(wire::to_status(
            input_error(fmt::format("larger than {} bytes", Limits::max_chunk_bytes)).with_field("data")));
      if (bytes.size() + chunk.data().size() > header.size_bytes) {
        too_long = true;  // one byte too many makes the size differ, which is what the verdict says
        bytes += '\0';
        refuse(grpc::Status::OK);
        break;
      }
      bytes += chunk.data();
      (*ticket)->progress(farm_.now().seconds);
      chunk.Clear();
    } while (reader->Read(&chunk));
    // A sender that went away, or was cut off, mid-stream: no verdict, its lease runs on and it may send
    // again.
    if (!too_long && bytes.size() < header.size_bytes && context->IsCancelled())
      return grpc::Status(grpc::StatusCode::CANCELLED, "the delta did not arrive whole in time");
    (*ticket)->all_here();
    DeltaIntake::Verdict verdict;
    try {
      verdict = farm_.deltas().deliver(header, bytes,
                                       {farm_.now().seconds - started, thread_cpu_seconds() - cpu_started});
    } catch (const std::bad_alloc&) {  // nothing of it is merged: the worker sends it again
      const Error error = out_of_memory("a delta cannot be merged");
      log::warn(error.to_string(), {.job = header.job_id, .worker = header.worker_id});
      farm_.with_scheduler(
          [&](Scheduler& s) { s.lack_memory(header.job_id, error.to_string(), farm_.now()); });
      return wire::to_status_with_retry(error, 1000);
    }
    response->set_verdict(to_message(verdict.verdict));
    response->set_message(verdict.message);
    return grpc::Status::OK;
  });
}

grpc::Status WorkerServiceImpl::GetBundle(grpc::ServerContext*, const v1::GetBundleRequest* request,
                                          v1::Bundle* response) {
  return guarded([&] {
    if (!is_worker(farm_, request->worker_id(), request->session())) return unauthenticated();
    if (!is_sha256_hex(request->bundle_sha256()))
      return wire::to_status(input_error("must be 64 lower-case hex digits").with_field("bundle_sha256"));
    auto bytes = farm_.store().bundle(request->bundle_sha256());
    if (!bytes.ok()) return wire::to_status(bytes.error());
    if (!*bytes || !response->ParseFromString(**bytes)) return not_found("bundle", request->bundle_sha256());
    return grpc::Status::OK;
  });
}

grpc::Status WorkerServiceImpl::FetchBlob(grpc::ServerContext* context, const v1::FetchBlobRequest* request,
                                          grpc::ServerWriter<v1::FetchBlobChunk>* writer) {
  return guarded([&] {
    if (!is_worker(farm_, request->worker_id(), request->session())) return unauthenticated();
    if (!is_sha256_hex(request->sha256()))
      return wire::to_status(input_error("must be 64 lower-case hex digits").with_field("sha256"));
    const std::string& sha256 = request->sha256();
    const auto lost = [&](bool damaged) {
      return grpc::Status(grpc::StatusCode::DATA_LOSS, farm_.blob_lost(sha256, damaged));
    };
    // A file that is there and cannot be read, for want of a permission say, is the master's trouble as well.
    const auto unreadable = [](const Error& error) {
      return grpc::Status(grpc::StatusCode::DATA_LOSS, "the master " + error.to_string());
    };
    auto opened = farm_.blobs().read(sha256);
    if (!opened.ok()) return unreadable(opened.error());
    if (!*opened) return lost(false);
    BlobStore::Reader& blob = **opened;
    if (request->size_bytes() != 0 && request->size_bytes() != blob.size()) {
      const auto whole = farm_.blobs().check(sha256);
      if (!whole.ok()) return unreadable(whole.error());
      if (!*whole) return lost(true);
      return wire::to_status(
          input_error(fmt::format("the blob has {} bytes, not {}", blob.size(), request->size_bytes()))
              .with_field("size_bytes"));
    }
    if (request->offset() > blob.size())
      return wire::to_status(
          input_error(fmt::format("the blob has {} bytes", blob.size())).with_field("offset"));
    // A worker that takes nothing is cut off.
    const auto guard = farm_.gate().enter_silent(farm_.now().seconds, [context] { context->TryCancel(); });
    v1::FetchBlobChunk chunk;
    // Bytes that the worker has already are read too: the hash is that of all bytes.
    std::uint64_t skip = request->offset(), left = blob.size();
    do {
      const std::uint64_t most =
          skip > 0 ? std::min<std::uint64_t>(skip, wire::kStreamBytes) : wire::kStreamBytes;
      if (auto read = blob.next(most, *chunk.mutable_data()); !read.ok())
        return read.error().kind == ErrorKind::failed ? lost(true) : unreadable(read.error());
      chunk.set_size_bytes(blob.size());
      left -= chunk.data().size();
      if (left == 0) farm_.blob_found(sha256);
      if (skip > 0) {
        skip -= chunk.data().size();
        chunk.clear_data();
        guard->progress(farm_.now().seconds);
        if (left > 0) continue;
      }
      if (!writer->Write(chunk)) return grpc::Status(grpc::StatusCode::CANCELLED, "the worker went away");
      guard->progress(farm_.now().seconds);
    } while (left > 0 && !context->IsCancelled() && !farm_.stopping());
    return left == 0 ? grpc::Status::OK : stopping_status();
  });
}

grpc::Status WorkerServiceImpl::Deregister(grpc::ServerContext*, const v1::DeregisterRequest* request,
                                           v1::DeregisterResponse*) {
  return as_worker(farm_, request->worker_id(), request->session(),
                   [&](Scheduler& s, Now now) { s.deregister(request->worker_id(), now); });
}

}  // namespace candela::master
