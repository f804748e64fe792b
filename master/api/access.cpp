#include "master/api/access.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "common/base/text.h"
#include "common/wire/token.h"
#include "common/wire/wire.h"

namespace candela::master {
namespace {

using wire::Role;

constexpr std::array kRules = {
    Rule{"FarmService/GetServerInfo", Role::read, Subject::farm, true},
    Rule{"FarmService/FindMissingBlobs", Role::submit},
    Rule{"FarmService/UploadBlob", Role::submit},
    Rule{"FarmService/Submit", Role::submit},
    Rule{"FarmService/ListJobs", Role::read},
    Rule{"FarmService/GetJob", Role::read},
    Rule{"FarmService/FindJobs", Role::read},
    Rule{"FarmService/GetGroup", Role::read},
    Rule{"FarmService/SteerGroup", Role::submit, Subject::job},
    Rule{"FarmService/WatchJob", Role::read},
    Rule{"FarmService/FetchImage", Role::read},
    Rule{"FarmService/PauseJob", Role::submit, Subject::job},
    Rule{"FarmService/ResumeJob", Role::submit, Subject::job},
    Rule{"FarmService/ExtendJob", Role::submit, Subject::job},
    Rule{"FarmService/CancelJob", Role::submit, Subject::job},
    Rule{"FarmService/SetPriority", Role::submit, Subject::job},
    Rule{"FarmService/ListEvents", Role::read},
    Rule{"FarmService/ListWorkers", Role::read, Subject::farm, true},
    Rule{"FarmService/DrainWorker", Role::operate, Subject::worker},
    Rule{"FarmService/PauseWorker", Role::operate},
    Rule{"FarmService/ResumeWorker", Role::operate},
    Rule{"FarmService/DistrustWorker", Role::operate},
    Rule{"FarmService/TrustWorker", Role::operate},
    Rule{"FarmService/GetLedger", Role::read},
    // It reads all files of a job, and sets damaged ones aside.
    Rule{"FarmService/VerifyJobs", Role::submit, Subject::job_or_store},
    Rule{"FarmService/RepairJob", Role::submit, Subject::job_or_store},
    Rule{"WorkerService/Register", Role::worker},
    Rule{"WorkerService/AcquireLease", Role::worker},
    Rule{"WorkerService/Heartbeat", Role::worker},
    Rule{"WorkerService/ReturnLease", Role::worker},
    Rule{"WorkerService/FailUnit", Role::worker},
    Rule{"WorkerService/CompletePilot", Role::worker},
    Rule{"WorkerService/PushDelta", Role::worker},
    Rule{"WorkerService/GetBundle", Role::worker},
    Rule{"WorkerService/FetchBlob", Role::worker},
    Rule{"WorkerService/Deregister", Role::worker},
};

constexpr std::size_t kMaxNameBytes = 256;

bool carries(const grpc::ServerContext& context, std::string_view token) {
  const auto [first, last] = context.client_metadata().equal_range(wire::kTokenField);
  return first != last && wire::same_token({first->second.data(), first->second.size()}, token);
}

}  // namespace

std::span<const Rule> rules() {
  return kRules;
}

const Rule* rule_of(std::string_view method) {
  const auto found =
      std::find_if(kRules.begin(), kRules.end(), [&](const Rule& rule) { return rule.method == method; });
  return found == kRules.end() ? nullptr : &*found;
}

// gRPC names no peer of an in-process channel.
bool Access::is_in_process(const grpc::ServerContext& context) const {
  return carries(context, own_token_);
}

Caller Access::caller(const grpc::ServerContext& context) const {
  if (is_in_process(context)) return {"", wire::Roles::all()};
  if (!token_.empty()) {
    return carries(context, token_) ? Caller{"", wire::Roles::all()} : Caller{};
  }
  Caller caller;
  const auto peer = context.auth_context();
  if (!peer || !peer->IsPeerAuthenticated()) return caller;
  for (const grpc::string_ref& name : peer->FindPropertyValues(GRPC_X509_CN_PROPERTY_NAME))
    caller.name = std::string(name.data(), name.size());
  // Without a name that a message can carry a caller is refused: jobs could not be told apart.
  if (caller.name.empty() || caller.name.size() > kMaxNameBytes || !is_utf8(caller.name)) return {};
  for (const grpc::string_ref& uri : peer->FindPropertyValues(GRPC_PEER_URI_PROPERTY_NAME))
    wire::add_role_of_uri(caller.roles, {uri.data(), uri.size()});
  return caller;
}

grpc::Status Access::refuse(const grpc::ServerContext& context, const Caller& caller, Role missing,
                            const std::string& why) const {
  Error error = refused_error(fmt::format("role '{}' is missing: ", wire::name(missing)));
  if (token_.empty()) {
    error.message += fmt::format("the certificate '{}' has {}{}", caller.name, caller.roles.text(), why);
    error.mend = missing == Role::operate ? "ask an operator of the farm, or " + wire::needs_role(missing)
                                          : wire::needs_role(missing);
  } else {
    const bool sent = context.client_metadata().count(wire::kTokenField) > 0;
    error.message += sent ? "the call carries a token that is not this master's"
                          : "the call carries no token of this master";
    error.mend =
        fmt::format("be the user whose master this is, or give --token-file with a copy of its file {}",
                    token_file_.string());
  }
  grpc::Status status = wire::to_status(error);
  return {grpc::StatusCode::PERMISSION_DENIED, status.error_message(), status.error_details()};
}

grpc::Status Access::permit(const grpc::ServerContext& context, std::string_view method,
                            const std::function<Owner()>& owner_of_subject) const {
  if (!open_ && !is_in_process(context)) return {grpc::StatusCode::UNAVAILABLE, "the master is starting"};
  const Caller caller = this->caller(context);
  const Rule* rule = rule_of(method);
  if (rule == nullptr) return refuse(context, caller, Role::operate, "; this call is in no table of roles");
  if (rule->worker_too && caller.roles.allow(Role::worker)) return grpc::Status::OK;
  if (!token_.empty() || caller.name.empty())  // nothing is anybody's own
    return caller.roles.allow(rule->role) ? grpc::Status::OK : refuse(context, caller, rule->role, "");
  if (caller.roles.empty()) return refuse(context, caller, rule->role, "");
  const Owner owner = rule->subject == Subject::farm ? Owner{} : owner_of_subject();
  const bool own = owner.known && owner.name == caller.name;
  if (rule->subject == Subject::worker && own && caller.roles.allow(Role::worker)) return grpc::Status::OK;
  if (!caller.roles.allow(rule->role)) return refuse(context, caller, rule->role, "");
  if (rule->subject == Subject::farm || rule->subject == Subject::worker || own ||
      caller.roles.allow(Role::operate))
    return grpc::Status::OK;
  if (owner.known)
    return refuse(context, caller, Role::operate,
                  owner.name.empty() ? ", and nobody knows who submitted the job"
                                     : fmt::format(", and the job is of '{}'", owner.name));
  if (rule->subject == Subject::job_or_store)
    return refuse(context, caller, Role::operate, ", and this is about no job of its own");
  return grpc::Status::OK;  // the call itself says that there is no such job
}

}  // namespace candela::master
