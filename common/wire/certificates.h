// Certificates in PEM files: read, and checked by whoever has the file. gRPC finds bad ones only when the
// first connection fails, without a word of which file.
#pragma once

#include <string>
#include <vector>

#include "common/base/result.h"
#include "common/wire/roles.h"

namespace candela::wire {

// PEM files; all three empty: no TLS.
struct TlsFiles {
  std::string cert, key, ca;
  bool any() const { return !cert.empty() || !key.empty() || !ca.empty(); }
};

// Facts that a certificate states about its holder.
struct Holder {
  std::string name;  // the subject's common name
  Roles roles;
};

struct Credentials {
  std::string cert, key, ca;  // the files' contents
  Holder holder;
  // Warnings, with which the files can be used: each names the file and the mend.
  std::vector<std::string> warnings;
};

// Errors name the option, the file and the mend: a file that cannot be read, a key of another certificate or
// one that every user can read, a certificate or an authority that has expired. Warnings: a certificate that
// the authority did not sign, or that expires soon.
Result<Credentials> load_credentials(const TlsFiles& tls);

}  // namespace candela::wire
