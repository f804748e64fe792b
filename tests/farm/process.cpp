#include "tests/farm/process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <thread>

namespace candela::farm {
namespace {

std::string slurp(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

}  // namespace

TempDir::TempDir() {
  std::string name = (std::filesystem::temp_directory_path() / "candela-farm-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr)
    throw std::runtime_error("mkdtemp: " + std::string(std::strerror(errno)));
  path_ = name;
}

TempDir::~TempDir() {
  std::error_code code;
  std::filesystem::remove_all(path_, code);
}

bool eventually(double seconds, const std::function<bool()>& condition) {
  const Stopwatch clock;
  for (;;) {
    if (condition()) return true;
    if (clock.seconds() >= seconds) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
}

Process::Process(const std::vector<std::string>& arguments, const std::filesystem::path& out,
                 const std::map<std::string, std::string>& environment)
    : out_(out.string() + ".out"), err_(out.string() + ".err") {
  // All memory is had before the fork: other threads of this process (gRPC's) may hold the allocator's lock.
  std::vector<char*> argv;
  for (const std::string& a : arguments) argv.push_back(const_cast<char*>(a.c_str()));
  argv.push_back(nullptr);
  std::vector<std::string> settings;
  for (const auto& [name, value] : environment) settings.push_back(name + "=" + value);
  std::vector<char*> envp;
  for (std::string& s : settings) envp.push_back(s.data());
  envp.push_back(nullptr);
  const int in_fd = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
  const int out_fd = ::open(out_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0600);
  const int err_fd = ::open(err_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0600);
  if (in_fd < 0 || out_fd < 0 || err_fd < 0)
    throw std::runtime_error("cannot open the output files of a child");
  const pid_t parent = ::getpid();
  pid_ = ::fork();
  if (pid_ == 0) {
    ::setpgid(0, 0);
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(126);  // the test died before the line above
    sigset_t none;
    sigemptyset(&none);
    ::sigprocmask(SIG_SETMASK, &none, nullptr);
    // Tests send these; a test started in the background of a shell inherits that they are ignored.
    for (const int number : {SIGINT, SIGQUIT, SIGHUP}) ::signal(number, SIG_DFL);
    // A file size limit (the full disk test's) shall come as an error, as a full disk does, not as a signal.
    ::signal(SIGXFSZ, SIG_IGN);
    ::dup2(in_fd, 0);
    ::dup2(out_fd, 1);
    ::dup2(err_fd, 2);
    ::execve(argv[0], argv.data(), envp.data());
    ::_exit(127);
  }
  ::close(in_fd);
  ::close(out_fd);
  ::close(err_fd);
  if (pid_ < 0) throw std::runtime_error("fork: " + std::string(std::strerror(errno)));
  ::setpgid(pid_, pid_);
}

Process::~Process() {
  kill();
}

void Process::signal(int number) {
  if (!exit_) ::kill(pid_, number);
}

void Process::kill() {
  if (exit_) return;
  ::kill(-pid_, SIGKILL);
  ::kill(pid_, SIGKILL);
  if (!wait(30)) std::abort();  // a child that survives SIGKILL: nothing here can be trusted any more
}

std::optional<int> Process::wait(double seconds) {
  eventually(seconds, [this] {
    if (exit_) return true;
    int status = 0;
    const pid_t got = ::waitpid(pid_, &status, WNOHANG);
    if (got == 0 || (got < 0 && errno == EINTR)) return false;
    exit_ = got < 0 ? 255 : WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
    return true;
  });
  return exit_;
}

std::string Process::out() const {
  return slurp(out_);
}
std::string Process::err() const {
  return slurp(err_);
}

std::string Process::wait_for_line(const std::string& prefix, double seconds) {
  std::string found;
  eventually(seconds, [&] {
    std::istringstream lines(out());
    for (std::string line; std::getline(lines, line);) {
      if (lines.eof()) break;  // no newline yet
      if (!line.starts_with(prefix)) continue;
      found = line.substr(prefix.size());
      return true;
    }
    return !running();
  });
  return found;
}

}  // namespace candela::farm
