// The people and programs of a farm with TLS, each with a role of its own.
#pragma once

#include <grpcpp/security/credentials.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "common/wire/authority.h"
#include "common/wire/certificates.h"
#include "tests/farm/farm.h"

namespace candela::farm {

// Certificates for "master", "worker", "alice" and "bob", who submit, "olga", who operates, and "rita", who
// reads. Valid from before any day that a test's clock shows until after it.
class People {
 public:
  explicit People(Farm& farm) : farm_(farm), folder_(farm.folder() / "tls") {
    constexpr std::int64_t kDays = 86400;
    const wire::Validity validity{-1000 * kDays, 1000 * kDays};
    const auto authority = wire::Authority::make(folder_, "farm of a test", validity);
    if (!authority.ok()) throw std::runtime_error(authority.error().to_string());
    const auto sign = [&](const std::string& name, const wire::Roles& roles,
                          const std::vector<std::string>& hosts = {}) {
      const auto made = authority->sign({name, hosts, roles, validity});
      if (!made.ok()) throw std::runtime_error(made.error().to_string());
    };
    sign("master", {}, {"127.0.0.1", "localhost"});
    sign("worker", {wire::Role::worker});
    for (const char* name : {"alice", "bob"}) sign(name, {wire::Role::submit});
    sign("olga", {wire::Role::operate});
    sign("rita", {wire::Role::read});
    farm.set_credentials(credentials("olga"));
  }

  // Options of a program that is, or acts for, this one.
  std::vector<std::string> options(const std::string& name, std::vector<std::string> more = {}) const {
    for (const char* file : {"--tls-cert", "--tls-key", "--tls-ca"}) {
      const std::string kind = file;
      more.push_back(kind);
      more.push_back(
          (folder_ / (kind == "--tls-ca" ? "ca.pem" : name + (kind == "--tls-key" ? ".key" : ".pem")))
              .string());
    }
    return more;
  }
  std::shared_ptr<grpc::ChannelCredentials> credentials(const std::string& name) const {
    const auto files =
        wire::load_credentials({(folder_ / (name + ".pem")).string(), (folder_ / (name + ".key")).string(),
                                (folder_ / "ca.pem").string()});
    if (!files.ok()) throw std::runtime_error(files.error().to_string());
    return grpc::SslCredentials({files->ca, files->key, files->cert});
  }
  // `candela WORDS` by this person.
  CommandResult run(const std::string& name, std::vector<std::string> words) const {
    return farm_.candela(options(name, std::move(words)));
  }
  void expect_done(const std::string& name, const std::vector<std::string>& words) const {
    const CommandResult result = run(name, words);
    EXPECT_EQ(result.exit_code, 0) << name << ": " << words.front() << ": " << result.err;
  }
  // Refused for want of this role.
  void expect_refused(const std::string& name, const std::vector<std::string>& words,
                      const std::string& role) const {
    const CommandResult result = run(name, words);
    EXPECT_EQ(result.exit_code, 1) << name << ": " << words.front() << ": " << result.err;
    EXPECT_NE(result.err.find("role '" + role + "' is missing"), std::string::npos)
        << name << ": " << words.front() << ": " << result.err;
  }

 private:
  Farm& farm_;
  std::filesystem::path folder_;
};

}  // namespace candela::farm
