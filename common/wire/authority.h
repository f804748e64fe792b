// The authority of a farm, as two files of a folder, and the certificates that it signs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/roles.h"

namespace candela::wire {

// Seconds from now.
struct Validity {
  std::int64_t begin = -300;  // clocks of a farm differ a little
  std::int64_t end = std::int64_t{825} * 86400;
};

struct CertificateRequest {
  std::string name;                // of the files, and the common name: letters, digits, '-', '_', '.', '@'
  std::vector<std::string> hosts;  // names and addresses of a server; none: a client's certificate
  Roles roles;
  Validity validity = {};
};

class Authority {
 public:
  // Makes ca.pem and ca.key. No file is overwritten.
  static Result<Authority> make(const std::filesystem::path& folder, const std::string& name,
                                const Validity& validity = {-300, std::int64_t{3650} * 86400});
  // Reads them.
  static Result<Authority> open(const std::filesystem::path& folder);
  ~Authority();
  Authority(Authority&& other) noexcept;
  Authority& operator=(Authority&& other) noexcept;

  // Makes NAME.pem and NAME.key, readable for this user alone. No file is overwritten. Their paths.
  Result<std::vector<std::filesystem::path>> sign(const CertificateRequest& request) const;

 private:
  struct State;
  explicit Authority(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

// Errors: no name for files and certificates; no name or address of a host.
Result<void> check_certificate_name(const std::string& name);
Result<void> check_certificate_host(const std::string& host);

}  // namespace candela::wire
