#include "common/wire/authority.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/ec.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "common/base/files.h"
#include "common/wire/openssl_types.h"

namespace candela::wire {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxAuthorityBytes = 1 << 20;
constexpr const char* kAuthorityName = "ca";

bool is_name_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' ||
         c == '.' || c == '@';
}

bool is_address(const std::string& host) {
  std::array<unsigned char, sizeof(in6_addr)> bytes{};
  return ::inet_pton(AF_INET, host.c_str(), bytes.data()) == 1 ||
         ::inet_pton(AF_INET6, host.c_str(), bytes.data()) == 1;
}

Error openssl_error(const char* what) {
  std::array<char, 256> text{};
  ERR_error_string_n(ERR_get_error(), text.data(), text.size());
  ERR_clear_error();
  return failed_error(fmt::format("OpenSSL {}: {}", what, text.data()));
}

Error already_there(const fs::path& file) {
  return refused_error("the file is there already, and is not overwritten")
      .at(file.string(), 0)
      .with_mend("give another --folder or name, or move the file away");
}

Result<void> check_absent(std::initializer_list<fs::path> files) {
  for (const fs::path& file : files)
    if (std::error_code code; fs::exists(fs::symlink_status(file, code))) return already_there(file);
  return {};
}

Result<void> write_new(const fs::path& file, const std::string& text) {
  const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd < 0 && errno == EEXIST) return already_there(file);
  const bool written = fd >= 0 &&
                       ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
                       ::fsync(fd) == 0;
  const int error = errno;
  if (fd >= 0) ::close(fd);
  if (written) return {};
  if (fd >= 0) ::unlink(file.c_str());
  return input_error(fmt::format("cannot write: {}", std::strerror(error))).at(file.string(), 0);
}

Result<PrivateKey> make_key() {
  PrivateKey key(EVP_EC_gen("P-256"));
  if (!key) return openssl_error("made no key");
  return key;
}

template <class Write>
std::string pem_of(const Write& write) {
  const Bio bio(BIO_new(BIO_s_mem()));
  return write(bio.get()) == 1 ? text_of(*bio) : std::string();
}
std::string pem_of(X509& certificate) {
  return pem_of([&](BIO* bio) { return PEM_write_bio_X509(bio, &certificate); });
}
std::string pem_of(EVP_PKEY& key) {
  return pem_of(
      [&](BIO* bio) { return PEM_write_bio_PrivateKey(bio, &key, nullptr, nullptr, 0, nullptr, nullptr); });
}

bool add_extension(X509& certificate, X509& issuer, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx_nodb(&context);
  X509V3_set_ctx(&context, &issuer, &certificate, nullptr, nullptr, 0);
  X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str());
  const bool added = extension != nullptr && X509_add_ext(&certificate, extension, -1) == 1;
  X509_EXTENSION_free(extension);
  return added;
}

// Without extensions and signature.
Result<Certificate> make_certificate(const std::string& name, EVP_PKEY& key, const Validity& validity) {
  Certificate certificate(X509_new());
  std::array<unsigned char, 16> serial{};
  if (!certificate || RAND_bytes(serial.data(), static_cast<int>(serial.size())) != 1)
    return openssl_error("made no certificate");
  serial[0] = static_cast<unsigned char>((serial[0] & 0x7fU) | 0x40U);  // positive, of one length
  BIGNUM* number = BN_bin2bn(serial.data(), static_cast<int>(serial.size()), nullptr);
  BN_to_ASN1_INTEGER(number, X509_get_serialNumber(certificate.get()));
  BN_free(number);
  X509_set_version(certificate.get(), X509_VERSION_3);
  X509_gmtime_adj(X509_getm_notBefore(certificate.get()), validity.begin);
  X509_gmtime_adj(X509_getm_notAfter(certificate.get()), validity.end);
  X509_set_pubkey(certificate.get(), &key);
  if (X509_NAME_add_entry_by_txt(X509_get_subject_name(certificate.get()), "CN", MBSTRING_UTF8,
                                 reinterpret_cast<const unsigned char*>(name.data()),
                                 static_cast<int>(name.size()), -1, 0) != 1)
    return openssl_error("refused the name of a certificate");
  return certificate;
}

}  // namespace

struct Authority::State {
  fs::path folder;
  Certificate certificate;
  PrivateKey key;
};

Authority::Authority(std::unique_ptr<State> state) : state_(std::move(state)) {}
Authority::~Authority() = default;
Authority::Authority(Authority&& other) noexcept = default;
Authority& Authority::operator=(Authority&& other) noexcept = default;

Result<void> check_certificate_name(const std::string& name) {
  if (!name.empty() && name.size() <= 64 && std::all_of(name.begin(), name.end(), is_name_character) &&
      name.front() != '.' && name.front() != '-' && name != kAuthorityName)
    return {};
  return usage_error(fmt::format("'{}' is no name for a certificate", name.substr(0, 100)))
      .with_mend("use up to 64 letters, digits, '-', '_', '.' and '@', and not 'ca'");
}

