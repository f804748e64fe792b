// Statuses, addresses and credentials.
#include <gtest/gtest.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <filesystem>
#include <fstream>

#include "common/wire/wire.h"
#include "tests/temporary_folder.h"

namespace candela {
namespace {

// Claim: an error survives the trip through a status with all its parts, whatever its kind.
TEST(WireStatus, ErrorsRoundTrip) {
  for (const ErrorKind kind : {ErrorKind::usage, ErrorKind::input, ErrorKind::failed, ErrorKind::unreachable,
                               ErrorKind::refused, ErrorKind::resource, ErrorKind::internal}) {
    const Error error{kind, "the thing is = broken", "scene.xml", 12, "unit.half", "mend it"};
    const grpc::Status status = wire::to_status(error);
    EXPECT_FALSE(status.ok());
    const Error back = wire::from_status(status);
    EXPECT_EQ(back.kind, error.kind);
    EXPECT_EQ(back.to_string(), error.to_string());
    EXPECT_EQ(back.field, error.field);
    EXPECT_EQ(back.line, error.line);
    EXPECT_EQ(status.error_message(), error.to_string());
  }
}

// Claim: codes are those the contract names.
TEST(WireStatus, Codes) {
  EXPECT_EQ(wire::to_status(input_error("x")).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(wire::to_status(usage_error("x")).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(wire::to_status(unreachable_error("x")).error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(wire::to_status(refused_error("x")).error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_EQ(wire::to_status(resource_error("x")).error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(wire::to_status(failed_error("x")).error_code(), grpc::StatusCode::ABORTED);
  EXPECT_EQ(wire::to_status(internal_error("x")).error_code(), grpc::StatusCode::INTERNAL);
  using grpc::Status;
  EXPECT_EQ(wire::from_status(Status(grpc::StatusCode::DEADLINE_EXCEEDED, "")).kind, ErrorKind::unreachable);
  EXPECT_EQ(wire::from_status(Status(grpc::StatusCode::UNAVAILABLE, "")).kind, ErrorKind::unreachable);
  EXPECT_EQ(wire::from_status(Status(grpc::StatusCode::NOT_FOUND, "no job")).kind, ErrorKind::input);
  EXPECT_EQ(wire::from_status(Status(grpc::StatusCode::NOT_FOUND, "no job")).message, "no job");
  EXPECT_FALSE(wire::from_status(Status(grpc::StatusCode::UNKNOWN, "")).message.empty());
}

// Claim: a status is one line and fits HTTP/2's header limits, however long and odd the error is.
TEST(WireStatus, LongAndOddErrorsAreCut) {
  std::string odd(100000, 'x');
  odd[10] = '\n';
  odd[11] = '\0';
  const grpc::Status status = wire::to_status(input_error(odd).with_field(odd).with_mend(odd));
  EXPECT_EQ(status.error_message().find('\n'), std::string::npos);
  EXPECT_LT(status.error_message().size() + status.error_details().size(), 6000U);
  EXPECT_EQ(wire::from_status(status).kind, ErrorKind::input);
}

// Claim: the retry delay is read from where it was written, has a default, and a bound; junk details do no
// harm.
TEST(WireStatus, RetryDelay) {
  EXPECT_EQ(wire::retry_ms(wire::to_status_with_retry(resource_error("full"), 750), 1), 750U);
  EXPECT_EQ(wire::retry_ms(wire::to_status_with_retry(resource_error("full"), 4000000000U), 1), 60000U);
  EXPECT_EQ(wire::retry_ms(wire::to_status(resource_error("full")), 33), 33U);
  EXPECT_EQ(
      wire::retry_ms(grpc::Status(grpc::StatusCode::RESOURCE_EXHAUSTED, "m", "retry_ms=5\nretry_ms"), 33),
      33U);
  EXPECT_EQ(wire::from_status(wire::to_status_with_retry(resource_error("full"), 750)).message, "full");
}

// Claim: the address forms the documents name are understood, and loopback is told from everything else (TLS
// hangs on it).
TEST(WireAddress, Understood) {
  struct Case {
    const char *text, *host;
    int port;
    bool loopback;
  };
  for (const Case& c :
       {Case{"127.0.0.1:7070", "127.0.0.1", 7070, true}, Case{"127.9.8.7:1", "127.9.8.7", 1, true},
        Case{"[::1]:7070", "::1", 7070, true}, Case{"localhost:0", "localhost", 0, true},
        Case{"0.0.0.0:7070", "0.0.0.0", 7070, false}, Case{"[::]:7070", "::", 7070, false},
        Case{"[::ffff:127.0.0.1]:9", "::ffff:127.0.0.1", 9, true},
        Case{"farm-1.example.org:65535", "farm-1.example.org", 65535, false},
        Case{"127.0.0.1.evil.org:80", "127.0.0.1.evil.org", 80, false}}) {
    const auto address = wire::parse_address(c.text, "--listen");
    ASSERT_TRUE(address.ok()) << c.text << ": " << address.error().to_string();
    EXPECT_EQ(address->host, c.host);
    EXPECT_EQ(address->port, c.port);
    EXPECT_EQ(address->loopback, c.loopback) << c.text;
    EXPECT_EQ(address->text(), c.text);
  }
}

// Claim: everything else is a usage error that names the option.
TEST(WireAddress, Refused) {
  for (const char* text :
       {"",           ":",         "host",         "host:",    ":7070",
        "host:70000", "host:-1",   "host:7x",      "::1:7070", "[::1]",
        "[::1]7070",  "[::1:7070", "[host]:1",     "ho st:1",  "-host:1",
        "host/:1",    "1.2.3:4",   "999.1.1.1:80", "host: 80", "host:99999999999999999999"}) {
    const auto address = wire::parse_address(text, "--master");
    ASSERT_FALSE(address.ok()) << text;
    EXPECT_EQ(address.error().field, "--master");
    EXPECT_EQ(address.error().exit_code(), 2);
  }
}

// Claim: beyond loopback there is TLS or an explicit word.
TEST(WireCredentials, PlainTextOnlyOnLoopbackOrOnPurpose) {
  const auto near = *wire::parse_address("127.0.0.1:7070", "--listen");
  const auto far = *wire::parse_address("0.0.0.0:7070", "--listen");
  EXPECT_TRUE(wire::server_credentials(near, {}, false).ok());
  EXPECT_TRUE(wire::channel_credentials(near, {}, false).ok());
  EXPECT_EQ(wire::server_credentials(far, {}, false).error().kind, ErrorKind::usage);
  EXPECT_EQ(wire::channel_credentials(far, {}, false).error().kind, ErrorKind::usage);
  EXPECT_TRUE(wire::server_credentials(far, {}, true).ok());
  EXPECT_TRUE(wire::channel_credentials(far, {}, true).ok());
  EXPECT_FALSE(wire::channel_credentials(*wire::parse_address("localhost:0", "--master"), {}, false).ok());
}

class WireTls : public testing::Test {
 protected:
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }
  // A self-signed certificate and its key.
  wire::TlsFiles make_pair(const std::string& name) const {
    EVP_PKEY* key = EVP_EC_gen("P-256");
    X509* certificate = X509_new();
    X509_set_version(certificate, 2);
    ASN1_INTEGER_set(X509_get_serialNumber(certificate), 1);
    X509_gmtime_adj(X509_getm_notBefore(certificate), 0);
    X509_gmtime_adj(X509_getm_notAfter(certificate), 3600);
    X509_set_pubkey(certificate, key);
    X509_NAME* subject = X509_get_subject_name(certificate);
    X509_NAME_add_entry_by_txt(subject, "CN", MBSTRING_ASC, reinterpret_cast<const unsigned char*>("test"),
                               -1, -1, 0);
    X509_set_issuer_name(certificate, subject);
    X509_sign(certificate, key, EVP_sha256());
    wire::TlsFiles files;
    files.cert = (folder_ / (name + ".crt")).string();
    files.key = (folder_ / (name + ".key")).string();
    files.ca = files.cert;
    std::FILE* out = std::fopen(files.cert.c_str(), "w");
    PEM_write_X509(out, certificate);
    std::fclose(out);
    out = std::fopen(files.key.c_str(), "w");
    PEM_write_PrivateKey(out, key, nullptr, nullptr, 0, nullptr, nullptr);
    std::fclose(out);
    std::filesystem::permissions(files.key,
                                 std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    X509_free(certificate);
    EVP_PKEY_free(key);
    return files;
  }

  test::TemporaryFolder temporary_;
  std::filesystem::path folder_ = temporary_.path();
};

// Claim: good files make credentials; each missing, unreadable, malformed or mismatched one is an error
// naming its option.
TEST_F(WireTls, FilesAreCheckedByOption) {
  const auto far = *wire::parse_address("farm.example.org:7070", "--listen");
  const wire::TlsFiles good = make_pair("a"), other = make_pair("b");
  EXPECT_TRUE(wire::server_credentials(far, good, false).ok());
  EXPECT_TRUE(wire::channel_credentials(far, good, false).ok());

  const auto field = [&](wire::TlsFiles files) {
    const auto server = wire::server_credentials(far, files, true);  // --insecure does not excuse bad files
    const auto client = wire::channel_credentials(far, files, true);
    if (server.ok() || client.ok()) return std::string("accepted");
    EXPECT_EQ(server.error().to_string(), client.error().to_string());
    EXPECT_EQ(server.error().exit_code(), 2) << server.error().to_string();
    return server.error().field;
  };
  EXPECT_EQ(field({"", good.key, good.ca}), "--tls-cert");
  EXPECT_EQ(field({good.cert, "", good.ca}), "--tls-key");
  EXPECT_EQ(field({good.cert, good.key, ""}), "--tls-ca");
  EXPECT_EQ(field({(folder_ / "none").string(), good.key, good.ca}), "--tls-cert");
  EXPECT_EQ(field({good.cert, folder_.string(), good.ca}), "--tls-key");
  EXPECT_EQ(field({write("junk", "hello"), good.key, good.ca}), "--tls-cert");
  EXPECT_EQ(field({good.cert, write("junk", "hello"), good.ca}), "--tls-key");
  EXPECT_EQ(field({good.cert, good.key, write("empty", "")}), "--tls-ca");
  EXPECT_EQ(field({good.cert, other.key, good.ca}), "--tls-key");
}

}  // namespace
}  // namespace candela
