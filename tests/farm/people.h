// The people and programs of a farm: with TLS each with a role of its own, without TLS all with one token.
#pragma once

#include <grpcpp/security/credentials.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "common/wire/authority.h"
#include "common/wire/certificates.h"
#include "tests/farm/farm.h"

namespace candela::farm {

// With TLS there are certificates for "master", "worker", "alice" and "bob", who submit, "olga", who
// operates, and "rita", who reads, valid from before any day that a test's clock shows until after it.
class People {
 public:
  People(Farm& farm, bool with_tls) : farm_(farm), folder_(farm.folder() / "people"), with_tls_(with_tls) {
    if (with_tls) {
      make_certificates();
      return;
    }
    std::filesystem::create_directory(folder_);
    std::ofstream(wrong_token()) << std::string(64, 'a');
    ::chmod(wrong_token().c_str(), 0600);
  }

  // Options of a program that is, or acts for, this one.
  std::vector<std::string> options(const std::string& name, std::vector<std::string> more = {}) const {
    if (!with_tls_) return more;
    const std::vector<std::pair<std::string, std::string>> files = {
        {"--tls-cert", name + ".pem"}, {"--tls-key", name + ".key"}, {"--tls-ca", "ca.pem"}};
    for (const auto& [option, file] : files) {
      more.push_back(option);
      more.push_back((folder_ / file).string());
    }
    return more;
  }
  // Null, which stands for the token, without TLS.
  std::shared_ptr<grpc::ChannelCredentials> credentials(const std::string& name) const {
    if (!with_tls_) return nullptr;
    const auto files =
        wire::load_credentials({(folder_ / (name + ".pem")).string(), (folder_ / (name + ".key")).string(),
                                (folder_ / "ca.pem").string()});
    if (!files.ok()) throw std::runtime_error(files.error().to_string());
    return grpc::SslCredentials({files->ca, files->key, files->cert});
  }
  // Credentials of a person without this role; without TLS, of one without the token.
  std::shared_ptr<grpc::ChannelCredentials> credentials_without_role(const std::string& name) const {
    return with_tls_ ? credentials(name) : grpc::InsecureChannelCredentials();
  }
  // `candela WORDS` by this person.
  CommandResult run(const std::string& name, std::vector<std::string> words) const {
    return farm_.candela(options(name, std::move(words)));
  }
  void expect_done(const std::string& name, const std::vector<std::string>& words) const {
    const CommandResult result = run(name, words);
    EXPECT_EQ(result.exit_code, 0) << name << ": " << words.front() << ": " << result.err;
  }
  // Refused for want of this role. Without TLS the person has another token than the master's, and the first
  // that the command may not do is to read.
  void expect_refused(const std::string& name, std::vector<std::string> words, std::string role) const {
    const std::string what = name + ": " + words.front();
    if (!with_tls_) {
      words.insert(words.end(), {"--token-file", wrong_token().string()});
      role = "read";
    }
    const CommandResult result = run(name, words);
    EXPECT_EQ(result.exit_code, 1) << what << ": " << result.err;
    EXPECT_NE(result.err.find("role '" + role + "' is missing"), std::string::npos)
        << what << ": " << result.err;
  }

 private:
  std::filesystem::path wrong_token() const { return folder_ / "wrong-token"; }
  void make_certificates() {
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
    farm_.set_credentials(credentials("olga"));
  }

  Farm& farm_;
  std::filesystem::path folder_;
  bool with_tls_;
};

}  // namespace candela::farm
