// One table of all calls and the roles that may make them, and the one place that asks it
// (guarded_services.h).
// docs/decisions/077-roles.md
#pragma once

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>

#include "common/wire/roles.h"

namespace candela::master {

// The maker of a call.
struct Caller {
  std::string name;  // of the certificate; empty without TLS, where a caller has a token or has no role
  wire::Roles roles;
};

// Object of a call, if it may be the caller's own.
enum class Subject : std::uint8_t {
  farm,          // nobody's
  job,           // the caller's own needs the role, others' need `operate`
  worker,        // `worker` is enough for one that registered with the caller's certificate
  job_or_store,  // as job; `operate` for what no job is
};

struct Rule {
  std::string_view method;  // "FarmService/Submit"
  wire::Role role;
  Subject subject = Subject::farm;
  bool worker_too = false;  // workers look at the farm's list of them, and leave it
};
std::span<const Rule> rules();
const Rule* rule_of(std::string_view method);  // null: there is none, and nobody may call it

// The owner of what a call is about.
struct Owner {
  bool known = false;
  std::string name;
};

class Access {
 public:
  // Certificates tell the roles; with a token, which lies in `token_file`, that alone. `own_token` is carried
  // by the calls of this process, and never leaves it.
  explicit Access(std::string own_token) : own_token_(std::move(own_token)) {}
  Access(std::string own_token, std::string token, std::filesystem::path token_file)
      : own_token_(std::move(own_token)), token_(std::move(token)), token_file_(std::move(token_file)) {}

  Caller caller(const grpc::ServerContext& context) const;
  // OK, or PERMISSION_DENIED with the role that is missing and the mend.
  // `owner` is asked for calls that may be about the caller's own, of callers that have a role.
  grpc::Status permit(const grpc::ServerContext& context, std::string_view method,
                      const std::function<Owner()>& owner) const;
  // A program of the master's own process calls.
  bool is_in_process(const grpc::ServerContext& context) const;
  // Until then calls are told to come again: where programs look for the token it is not yet.
  void open() { open_ = true; }

 private:
  grpc::Status refuse(const grpc::ServerContext& context, const Caller& caller, wire::Role missing,
                      const std::string& why) const;

  std::atomic<bool> open_{false};
  std::string own_token_;
  std::string token_;  // empty: certificates
  std::filesystem::path token_file_;
};

}  // namespace candela::master
