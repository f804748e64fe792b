#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/pem.h>

#include "client/doctor/checks.h"
#include "client/values.h"
#include "common/base/files.h"
#include "common/wire/openssl_types.h"
#include "common/wire/wire.h"

namespace candela::client {
namespace {

using wire::Bio, wire::Certificate, wire::CertificateStore, wire::Verification, wire::date_of,
    wire::days_until;

constexpr std::uint64_t kMaxBytes = 1 << 20;
constexpr double kSoonDays = 30;

Certificate read_certificate(const std::string& file) {
  const auto text = read_file(file, kMaxBytes);
  if (!text) return nullptr;
  const Bio bio = wire::bio_of(*text);
  Certificate certificate(PEM_read_bio_X509(bio.get(), nullptr, nullptr, nullptr));
  ERR_clear_error();
  return certificate;
}

Diagnosis check_certificate(const std::string& name, const std::string& file) {
  const Certificate certificate = read_certificate(file);
  if (!certificate)
    return {name, Diagnosis::State::broken, fmt::format("{}: no certificate in PEM form", printable(file)),
            "give another file"};
  const ASN1_TIME* begin = X509_get0_notBefore(certificate.get());
  if (days_until(begin) > 0)
    return {name, Diagnosis::State::broken,
            fmt::format("{}: valid only from {}", printable(file), date_of(begin)),
            "set this machine's clock, or wait"};
  const ASN1_TIME* end = X509_get0_notAfter(certificate.get());
  return check_expiry(name, days_until(end),
                      fmt::format("{}: valid until {}", printable(file), date_of(end)));
}

// Nothing if our certificate is the authority's, or if one of them cannot be read.
std::optional<Diagnosis> check_signature(const ConnectionOptions& connection) {
  const Certificate ours = read_certificate(connection.tls_cert);
  const Certificate authority = read_certificate(connection.tls_ca);
  if (!ours || !authority) return std::nullopt;
  const CertificateStore store(X509_STORE_new());
  X509_STORE_add_cert(store.get(), authority.get());
  // Dates have checks of their own, and an authority may be one of several.
  X509_STORE_set_flags(store.get(), X509_V_FLAG_NO_CHECK_TIME | X509_V_FLAG_PARTIAL_CHAIN);
  const Verification context(X509_STORE_CTX_new());
  X509_STORE_CTX_init(context.get(), store.get(), ours.get(), nullptr);
  const bool signed_by = X509_verify_cert(context.get()) == 1;
  const std::string why = X509_verify_cert_error_string(X509_STORE_CTX_get_error(context.get()));
  ERR_clear_error();
  if (signed_by)
    return Diagnosis{"signature", Diagnosis::State::ok, "our certificate is the authority's", {}};
  return Diagnosis{"signature", Diagnosis::State::warning,
                   fmt::format("our certificate is not signed by {}: {}", printable(connection.tls_ca), why),
                   "use a certificate that the master's --tls-ca has signed, if it is the same authority"};
}

// The key's access and the certificate's roles. Nothing if other checks tell why the files cannot be used.
std::optional<Diagnosis> check_holder(const ConnectionOptions& connection) {
  const auto loaded = wire::load_credentials({connection.tls_cert, connection.tls_key, connection.tls_ca});
  if (!loaded && !connection.tls_key.empty() && loaded.error().file == connection.tls_key)
    return Diagnosis{"key", Diagnosis::State::broken,
                     fmt::format("{}: {}", printable(connection.tls_key), printable(loaded.error().message)),
                     printable(loaded.error().mend)};
  if (!loaded) return std::nullopt;
  const wire::Holder& holder = loaded->holder;
  if (holder.roles.empty())
    return Diagnosis{"roles", Diagnosis::State::broken,
                     fmt::format("the certificate '{}' has no role", printable(holder.name)),
                     wire::needs_role(wire::Role::submit)};
  return Diagnosis{"roles",
                   Diagnosis::State::ok,
                   fmt::format("'{}' has {}", printable(holder.name), holder.roles.text()),
                   {}};
}

}  // namespace

Diagnosis check_expiry(const std::string& name, double days, const std::string& text) {
  if (days < 0)
    return {name, Diagnosis::State::broken, text + ", which is past", "have a new certificate signed"};
  if (days < kSoonDays)
    return {name, Diagnosis::State::warning, fmt::format("{}, in {:.0f} days", text, days),
            "have a new certificate signed before"};
  return {name, Diagnosis::State::ok, text, {}};
}

std::vector<Diagnosis> check_certificates(const ConnectionOptions& connection) {
  if (connection.tls_cert.empty() && connection.tls_ca.empty())
    return {{"certificates", Diagnosis::State::skipped, "none are given: the connection has no TLS", {}}};
  std::vector<Diagnosis> checks;
  if (!connection.tls_cert.empty()) checks.push_back(check_certificate("certificate", connection.tls_cert));
  if (!connection.tls_ca.empty()) checks.push_back(check_certificate("authority", connection.tls_ca));
  if (const auto signature = check_signature(connection)) checks.push_back(*signature);
  if (const auto role = check_holder(connection)) checks.push_back(*role);
  return checks;
}

}  // namespace candela::client
