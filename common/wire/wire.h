// Wire messages <-> plain structures, with validation of everything that arrives. An error names the message
// field.
#pragma once

#include <grpcpp/grpcpp.h>

#include <optional>

#include "candela/v1/job.pb.h"
#include "candela/v1/worker.pb.h"
#include "common/base/result.h"
#include "common/base/work_monitor.h"
#include "common/chains/chains.h"
#include "common/film/index_text.h"
#include "common/job/bundle.h"
#include "common/job/failure.h"
#include "common/job/job.h"
#include "common/stages/work_plan.h"
#include "common/wire/address.h"
#include "common/wire/certificates.h"

namespace candela::wire {

void to_proto(const JobSettings& settings, v1::JobSettings& out);
void to_proto(const StopRule& stop, v1::StopRule& out);
// `indices`: of the rule; empty: it has none.
void to_proto(const StopRule& stop, const film::HalfSets& indices, v1::StopRule& out);
void to_proto(const Unit& unit, v1::Unit& out);
void to_proto(const NamedState& state, v1::NamedState& out);
void to_proto(const bundle::Bundle& bundle, v1::Bundle& out);
void to_proto(const ChainPlan& plan, v1::ChainPlan& out);
void to_proto(const WorkPlan& plan, v1::WorkPlan& out);
// The plan and what is done of the bootstrap are the caller's.
void to_proto(const chains::Summary& summary, v1::ChainStatus& out);
// A start is a record once there are segments behind it.
void to_proto(const chains::ChainStart& start, v1::ChainStart& out);

// Limits and closed sets are checked: extents, names, counts, finite numbers, known filter/sampler/isa. The
// integrator and its settings are checked for form only: their meaning is the renderer's.
Result<JobSettings> from_proto(const v1::JobSettings& message);
// At least one limit, or else indices_of().
Result<StopRule> from_proto(const v1::StopRule& message);
Result<film::HalfSets> indices_of(const v1::StopRule& message);  // empty: the rule has none
Result<Unit> from_proto(const v1::Unit& message);
Result<NamedState> from_proto(const v1::NamedState& message);
Result<bundle::Bundle> from_proto(const v1::Bundle& message);
// A value that we do not know is the worker's fault, which sent it.
FailureCause from_proto(v1::FailureCause cause);
v1::FailureCause to_proto(FailureCause cause);
// None: the worker does not tell.
std::optional<WorkPhase> from_proto(v1::WorkPhase phase);
v1::WorkPhase to_proto(WorkPhase phase);
Result<ChainPlan> from_proto(const v1::ChainPlan& message);
// Checked for form; validate() of work_plan.h checks its meaning for the job's size.
Result<WorkPlan> from_proto(const v1::WorkPlan& message);
Result<chains::Summary> from_proto(const v1::ChainStatus& message);
Result<chains::ChainStart> from_proto(const v1::ChainStart& message);
// Error <-> grpc::Status. The kind survives the trip (input, usage -> INVALID_ARGUMENT; unreachable ->
// UNAVAILABLE; refused -> FAILED_PRECONDITION; resource -> RESOURCE_EXHAUSTED; failed -> ABORTED; internal ->
// INTERNAL), as do message and field, in one line. from_status maps DEADLINE_EXCEEDED, UNAVAILABLE to
// unreachable and NOT_FOUND to input. The parts of the error travel in the status's details as well, so that
// from_status(to_status(e)) is e, save that its texts are cut to about a kilobyte each.
grpc::Status to_status(const Error& error);
Error from_status(const grpc::Status& status);
// "Try again after so many milliseconds": an error status whose details carry the wait. retry_ms() is
// `otherwise` where a status names none, and never above one minute.
grpc::Status to_status_with_retry(const Error& error, std::uint32_t retry_ms);
std::uint32_t retry_ms(const grpc::Status& status, std::uint32_t otherwise);

// Names of job states as scripts see them: "queued", "running", ...
std::string_view name(v1::JobState state);

// Refuses a non-loopback address without TLS unless `insecure`.
Result<std::shared_ptr<grpc::ServerCredentials>> server_credentials(const Address& address,
                                                                    const TlsFiles& tls, bool insecure);
// `role`: what the caller is about to do; an error if its certificate does not have it.
Result<std::shared_ptr<grpc::ChannelCredentials>> channel_credentials(
    const Address& address, const TlsFiles& tls, bool insecure, std::optional<Role> role = std::nullopt);
// Mend for a certificate that lacks a role.
std::string needs_role(Role role);

}  // namespace candela::wire
