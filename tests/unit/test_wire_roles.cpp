// Roles, certificates and tokens: what their files say, and what is told of bad ones.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "common/base/log.h"
#include "common/wire/authority.h"
#include "common/wire/certificates.h"
#include "common/wire/listener.h"
#include "common/wire/token.h"
#include "common/wire/wire.h"
#include "tests/temporary_folder.h"

namespace candela::wire {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t kDay = 86400;

// Claim: each role has itself; `operate` has `submit` and `read`, `submit` has `read`, and `worker` and
// `read` have no other.
TEST(WireRoles, IncludeWhatTheyNeed) {
  const Role all[] = {Role::worker, Role::submit, Role::operate, Role::read};
  const auto allowed = [&](Roles roles) {
    std::string text;
    for (const Role role : all)
      if (roles.allow(role)) text += std::string(text.empty() ? "" : " ") + std::string(name(role));
    return text;
  };
  EXPECT_EQ(allowed({}), "");
  EXPECT_EQ(allowed({Role::worker}), "worker");
  EXPECT_EQ(allowed({Role::read}), "read");
  EXPECT_EQ(allowed({Role::submit}), "submit read");
  EXPECT_EQ(allowed({Role::operate}), "submit operate read");
  EXPECT_EQ(allowed({Role::worker, Role::read}), "worker read");
}

// Claim: URIs that only begin like a role's, or name none, give no role.
TEST(WireRoles, AreReadFromUris) {
  Roles roles;
  for (const char* other : {"candela:role/", "candela:role/Operate", "candela:role/operate ", "role/operate",
                            "spiffe://candela:role/operate", "candela:role/operators", ""})
    add_role_of_uri(roles, other);
  EXPECT_TRUE(roles.empty()) << roles.text();
  add_role_of_uri(roles, "candela:role/submit");
  EXPECT_EQ(roles, Roles({Role::submit}));
}

class WireCertificates : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(log::initialise("test", "off", "text").ok()); }
  TlsFiles files(const std::string& name, const std::string& authority = "ours") const {
    return {(folder_ / "ours" / (name + ".pem")).string(), (folder_ / "ours" / (name + ".key")).string(),
            (folder_ / authority / "ca.pem").string()};
  }
  Authority authority(const std::string& name, const Validity& validity = {-300, 3650 * kDay}) const {
    auto made = Authority::make(folder_ / name, name, validity);
    EXPECT_TRUE(made.ok()) << made.error().to_string();
    return std::move(*made);
  }
  static void sign(const Authority& authority, const std::string& name, Roles roles,
                   const Validity& validity = {-300, 400 * kDay}) {
    const auto made = authority.sign({name, {}, roles, validity});
    ASSERT_TRUE(made.ok()) << made.error().to_string();
  }

  test::TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
};

// Claim: a certificate of the authority has the name and the roles that it was signed with, and its files
// are their user's alone.
TEST_F(WireCertificates, SayNameAndRoles) {
  const Authority ours = authority("ours");
  sign(ours, "alice", {Role::submit, Role::worker});
  sign(ours, "nobody", {});
  const auto alice = load_credentials(files("alice"));
  ASSERT_TRUE(alice.ok()) << alice.error().to_string();
  EXPECT_EQ(alice->holder.name, "alice");
  EXPECT_EQ(alice->holder.roles, Roles({Role::submit, Role::worker}));
  EXPECT_TRUE(alice->warnings.empty()) << alice->warnings.front();
  EXPECT_TRUE(load_credentials(files("nobody"))->holder.roles.empty());
  for (const auto& entry : fs::directory_iterator(folder_ / "ours"))
    EXPECT_EQ(entry.status().permissions(), fs::perms::owner_read | fs::perms::owner_write) << entry.path();
}

