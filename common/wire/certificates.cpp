#include "common/wire/certificates.h"

#include <fmt/format.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <sys/stat.h>

#include <cmath>
#include <cstring>
#include <utility>

#include "common/base/files.h"
#include "common/wire/openssl_types.h"

namespace candela::wire {
namespace {

constexpr std::uint64_t kMaxPemBytes = 1 << 20;
constexpr double kSoonDays = 30;

// A password is never asked for: a service has nobody to ask.
int no_password(char*, int, int, void*) {
  return -1;
}

Result<std::string> read_pem(const std::string& file, std::string_view option) {
  auto text = candela::read_file(file, kMaxPemBytes);
  if (!text) return std::move(text).error().with_field(std::string(option));
  return text;
}

// All certificates of a file, at least one.
Result<std::vector<Certificate>> parse_certificates(const std::string& pem, const std::string& file,
                                                    std::string_view option) {
  std::vector<Certificate> certificates;
  const Bio bio = bio_of(pem);
  while (X509* one = PEM_read_bio_X509(bio.get(), nullptr, &no_password, nullptr))
    certificates.emplace_back(one);
  ERR_clear_error();
  if (certificates.empty())
    return input_error("no certificate in PEM form").at(file, 0).with_field(std::string(option));
  return certificates;
}

Result<void> check_dates(const X509& certificate, const std::string& file, const char* option,
                         std::vector<std::string>& warnings) {
  const ASN1_TIME* begin = X509_get0_notBefore(&certificate);
  if (days_until(begin) > 0)
    return input_error(fmt::format("the certificate is valid only from {}", date_of(begin)))
        .at(file, 0)
        .with_field(option)
        .with_mend("set this machine's clock, or have a new certificate signed");
  const ASN1_TIME* end = X509_get0_notAfter(&certificate);
  const double days = days_until(end);
  if (days < 0)
    return input_error(fmt::format("the certificate expired on {}", date_of(end)))
        .at(file, 0)
        .with_field(option)
        .with_mend("have a new certificate signed by the farm's authority");
  if (days < kSoonDays)
    warnings.push_back(fmt::format("{}: the certificate expires in {:.0f} days, on {}: have a new one signed",
                                   file, std::floor(days), date_of(end)));
  return {};
}

Result<void> check_key_is_private(const std::string& file) {
  struct stat facts {};
  if (::stat(file.c_str(), &facts) != 0 || (facts.st_mode & (S_IROTH | S_IWOTH)) == 0) return {};
  return input_error(fmt::format("every user of this machine can {} the private key",
                                 (facts.st_mode & S_IROTH) != 0 ? "read" : "write"))
      .at(file, 0)
      .with_field("--tls-key")
      .with_mend(fmt::format("chmod 600 {}; if somebody may have read it, have a new one signed", file));
}

// Why no authority of the file signed the first certificate; empty: one did.
std::string foreign(const std::vector<Certificate>& chain, const std::vector<Certificate>& authorities) {
  const CertificateStore store(X509_STORE_new());
  for (const Certificate& authority : authorities) X509_STORE_add_cert(store.get(), authority.get());
  // Dates have a check of their own.
  X509_STORE_set_flags(store.get(), X509_V_FLAG_NO_CHECK_TIME | X509_V_FLAG_PARTIAL_CHAIN);
  STACK_OF(X509)* between = sk_X509_new_null();
  for (std::size_t i = 1; i < chain.size(); ++i) sk_X509_push(between, chain[i].get());
  const Verification context(X509_STORE_CTX_new());
  X509_STORE_CTX_init(context.get(), store.get(), chain.front().get(), between);
  const bool is_ours = X509_verify_cert(context.get()) == 1;
  std::string why = X509_verify_cert_error_string(X509_STORE_CTX_get_error(context.get()));
  sk_X509_free(between);
  ERR_clear_error();
  return is_ours ? std::string() : why;
}

Holder holder_of(const X509& certificate) {
  Holder holder;
  char text[256] = {};
  if (X509_NAME_get_text_by_NID(X509_get_subject_name(&certificate), NID_commonName, text, sizeof text) > 0)
    holder.name = text;
  auto* names =
      static_cast<GENERAL_NAMES*>(X509_get_ext_d2i(&certificate, NID_subject_alt_name, nullptr, nullptr));
  for (int i = 0; i < sk_GENERAL_NAME_num(names); ++i) {
    const GENERAL_NAME* one = sk_GENERAL_NAME_value(names, i);
    if (one->type != GEN_URI) continue;
    const ASN1_IA5STRING* uri = one->d.uniformResourceIdentifier;
    add_role_of_uri(holder.roles, {reinterpret_cast<const char*>(ASN1_STRING_get0_data(uri)),
                                   static_cast<std::size_t>(ASN1_STRING_length(uri))});
  }
  GENERAL_NAMES_free(names);
  ERR_clear_error();
  return holder;
}

}  // namespace

Result<Credentials> load_credentials(const TlsFiles& tls) {
  for (const auto& [file, option] :
       {std::pair{&tls.cert, "--tls-cert"}, {&tls.key, "--tls-key"}, {&tls.ca, "--tls-ca"}})
    if (file->empty())
      return usage_error("--tls-cert, --tls-key and --tls-ca go together, and this one is missing")
          .with_field(option);
  Credentials out;
  CANDELA_ASSIGN(out.cert, read_pem(tls.cert, "--tls-cert"));
  CANDELA_ASSIGN(out.key, read_pem(tls.key, "--tls-key"));
  CANDELA_ASSIGN(out.ca, read_pem(tls.ca, "--tls-ca"));
  CANDELA_ASSIGN(const std::vector<Certificate> chain, parse_certificates(out.cert, tls.cert, "--tls-cert"));
  CANDELA_ASSIGN(const std::vector<Certificate> authorities, parse_certificates(out.ca, tls.ca, "--tls-ca"));
  const PrivateKey key(PEM_read_bio_PrivateKey(bio_of(out.key).get(), nullptr, &no_password, nullptr));
  ERR_clear_error();
  if (!key)
    return input_error("no unencrypted private key in PEM form").at(tls.key, 0).with_field("--tls-key");
  const bool matches = X509_check_private_key(chain.front().get(), key.get()) == 1;
  ERR_clear_error();
  if (!matches)
    return input_error(fmt::format("the key does not belong to the certificate in '{}'", tls.cert))
        .at(tls.key, 0)
        .with_field("--tls-key");
  CANDELA_TRY(check_key_is_private(tls.key));
  CANDELA_TRY(check_dates(*chain.front(), tls.cert, "--tls-cert", out.warnings));
  // If there are several authorities, an old one may stay for a while.
  if (authorities.size() == 1)
    CANDELA_TRY(check_dates(*authorities.front(), tls.ca, "--tls-ca", out.warnings));
  if (const std::string why = foreign(chain, authorities); !why.empty())
    out.warnings.push_back(
        fmt::format("{}: the certificate is not signed by the authority in '{}' ({}): unless the other side "
                    "has another authority, use a certificate of this one",
                    tls.cert, tls.ca, why));
  out.holder = holder_of(*chain.front());
  return out;
}

}  // namespace candela::wire
