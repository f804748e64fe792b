// Requests and answers are a byte, a length and as many bytes; both ends are one binary, so numbers go as
// they are.
#include "tests/bench/candela_bench/process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

extern char** environ;

namespace candela::bench {
namespace {

enum class Request : char { start = 'S', advance = 'A', snapshot = 'I', save = 'K', restore = 'R' };
constexpr char kAnswer = '+', kError = '-';
constexpr std::uint64_t kLongestMessage = 1ULL << 36;

bool write_all(int to, const char* data, std::size_t size) {
  while (size > 0) {
    const ssize_t written = ::write(to, data, size);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    data += written;
    size -= static_cast<std::size_t>(written);
  }
  return true;
}

bool read_all(int from, char* data, std::size_t size) {
  while (size > 0) {
    const ssize_t got = ::read(from, data, size);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    data += got;
    size -= static_cast<std::size_t>(got);
  }
  return true;
}

bool send(int to, char kind, std::string_view body) {
  const std::uint64_t size = body.size();
  return write_all(to, &kind, 1) && write_all(to, reinterpret_cast<const char*>(&size), sizeof size) &&
         write_all(to, body.data(), body.size());
}

bool receive(int from, char& kind, std::string& body) {
  std::uint64_t size = 0;
  if (!read_all(from, &kind, 1) || !read_all(from, reinterpret_cast<char*>(&size), sizeof size) ||
      size > kLongestMessage)
    return false;
  body.resize(size);
  return read_all(from, body.data(), size);
}

template <class T>
std::string bytes_of(const T& value) {
  static_assert(std::is_trivially_copyable_v<T>);
  return {reinterpret_cast<const char*>(&value), sizeof value};
}

template <class T>
Result<T> value_of(const std::string& bytes) {
  T value;
  if (bytes.size() != sizeof value) return internal_error("an answer of the wrong length");
  std::memcpy(&value, bytes.data(), sizeof value);
  return value;
}

class ProcessEstimator final : public Estimator {
 public:
  ProcessEstimator(pid_t pid, int to, int from, std::string what)
      : pid_(pid), to_(to), from_(from), what_(std::move(what)) {}
  ProcessEstimator(const ProcessEstimator&) = delete;
  ProcessEstimator& operator=(const ProcessEstimator&) = delete;
  ~ProcessEstimator() override {
    ::close(to_);
    ::close(from_);
    int status = 0;
    while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
  }

  Result<void> start(const RunSpec& run) {
    CANDELA_ASSIGN(unit_name_, ask(Request::start, run.to_json()));
    return {};
  }
  std::string unit_name() const override { return unit_name_; }
  Result<Cost> advance(std::uint64_t units) override {
    CANDELA_ASSIGN(const std::string answer, ask(Request::advance, bytes_of(units)));
    return value_of<Cost>(answer);
  }
  Result<Snapshot> snapshot() override {
    CANDELA_ASSIGN(const std::string answer, ask(Request::snapshot, {}));
    Snapshot snapshot;
    if (answer.size() < sizeof(double)) return internal_error("an answer of the wrong length");
    std::memcpy(&snapshot.own_relmse, answer.data(), sizeof(double));
    snapshot.image.resize((answer.size() - sizeof(double)) / sizeof(float));
    std::memcpy(snapshot.image.data(), answer.data() + sizeof(double), snapshot.image.size() * sizeof(float));
    return snapshot;
  }
  Result<std::string> save() override { return ask(Request::save, {}); }
  Result<Cost> restore(std::string_view saved) override {
    CANDELA_ASSIGN(const std::string answer, ask(Request::restore, saved));
    return value_of<Cost>(answer);
  }

 private:
  Result<std::string> ask(Request request, std::string_view body) {
    char kind = 0;
    std::string answer;
    if (!send(to_, static_cast<char>(request), body) || !receive(from_, kind, answer))
      return failed_error(fmt::format("the process that renders {} ended", what_))
          .with_mend("see whether the system ended it (memory, threads), and what it printed");
    if (kind == kError) return failed_error(answer);
    return answer;
  }