// Claim: no file is overwritten, neither an authority's nor a certificate's.
TEST_F(WireCertificates, OverwriteNothing) {
  const Authority ours = authority("ours");
  sign(ours, "alice", {Role::submit});
  const auto text_of = [&](const char* name) {
    std::ifstream in(folder_ / "ours" / name);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  const std::string key = text_of("alice.key"), ca = text_of("ca.key");
  const auto again = ours.sign({"alice", {}, {Role::operate}});
  ASSERT_FALSE(again.ok());
  EXPECT_NE(again.error().to_string().find("alice.pem"), std::string::npos) << again.error().to_string();
  EXPECT_FALSE(Authority::make(folder_ / "ours", "other").ok());
  ASSERT_TRUE(fs::remove(folder_ / "ours" / "ca.pem"));
  EXPECT_FALSE(Authority::make(folder_ / "ours", "other").ok()) << "one of the two files is there";
  EXPECT_FALSE(fs::exists(folder_ / "ours" / "ca.pem")) << "half an authority was made";
  EXPECT_EQ(text_of("alice.key"), key);
  EXPECT_EQ(text_of("ca.key"), ca);
}

// Claim: an expired certificate, one of the future, an expired authority and a key that everybody can read
// are errors that name the file and the mend; a foreign certificate and one that expires soon are warnings
// that do. A key that the group can read is good: so a service is given one.
TEST_F(WireCertificates, BadOnesAreToldWithFileAndMend) {
  const Authority ours = authority("ours"), theirs = authority("theirs");
  sign(ours, "late", {Role::submit}, {-3 * kDay, -kDay});
  sign(ours, "early", {Role::submit}, {kDay, 2 * kDay});
  sign(ours, "open", {Role::submit});
  sign(ours, "soon", {Role::submit}, {-300, 5 * kDay + 3600});
  authority("old", {-3 * kDay, -kDay});
  const auto expect_error = [](const TlsFiles& tls, const std::string& file, const std::string& what) {
    const auto loaded = load_credentials(tls);
    ASSERT_FALSE(loaded.ok()) << what;
    EXPECT_EQ(loaded.error().file, file);
    EXPECT_NE(loaded.error().message.find(what), std::string::npos) << loaded.error().message;
    EXPECT_FALSE(loaded.error().mend.empty()) << loaded.error().message;
    EXPECT_EQ(loaded.error().exit_code(), 2);
  };
  expect_error(files("late"), files("late").cert, "expired on");
  expect_error(files("early"), files("early").cert, "valid only from");
  ASSERT_EQ(::chmod(files("open").key.c_str(), 0644), 0);
  expect_error(files("open"), files("open").key, "every user of this machine can read");
  ASSERT_EQ(::chmod(files("open").key.c_str(), 0640), 0);
  EXPECT_TRUE(load_credentials(files("open")).ok());
  expect_error(files("open", "old"), files("open", "old").ca, "expired on");

  const auto expect_warning = [](const TlsFiles& tls, const std::string& what) {
    const auto loaded = load_credentials(tls);
    ASSERT_TRUE(loaded.ok()) << loaded.error().to_string();
    ASSERT_EQ(loaded->warnings.size(), 1U);
    EXPECT_TRUE(loaded->warnings[0].starts_with(tls.cert + ": ")) << loaded->warnings[0];
    EXPECT_NE(loaded->warnings[0].find(what), std::string::npos) << loaded->warnings[0];
  };
  expect_warning(files("soon"), "expires in 5 days");
  expect_warning(files("open", "theirs"), "not signed by the authority");
  // By whoever has the file: the master as well as its callers, before they dial or listen.
  const Address near = *parse_address("127.0.0.1:7070", "--listen");
  EXPECT_EQ(server_credentials(near, files("late"), false).error().file, files("late").cert);
  EXPECT_EQ(channel_credentials(near, files("late"), false).error().file, files("late").cert);
}

// Claim: a worker whose certificate lacks its role is told before it dials, with the file and the role.
TEST_F(WireCertificates, LackOfARoleIsToldBeforeTheFirstCall) {
  const Authority ours = authority("ours");
  sign(ours, "alice", {Role::operate});
  sign(ours, "w", {Role::worker});
  const Address near = *parse_address("127.0.0.1:7070", "--master");
  const auto refused = channel_credentials(near, files("alice"), false, Role::worker);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().file, files("alice").cert);
  EXPECT_NE(refused.error().message.find("role 'worker' is missing"), std::string::npos);
  EXPECT_TRUE(channel_credentials(near, files("w"), false, Role::worker).ok());
}

class WireToken : public testing::Test {
 protected:
  fs::path write(const std::string& text, unsigned mode = 0600) const {
    const fs::path file = folder_.path() / "written";
    std::ofstream(file) << text;
    EXPECT_EQ(::chmod(file.c_str(), mode), 0);
    return file;
  }
  test::TemporaryFolder folder_;
};

