// Addresses and transport credentials. Beyond loopback there is mutual TLS or an explicit --insecure, nothing
// else.
#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <algorithm>
#include <charconv>
#include <memory>

#include "common/base/files.h"
#include "common/wire/wire.h"

namespace candela::wire {
namespace {

constexpr std::uint64_t kMaxPemBytes = 1 << 20;
constexpr std::size_t kMaxHostBytes = 253;  // of a DNS name

bool is_host_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '-' ||
         c == '_';
}

struct PemContents {
  std::string cert, key, ca;
};

using Bio = std::unique_ptr<BIO, decltype(&BIO_free)>;
using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;
using PrivateKey = std::unique_ptr<EVP_PKEY, decltype(&EVP_PKEY_free)>;

Bio bio_of(const std::string& pem) {
  return {BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())), &BIO_free};
}

// A password is never asked for: a service has nobody to ask.
int no_password(char*, int, int, void*) {
  return -1;
}

Result<std::string> read_pem(const std::string& file, std::string_view option) {
  auto text = candela::read_file(file, kMaxPemBytes);
  if (!text) return std::move(text).error().with_field(std::string(option));
  return text;
}

Result<Certificate> parse_certificate(const std::string& pem, const std::string& file,
                                      std::string_view option) {
  Certificate certificate(PEM_read_bio_X509(bio_of(pem).get(), nullptr, &no_password, nullptr), &X509_free);
  ERR_clear_error();
  if (!certificate)
    return input_error("no certificate in PEM form").at(file, 0).with_field(std::string(option));
  return certificate;
}

// gRPC finds bad files only when the first connection fails, without a word of which file: so they are read
// here first.
Result<PemContents> load(const TlsFiles& tls) {
  for (const auto& [file, option] :
       {std::pair{&tls.cert, "--tls-cert"}, {&tls.key, "--tls-key"}, {&tls.ca, "--tls-ca"}})
    if (file->empty())
      return usage_error("--tls-cert, --tls-key and --tls-ca go together, and this one is missing")
          .with_field(option);
  PemContents pem;
  CANDELA_ASSIGN(pem.cert, read_pem(tls.cert, "--tls-cert"));
  CANDELA_ASSIGN(pem.key, read_pem(tls.key, "--tls-key"));
  CANDELA_ASSIGN(pem.ca, read_pem(tls.ca, "--tls-ca"));
  CANDELA_ASSIGN(const Certificate certificate, parse_certificate(pem.cert, tls.cert, "--tls-cert"));
  CANDELA_TRY(parse_certificate(pem.ca, tls.ca, "--tls-ca"));
  const PrivateKey key(PEM_read_bio_PrivateKey(bio_of(pem.key).get(), nullptr, &no_password, nullptr),
                       &EVP_PKEY_free);
  ERR_clear_error();
  if (!key)
    return input_error("no unencrypted private key in PEM form").at(tls.key, 0).with_field("--tls-key");
  const bool matches = X509_check_private_key(certificate.get(), key.get()) == 1;
  ERR_clear_error();
  if (!matches)
    return input_error(fmt::format("the key does not belong to the certificate in '{}'", tls.cert))
        .at(tls.key, 0)
        .with_field("--tls-key");
  return pem;
}

Error needs_tls(const Address& address) {
  return usage_error(fmt::format("{} is not a loopback address and there is no TLS", address.text()))
      .with_mend("give --tls-cert, --tls-key and --tls-ca, or --insecure on a network you trust");
}

}  // namespace

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
  CANDELA_ASSIGN(const PemContents pem, load(tls));
  grpc::SslServerCredentialsOptions options(GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  options.pem_root_certs = pem.ca;
  options.pem_key_cert_pairs.push_back({pem.key, pem.cert});
  return grpc::SslServerCredentials(options);
}

Result<std::shared_ptr<grpc::ChannelCredentials>> channel_credentials(const Address& address,
                                                                      const TlsFiles& tls, bool insecure) {
  if (address.port == 0)
    return usage_error(fmt::format("{} has port 0, which nobody can call", address.text()));
  if (!tls.any()) {
    if (!address.loopback && !insecure) return needs_tls(address);
    return grpc::InsecureChannelCredentials();
  }
  CANDELA_ASSIGN(const PemContents pem, load(tls));
  grpc::SslCredentialsOptions options;
  options.pem_root_certs = pem.ca;
  options.pem_private_key = pem.key;
  options.pem_cert_chain = pem.cert;
  return grpc::SslCredentials(options);
}

}  // namespace candela::wire
