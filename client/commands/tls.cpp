// candela tls: the certificates of a farm.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <ostream>

#include "client/commands/commands.h"
#include "client/context.h"
#include "client/values.h"
#include "common/wire/authority.h"
#include "common/wire/token.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

struct TlsOptions {
  std::string action;
  std::vector<std::string> names, people, roles;
  std::optional<std::string> folder, days;
};

// "submit", "read,worker"
Result<wire::Roles> parse_roles(std::string_view text, const char* option) {
  wire::Roles roles;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    const std::string_view word = text.substr(at, comma - at);
    const auto role = wire::role_of(word);
    if (!role)
      return usage_error(fmt::format("'{}' is no role", printable(std::string(word))))
          .with_field(option)
          .with_mend("the roles are worker, submit, operate and read");
    roles.add(*role);
    at = comma + 1;
  }
  return roles;
}

Result<wire::Validity> validity_of(const TlsOptions& options) {
  wire::Validity validity;
  if (options.days) {
    CANDELA_ASSIGN(const std::uint64_t days, parse_count(*options.days, "--days", 1, 36500));
    validity.end = static_cast<std::int64_t>(days) * 86400;
  }
  return validity;
}

Result<std::vector<wire::CertificateRequest>> requests_of_init(const TlsOptions& options) {
  if (!options.roles.empty())
    return usage_error("is for `candela tls add`").with_field("--role").with_mend("use --person NAME=ROLE");
  std::vector<wire::CertificateRequest> requests = {
      {.name = "master", .hosts = options.names, .roles = {}},
      {.name = "worker", .hosts = {}, .roles = {wire::Role::worker}}};
  std::vector<std::string> people = options.people;
  if (people.empty()) {
    const std::string user = wire::user_at_host();
    people.push_back(user.substr(0, user.find('@')) + "=operate");
  }
  for (const std::string& person : people) {
    const std::size_t equals = person.find('=');
    if (equals == std::string::npos)
      return usage_error(fmt::format("'{}' is not NAME=ROLE", printable(person)))
          .with_field("--person")
          .with_mend("such as --person alice=submit");
    CANDELA_ASSIGN(const wire::Roles roles, parse_roles(person.substr(equals + 1), "--person"));
    requests.push_back({.name = person.substr(0, equals), .hosts = {}, .roles = roles});
  }
  return requests;
}

Result<std::vector<wire::CertificateRequest>> requests_of_add(const TlsOptions& options) {
  if (!options.people.empty())
    return usage_error("is for `candela tls init`").with_field("--person").with_mend("use --role ROLE");
  if (options.roles.empty())
    return usage_error("no role is given").with_field("--role").with_mend("such as --role submit");
  wire::Roles roles;
  for (const std::string& text : options.roles) {
    CANDELA_ASSIGN(const wire::Roles more, parse_roles(text, "--role"));
    for (const wire::Role role :
         {wire::Role::worker, wire::Role::submit, wire::Role::operate, wire::Role::read})
      if (more.has(role)) roles.add(role);
  }
  std::vector<wire::CertificateRequest> requests;
  for (const std::string& name : options.names)
    requests.push_back({.name = name, .hosts = {}, .roles = roles});
  return requests;
}

// All that can be refused is refused before a file is made.
Result<void> check(const std::vector<wire::CertificateRequest>& requests, const fs::path& folder) {
  for (std::size_t i = 0; i < requests.size(); ++i) {
    const wire::CertificateRequest& request = requests[i];
    CANDELA_TRY(wire::check_certificate_name(request.name));
    for (const std::string& host : request.hosts) CANDELA_TRY(wire::check_certificate_host(host));
    for (std::size_t k = 0; k < i; ++k)
      if (requests[k].name == request.name)
        return usage_error(fmt::format("two certificates would be named '{}'", request.name))
            .with_mend("give each a name of its own");
    for (const char* ending : {".pem", ".key"}) {
      const fs::path file = folder / (request.name + ending);
      if (std::error_code code; fs::exists(fs::symlink_status(file, code)))
        return refused_error("the file is there already, and is not overwritten")
            .at(file.string(), 0)
            .with_mend("give another --folder or name, or move the file away");
    }
  }
  return {};
}

Result<int> run_tls(Context& context, const TlsOptions& options) {
  static constexpr std::array<std::string_view, 2> kActions = {"init", "add"};
  CANDELA_TRY(parse_choice(options.action, "ACTION", kActions));
  const bool init = options.action == "init";
  CANDELA_ASSIGN(const wire::Validity validity, validity_of(options));
  CANDELA_ASSIGN(auto requests, init ? requests_of_init(options) : requests_of_add(options));
  const fs::path folder = options.folder.value_or("tls");
  CANDELA_TRY(check(requests, folder));
  auto authority = init ? wire::Authority::make(folder, "candela farm " + options.names.front())
                        : wire::Authority::open(folder);
  if (!authority.ok()) {
    Error error = std::move(authority).error();
    if (!init && error.mend.empty()) error.mend = "make an authority with: candela tls init HOST";
    return error;
  }
  if (init)
    context.out << fmt::format("{} {}: the farm's authority; keep ca.key off the farm's machines\n",
                               (folder / "ca.pem").string(), (folder / "ca.key").string());
  for (wire::CertificateRequest& request : requests) {
    request.validity = validity;
    CANDELA_ASSIGN(const std::vector<fs::path> files, authority->sign(request));
    context.out << fmt::format("{} {}: {}\n", files[0].string(), files[1].string(),
                               request.hosts.empty() ? "role " + request.roles.text()
                                                     : "the master at " + join(request.hosts, ", "));
  }
  return 0;
}

}  // namespace

void add_tls(CLI::App& app, Context& context) {
  auto options = std::make_shared<TlsOptions>();
  CLI::App* sub = app.add_subcommand("tls",
                                     "Make certificates: init for an authority, the master, the workers and "
                                     "people; add for more people and workers");
  sub->add_option("action", options->action, "init or add")->required()->type_name("ACTION");
  sub->add_option("names", options->names,
                  "init: names and addresses of the master; add: names of new certificates")
      ->required()
      ->type_name("NAME...");
  add_text(*sub, "--folder", options->folder, "Folder of the files; default: tls", "DIR");
  add_texts(
      *sub, "--person", options->people,
      "init: a person with roles, such as alice=operate or bob=submit; default: you=operate; repeatable",
      "NAME=ROLES");
  add_texts(*sub, "--role", options->roles, "add: worker, submit, operate or read; repeatable", "ROLES");
  add_text(*sub, "--days", options->days,
           "Days that certificates are valid; default: 825, the authority's 3650", "N");
  set_command(*sub, context, run_tls, options);
}

}  // namespace candela::client