// Claim: a token is made once, for its user alone, and differs from another's.
TEST_F(WireToken, IsMadeOnce) {
  const fs::path file = folder_.path() / "token";
  const auto made = make_token_file(file);
  ASSERT_TRUE(made.ok()) << made.error().to_string();
  EXPECT_EQ(fs::status(file).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_EQ(*make_token_file(file), *made);
  EXPECT_EQ(*read_token_file(file), *made);
  EXPECT_NE(*make_token_file(folder_.path() / "other"), *made);
  EXPECT_TRUE(same_token(*made, std::string(*made)));
  EXPECT_FALSE(same_token(*made, made->substr(1)));
  EXPECT_FALSE(same_token(*made, ""));
}

// Claim: a token that every user can read, or that is short or no word, is an error that names its file.
TEST_F(WireToken, BadFilesAreErrors) {
  const std::string good(16, 'x');
  EXPECT_EQ(*read_token_file(write(" " + good + "\n")), good);
  EXPECT_TRUE(read_token_file(write(good, 0640)).ok());
  for (const fs::path& file : {write(good, 0644), folder_.path() / "none"}) {
    const auto read = read_token_file(file);
    ASSERT_FALSE(read.ok());
    EXPECT_EQ(read.error().file, file.string());
  }
  for (const std::string& bad :
       {good.substr(1), std::string(), good + " " + good, good + "\x01", good + "\xc3\xa9"})
    EXPECT_FALSE(read_token_file(write(bad)).ok()) << bad;
}

// Claim: of the kernel's tables of sockets those count that listen on the port, on loopback or on all
// addresses, of IPv4 and IPv6. (Lines of a machine, with users 1000 to 1006.)
TEST_F(WireToken, ListenersAreFound) {
  const std::string head =
      "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n";
  const auto line = [](const std::string& local, const char* state, int user) {
    return "   0: " + local + " 00000000:0000 " + state + " 00000000:00000000 00:00000000 00000000  " +
           std::to_string(user) + "        0 12345 1 0000000000000000 100 0 0 10 0\n";
  };
  const std::string four = head + line("0100007F:1B9E", "0A", 1000) + line("00000000:1B9E", "0A", 1001) +
                           line("0500000A:1B9E", "0A", 1002) + line("0100007F:1B9F", "0A", 1003) +
                           line("0100007F:1B9E", "01", 1004);
  EXPECT_EQ(listeners(four, 7070), (std::vector<uid_t>{1000, 1001}));
  EXPECT_EQ(listeners(four, 7071), (std::vector<uid_t>{1003}));
  const std::string six = head + line("00000000000000000000000001000000:1B9E", "0A", 1000) +
                          line("00000000000000000000000000000000:1B9E", "0A", 1001) +
                          line("0000000000000000FFFF00000100007F:1B9E", "0A", 1002) +
                          line("B80D01200000000000000000010000C0:1B9E", "0A", 1003);
  EXPECT_EQ(listeners(six, 7070), (std::vector<uid_t>{1000, 1001, 1002}));
  EXPECT_TRUE(listeners("", 7070).empty());
  EXPECT_TRUE(listeners(head + "   0: nonsense\n\n", 7070).empty());
}

// Claim: a program that finds its token by itself sends it to its own user's listener or root's, and dials no
// other.
TEST_F(WireToken, GoesToNoOtherUser) {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof to;
  ASSERT_EQ(::bind(fd, reinterpret_cast<sockaddr*>(&to), size), 0);
  ASSERT_EQ(::listen(fd, 1), 0);
  ASSERT_EQ(::getsockname(fd, reinterpret_cast<sockaddr*>(&to), &size), 0);
  const auto address = *parse_address(fmt::format("127.0.0.1:{}", ntohs(to.sin_port)), "--master");
  const fs::path token = write(std::string(16, 'x'));
  EXPECT_TRUE(check_listener(address, token).ok());
  if (::geteuid() == 0) {  // somebody else needs another user
    ASSERT_EQ(::chown(token.c_str(), 65534, 65534), 0);
    EXPECT_TRUE(check_listener(address, token).ok()) << "root listens";
    ASSERT_EQ(::seteuid(65534), 0);
    const int other = ::socket(AF_INET, SOCK_STREAM, 0);
    to.sin_port = 0;
    const bool bound = ::bind(other, reinterpret_cast<sockaddr*>(&to), size) == 0 &&
                       ::listen(other, 1) == 0 &&
                       ::getsockname(other, reinterpret_cast<sockaddr*>(&to), &size) == 0;
    ASSERT_EQ(::seteuid(0), 0);
    ASSERT_TRUE(bound);
    const auto theirs = *parse_address(fmt::format("127.0.0.1:{}", ntohs(to.sin_port)), "--master");
    EXPECT_TRUE(check_listener(theirs, token).ok()) << "the token is theirs";
    ASSERT_EQ(::chown(token.c_str(), 0, 0), 0);
    const auto refused = check_listener(theirs, token);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().file, token.string());
    ::close(other);
  }
  ::close(fd);
}

// Claim: programs look for the token of a master of this machine by its port, under each of its names, in
// the user's state folder.
TEST_F(WireToken, IsPublishedByPort) {
  ::setenv("XDG_STATE_HOME", folder_.path().c_str(), 1);
  const auto at = [](const char* address) {
    return published_token_file(*parse_address(address, "--master")).value_or("");
  };
  EXPECT_EQ(at("127.0.0.1:7070"), at("localhost:7070"));
  EXPECT_EQ(at("127.0.0.1:7070"), at("0.0.0.0:7070"));
  EXPECT_EQ(at("127.0.0.1:7070"), at("[::1]:7070"));
  EXPECT_NE(at("127.0.0.1:7070"), at("127.0.0.1:7071"));
  EXPECT_NE(at("127.0.0.1:7070"), at("elsewhere.example.org:7070"));
  EXPECT_TRUE(at("127.0.0.1:7070").string().starts_with(folder_.path().string()));
  ASSERT_TRUE(publish_token("0123456789abcdef", at("127.0.0.1:7070")).ok());
  EXPECT_EQ(*read_token_file(at("localhost:7070")), "0123456789abcdef");
  EXPECT_EQ(fs::status(at("localhost:7070")).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  ::unsetenv("XDG_STATE_HOME");
}

}  // namespace
}  // namespace candela::wire