  pid_t pid_;
  int to_, from_;
  std::string what_, unit_name_;
};

// The answer to one request, or its error.
Result<std::string> answer(std::unique_ptr<Estimator>& estimator, const EstimatorFactory& factory, char kind,
                           const std::string& body) {
  if (static_cast<Request>(kind) == Request::start) {
    CANDELA_ASSIGN(const RunSpec run, RunSpec::from_json(body));
    CANDELA_ASSIGN(estimator, factory(run));
    return estimator->unit_name();
  }
  if (estimator == nullptr) return internal_error("a request before there is a run");
  switch (static_cast<Request>(kind)) {
    case Request::advance: {
      CANDELA_ASSIGN(const std::uint64_t units, value_of<std::uint64_t>(body));
      CANDELA_ASSIGN(const Cost cost, estimator->advance(units));
      return bytes_of(cost);
    }
    case Request::snapshot: {
      CANDELA_ASSIGN(const Snapshot snapshot, estimator->snapshot());
      return bytes_of(snapshot.own_relmse) + std::string(reinterpret_cast<const char*>(snapshot.image.data()),
                                                         snapshot.image.size() * sizeof(float));
    }
    case Request::save:
      return estimator->save();
    case Request::restore: {
      CANDELA_ASSIGN(const Cost cost, estimator->restore(body));
      return bytes_of(cost);
    }
    default:
      return internal_error("an unknown request");
  }
}

}  // namespace

Result<std::unique_ptr<Estimator>> make_process_estimator(const std::string& program, const RunSpec& run) {
  std::array<int, 2> to{}, from{};
  if (::pipe2(to.data(), O_CLOEXEC) != 0) return resource_error("no pipe to another process");
  if (::pipe2(from.data(), O_CLOEXEC) != 0) {
    ::close(to[0]);
    ::close(to[1]);
    return resource_error("no pipe to another process");
  }
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, to[0], 0);
  ::posix_spawn_file_actions_adddup2(&actions, from[1], 1);
  const std::string command = "serve";
  std::array<char*, 3> arguments = {const_cast<char*>(program.c_str()), const_cast<char*>(command.c_str()),
                                    nullptr};
  // A group of its own, which Ctrl-C does not reach: the one who asks decides when it ends.
  posix_spawnattr_t attributes;
  ::posix_spawnattr_init(&attributes);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  ::posix_spawnattr_setpgroup(&attributes, 0);
  pid_t pid = 0;
  const int failed = ::posix_spawn(&pid, program.c_str(), &actions, &attributes, arguments.data(), environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&actions);
  ::close(to[0]);
  ::close(from[1]);
  if (failed != 0) {
    ::close(to[1]);
    ::close(from[0]);
    return resource_error(fmt::format("cannot start {}: {}", program, std::strerror(failed)));
  }
  auto estimator = std::make_unique<ProcessEstimator>(
      pid, to[1], from[0], fmt::format("{} with {}, seed {},", run.scene, run.variant, run.job.seed));
  CANDELA_TRY(estimator->start(run));
  return std::unique_ptr<Estimator>(std::move(estimator));
}

int serve(int in, int out, const EstimatorFactory& factory) {
  ::signal(SIGINT, SIG_IGN);  // a slice is finished and kept
  ::signal(SIGTERM, SIG_IGN);
  ::signal(SIGPIPE, SIG_IGN);
  std::unique_ptr<Estimator> estimator;
  char kind = 0;
  std::string body;
  while (receive(in, kind, body)) {
    const Result<std::string> result = answer(estimator, factory, kind, body);
    const bool sent =
        result.ok() ? send(out, kAnswer, *result) : send(out, kError, result.error().to_string());
    if (!sent) break;
  }
  return 0;
}

}  // namespace candela::bench
