#include "common/wire/token.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <openssl/crypto.h>
#include <pwd.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/base/mutex.h"
#include "common/wire/listener.h"

namespace candela::wire {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kMaxTokenFileBytes = 4096;
constexpr std::size_t kMinTokenBytes = 16;
constexpr int kRandomBytes = 32;

std::string host_name() {
  std::array<char, 256> host{};
  return ::gethostname(host.data(), host.size() - 1) == 0 ? host.data() : "localhost";
}

std::string_view trimmed(std::string_view text) {
  const auto begin = text.find_first_not_of(" \t\r\n");
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(" \t\r\n") - begin + 1);
}

Error no_file(const fs::path& file) {
  return input_error(fmt::format("cannot write the token: {}", std::strerror(errno))).at(file.string(), 0);
}

// Whole or not at all, and never readable for others.
Result<void> write_private(const fs::path& file, const std::string& text) {
  const std::string beside = fmt::format("{}.{}", file.string(), ::getpid());
  ::unlink(beside.c_str());
  const int fd = ::open(beside.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (fd < 0) return no_file(file);
  const bool written =
      ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && ::fsync(fd) == 0;
  ::close(fd);
  if (written && ::rename(beside.c_str(), file.c_str()) == 0) return {};
  Error error = no_file(file);
  ::unlink(beside.c_str());
  return error;
}

// The token for a call; nothing: the call goes without one.
using TokenSource = std::function<std::optional<std::string>()>;

class TokenInterceptor final : public grpc::experimental::Interceptor {
 public:
  explicit TokenInterceptor(const TokenSource& source) : source_(source) {}
  void Intercept(grpc::experimental::InterceptorBatchMethods* methods) override {
    if (methods->QueryInterceptionHookPoint(
            grpc::experimental::InterceptionHookPoints::PRE_SEND_INITIAL_METADATA))
      if (std::optional<std::string> token = source_())
        methods->GetSendInitialMetadata()->insert({kTokenField, std::move(*token)});
    methods->Proceed();
  }

 private:
  const TokenSource& source_;  // the factory's, which lives as long as the channel
};

class TokenInterceptors final : public grpc::experimental::ClientInterceptorFactoryInterface {
 public:
  explicit TokenInterceptors(TokenSource source) : source_(std::move(source)) {}
  grpc::experimental::Interceptor* CreateClientInterceptor(grpc::experimental::ClientRpcInfo*) override {
    return new TokenInterceptor(source_);
  }

 private:
  TokenSource source_;
};

using Interceptors = std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>>;

Interceptors interceptors(TokenSource source) {
  Interceptors one;
  one.push_back(std::make_unique<TokenInterceptors>(std::move(source)));
  return one;
}

}  // namespace

Result<std::string> read_token_file(const fs::path& file) {
  CANDELA_ASSIGN(const std::string text, read_file(file, kMaxTokenFileBytes));
  struct stat facts {};
  if (::stat(file.c_str(), &facts) == 0 && (facts.st_mode & (S_IROTH | S_IWOTH)) != 0)
    return input_error("every user of this machine can read or write the token")
        .at(file.string(), 0)
        .with_mend(fmt::format("chmod 600 {}, and put another token into it", file.string()));
  const std::string_view token = trimmed(text);
  const bool printable =
      std::all_of(token.begin(), token.end(), [](char c) { return c > ' ' && c < '\x7f'; });
  if (token.size() < kMinTokenBytes || !printable)
    return input_error(
               fmt::format("a token has {} printable characters or more, without space", kMinTokenBytes))
        .at(file.string(), 0)
        .with_mend("make one with: openssl rand -hex 32");
  return std::string(token);
}

Result<std::string> random_token() {
  std::array<unsigned char, kRandomBytes> random{};
  // Not OpenSSL's: its start costs more than all else of a master's.
  if (::getrandom(random.data(), random.size(), 0) != kRandomBytes)
    return failed_error(fmt::format("the system gives no random numbers: {}", std::strerror(errno)));
  std::string token;
  for (const unsigned char byte : random) token += fmt::format("{:02x}", byte);
  return token;
}

Result<std::string> make_token_file(const fs::path& file) {
  if (std::error_code code; fs::exists(fs::symlink_status(file, code))) return read_token_file(file);
  CANDELA_ASSIGN(std::string token, random_token());
  CANDELA_TRY(write_private(file, token + "\n"));
  return token;
}

std::optional<fs::path> published_token_file(const Address& master) {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value != nullptr ? value : "");
  };
  fs::path state = variable("XDG_STATE_HOME");  // the specification says to ignore a relative path
  if (!state.is_absolute()) {
    fs::path home = variable("HOME");
    if (const passwd* user = home.empty() ? ::getpwuid(::geteuid()) : nullptr) home = user->pw_dir;
    if (!home.is_absolute() || home == "/") return std::nullopt;
    state = home / ".local" / "state";
  }
  // Machines may share a home.
  const bool here = master.loopback || master.host == "0.0.0.0" || master.host == "::";
  return state / "candela" / "masters" /
         fmt::format("{}-{}.token", here ? host_name() : master.host, master.port);
}

Result<void> publish_token(const std::string& token, const fs::path& file) {
  CANDELA_TRY(make_directories(file.parent_path()));
  return write_private(file, token + "\n");
}

bool same_token(std::string_view a, std::string_view b) {
  // Compares hashes, so that the lengths do not tell either.
  const std::string x = sha256_hex(a), y = sha256_hex(b);
  return CRYPTO_memcmp(x.data(), y.data(), x.size()) == 0;
}

std::shared_ptr<grpc::Channel> token_channel(const std::string& target,
                                             const std::shared_ptr<grpc::ChannelCredentials>& credentials,
                                             const grpc::ChannelArguments& arguments, const fs::path& file,
                                             const std::optional<Address>& listener) {
  // The listener is looked up at most once a second: the kernel's table takes milliseconds, and a thousand
  // frames are three thousand calls.
  struct Looked {
    Mutex mutex;
    std::optional<std::chrono::steady_clock::time_point> good CANDELA_GUARDED_BY(mutex);
  };
  const auto source = [file, listener, looked = std::make_shared<Looked>()]() -> std::optional<std::string> {
    auto token = read_token_file(file);
    if (!token) return std::nullopt;
    if (listener) {
      const Lock lock(looked->mutex);
      const auto now = std::chrono::steady_clock::now();
      if (!looked->good || now - *looked->good > std::chrono::seconds(1)) {
        looked->good.reset();
        if (!check_listener(*listener, file)) return std::nullopt;
        looked->good = now;
      }
    }
    return std::move(*token);
  };
  return grpc::experimental::CreateCustomChannelWithInterceptors(target, credentials, arguments,
                                                                 interceptors(source));
}

Interceptors token_interceptors(std::string token) {
  return interceptors([token = std::move(token)] { return std::optional(token); });
}

std::string user_at_host() {
  const passwd* user = ::getpwuid(::geteuid());
  const std::string name = user != nullptr ? user->pw_name : fmt::format("{}", ::geteuid());
  return name + "@" + host_name();
}

}  // namespace candela::wire
