// The means by which the soak harms a farm.
#pragma once

#include <arpa/inet.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "tests/farm/process.h"

namespace candela::farm {

inline std::uint64_t number_from(const char* variable, std::uint64_t otherwise) {
  const char* text = std::getenv(variable);
  return text == nullptr ? otherwise : std::strtoull(text, nullptr, 10);
}

// Somebody who looks at the page, and may not wait for the answer.
class Viewer {
 public:
  explicit Viewer(const std::string& address) {
    fd_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to.sin_port = htons(static_cast<std::uint16_t>(std::stoi(address.substr(address.rfind(':') + 1))));
    (void)::connect(fd_, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  }
  ~Viewer() { ::close(fd_); }
  Viewer(const Viewer&) = delete;
  Viewer& operator=(const Viewer&) = delete;
  void ask(const std::string& path, const std::string& token, bool half) {
    std::string text =
        "GET " + path + " HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer " + token + "\r\n\r\n";
    if (half) text.resize(text.size() / 2);
    (void)::send(fd_, text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  }
  bool answered(double seconds) const {
    pollfd polled{fd_, POLLIN, 0};
    char first = 0;
    return ::poll(&polled, 1, static_cast<int>(seconds * 1e3)) == 1 && ::recv(fd_, &first, 1, 0) == 1;
  }

 private:
  int fd_ = -1;
};

inline bool flip_bit(const std::filesystem::path& path, std::uint64_t at) {
  std::error_code code;
  const std::uint64_t size = std::filesystem::file_size(path, code);
  if (code || size == 0) return false;
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekg(static_cast<std::streamoff>(at % size));
  const int byte = file.get();
  file.seekp(static_cast<std::streamoff>(at % size));
  file.put(static_cast<char>(byte ^ (1 << (at % 8))));
  return file.good();
}

inline double resident_mb(const Process& process) {
  std::ifstream file(fmt::format("/proc/{}/statm", process.pid()));
  double pages = 0;
  file >> pages >> pages;
  return pages * static_cast<double>(::sysconf(_SC_PAGESIZE)) * 1e-6;
}

}  // namespace candela::farm
