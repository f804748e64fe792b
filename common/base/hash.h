// SHA-256 (OpenSSL): names of blobs, bundles and deltas; signatures of notices.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace candela {

// Lower-case hex of the SHA-256 of `data`.
std::string sha256_hex(std::string_view data);
// Lower-case hex of the HMAC (RFC 2104) of `data` with SHA-256.
std::string hmac_sha256_hex(std::string_view key, std::string_view data);
bool is_sha256_hex(std::string_view text);  // exactly 64 lower-case hex digits

class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;
  void update(std::string_view data);
  std::string finish_hex();  // once

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace candela