Result<void> check_certificate_host(const std::string& host) {
  const auto fits = [](char c) { return is_name_character(c) && c != '@' && c != '_'; };
  if (is_address(host) || (!host.empty() && host.size() <= 253 && host.front() != '-' &&
                           std::all_of(host.begin(), host.end(), fits)))
    return {};
  return usage_error(fmt::format("'{}' is no name or address of a machine", host.substr(0, 100)))
      .with_mend("give the names and addresses by which workers and people reach the master, without a port");
}

Result<Authority> Authority::make(const fs::path& folder, const std::string& name, const Validity& validity) {
  CANDELA_TRY(check_absent({folder / "ca.key", folder / "ca.pem"}));
  auto state = std::make_unique<State>();
  state->folder = folder;
  CANDELA_ASSIGN(state->key, make_key());
  CANDELA_ASSIGN(state->certificate, make_certificate(name, *state->key, validity));
  X509& ours = *state->certificate;
  X509_set_issuer_name(&ours, X509_get_subject_name(&ours));
  if (!add_extension(ours, ours, NID_basic_constraints, "critical,CA:TRUE,pathlen:0") ||
      !add_extension(ours, ours, NID_key_usage, "critical,keyCertSign,cRLSign") ||
      !add_extension(ours, ours, NID_subject_key_identifier, "hash") ||
      X509_sign(&ours, state->key.get(), EVP_sha256()) == 0)
    return openssl_error("did not sign the authority's certificate");
  CANDELA_TRY(make_directories(folder));
  CANDELA_TRY(write_new(folder / "ca.key", pem_of(*state->key)));
  CANDELA_TRY(write_new(folder / "ca.pem", pem_of(ours)));
  return Authority(std::move(state));
}

Result<Authority> Authority::open(const fs::path& folder) {
  auto state = std::make_unique<State>();
  state->folder = folder;
  CANDELA_ASSIGN(const std::string certificate, read_file(folder / "ca.pem", kMaxAuthorityBytes));
  CANDELA_ASSIGN(const std::string key, read_file(folder / "ca.key", kMaxAuthorityBytes));
  const auto refuse_password = [](char*, int, int, void*) { return -1; };
  state->certificate.reset(PEM_read_bio_X509(bio_of(certificate).get(), nullptr, refuse_password, nullptr));
  state->key.reset(PEM_read_bio_PrivateKey(bio_of(key).get(), nullptr, refuse_password, nullptr));
  const bool fits = state->certificate && state->key &&
                    X509_check_private_key(state->certificate.get(), state->key.get()) == 1;
  ERR_clear_error();
  if (!fits)
    return input_error("ca.pem and ca.key of this folder are not an authority's certificate and its key")
        .at(folder.string(), 0);
  return Authority(std::move(state));
}

Result<std::vector<fs::path>> Authority::sign(const CertificateRequest& request) const {
  CANDELA_TRY(check_certificate_name(request.name));
  for (const std::string& host : request.hosts) CANDELA_TRY(check_certificate_host(host));
  const fs::path pem = state_->folder / (request.name + ".pem"),
                 key_file = state_->folder / (request.name + ".key");
  CANDELA_TRY(check_absent({pem, key_file}));
  CANDELA_ASSIGN(const PrivateKey key, make_key());
  CANDELA_ASSIGN(const Certificate certificate, make_certificate(request.name, *key, request.validity));
  X509 &ours = *certificate, &issuer = *state_->certificate;
  X509_set_issuer_name(&ours, X509_get_subject_name(&issuer));
  std::string names;
  for (const std::string& host : request.hosts)
    names += fmt::format("{}{}:{}", names.empty() ? "" : ",", is_address(host) ? "IP" : "DNS", host);
  for (const Role role : {Role::worker, Role::submit, Role::operate, Role::read})
    if (request.roles.has(role)) names += fmt::format("{}URI:{}", names.empty() ? "" : ",", role_uri(role));
  if (!add_extension(ours, issuer, NID_basic_constraints, "critical,CA:FALSE") ||
      !add_extension(ours, issuer, NID_key_usage, "critical,digitalSignature") ||
      !add_extension(ours, issuer, NID_ext_key_usage, request.hosts.empty() ? "clientAuth" : "serverAuth") ||
      !add_extension(ours, issuer, NID_authority_key_identifier, "keyid") ||
      (!names.empty() && !add_extension(ours, issuer, NID_subject_alt_name, names)) ||
      X509_sign(&ours, state_->key.get(), EVP_sha256()) == 0)
    return openssl_error("did not sign a certificate");
  CANDELA_TRY(write_new(key_file, pem_of(*key)));
  CANDELA_TRY(write_new(pem, pem_of(ours)));
  return std::vector<fs::path>{pem, key_file};
}

}  // namespace candela::wire
