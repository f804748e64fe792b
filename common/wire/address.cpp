// Addresses and transport credentials. Beyond loopback there is mutual TLS or an explicit --insecure, nothing
// else.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>

#include <algorithm>
#include <charconv>

#include "common/base/log.h"
#include "common/wire/wire.h"

namespace candela::wire {
namespace {

constexpr std::size_t kMaxHostBytes = 253;  // of a DNS name

bool is_host_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '-' ||
         c == '_';
}

Error needs_tls(const Address& address) {
  return usage_error(fmt::format("{} is not a loopback address and there is no TLS", address.text()))
      .with_mend("give --tls-cert, --tls-key and --tls-ca, or --insecure on a network you trust");
}

}  // namespace

std::string needs_role(Role role) {
  return fmt::format("have a certificate signed with the subjectAltName URI:{} (candela tls add)",
                     role_uri(role));
}

std::string Address::text() const {
  return host.find(':') != std::string::npos ? fmt::format("[{}]:{}", host, port)
                                             : fmt::format("{}:{}", host, port);
}

Result<Address> parse_address(std::string_view text, std::string_view option_name) {
  const auto wrong = [&](std::string_view why) {
    return usage_error(fmt::format("'{}' is not HOST:PORT: {}", text.substr(0, 300), why))
        .with_field(std::string(option_name));
  };
  Address address;
  std::string_view port;
  if (text.starts_with('[')) {
    const std::size_t close = text.find(']');
    if (close == std::string_view::npos) return wrong("']' is missing");
    address.host = text.substr(1, close - 1);
    if (!text.substr(close + 1).starts_with(':')) return wrong("the port is missing");
    port = text.substr(close + 2);
    in6_addr ip{};
    if (::inet_pton(AF_INET6, address.host.c_str(), &ip) != 1)
      return wrong("no IPv6 address within the brackets");
    const bool mapped = IN6_IS_ADDR_V4MAPPED(&ip) && ip.s6_addr[12] == 127;
    address.loopback = IN6_IS_ADDR_LOOPBACK(&ip) || mapped;
  } else {
    const std::size_t colon = text.find(':');
    if (colon == std::string_view::npos) return wrong("the port is missing");
    if (text.find(':', colon + 1) != std::string_view::npos)
      return wrong("an IPv6 address goes within brackets");
    address.host = text.substr(0, colon);
    port = text.substr(colon + 1);
    if (address.host.empty()) return wrong("the host is missing");
    if (address.host.size() > kMaxHostBytes || address.host.front() == '-' ||
        !std::all_of(address.host.begin(), address.host.end(), is_host_character))
      return wrong("the host is no name or address");
    if (address.host.find_first_not_of("0123456789.") == std::string::npos) {
      in_addr ip{};
      if (::inet_pton(AF_INET, address.host.c_str(), &ip) != 1) return wrong("no IPv4 address has this form");
      address.loopback = (ntohl(ip.s_addr) >> 24) == 127;
    } else {
      address.loopback = address.host == "localhost";
    }
  }
  const auto [end, code] = std::from_chars(port.data(), port.data() + port.size(), address.port);
  if (port.empty() || port.front() == '-' || code != std::errc() || end != port.data() + port.size() ||
      address.port > 65535)
    return wrong("the port is not a number from 0 to 65535");
  return address;
}

Result<std::shared_ptr<grpc::ServerCredentials>> server_credentials(const Address& address,
                                                                    const TlsFiles& tls, bool insecure) {
  if (!tls.any()) {
    if (!address.loopback && !insecure) return needs_tls(address);
    return grpc::InsecureServerCredentials();
  }
  CANDELA_ASSIGN(const Credentials pem, load_credentials(tls));
  for (const std::string& warning : pem.warnings) log::warn(warning);
  grpc::SslServerCredentialsOptions options(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  options.pem_root_certs = pem.ca;
  options.pem_key_cert_pairs.push_back({pem.key, pem.cert});
  return grpc::SslServerCredentials(options);
}

Result<std::shared_ptr<grpc::ChannelCredentials>> channel_credentials(const Address& address,
                                                                      const TlsFiles& tls, bool insecure,
                                                                      std::optional<Role> role) {
  if (address.port == 0)
    return usage_error(fmt::format("{} has port 0, which nobody can call", address.text()));
  if (!tls.any()) {
    if (!address.loopback && !insecure) return needs_tls(address);
    return grpc::InsecureChannelCredentials();
  }
  CANDELA_ASSIGN(const Credentials pem, load_credentials(tls));
  if (role && !pem.holder.roles.allow(*role))
    return refused_error(fmt::format("role '{}' is missing: the certificate '{}' has {}", name(*role),
                                     pem.holder.name, pem.holder.roles.text()))
        .at(tls.cert, 0)
        .with_field("--tls-cert")
        .with_mend(needs_role(*role));
  for (const std::string& warning : pem.warnings) log::warn(warning);
  grpc::SslCredentialsOptions options;
  options.pem_root_certs = pem.ca;
  options.pem_private_key = pem.key;
  options.pem_cert_chain = pem.cert;
  return grpc::SslCredentials(options);
}

}  // namespace candela::wire
