// A receiver of HTTP requests on loopback that answers as a test says.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "common/base/descriptor.h"

namespace candela::test {

class HttpReceiver {
 public:
  static constexpr int kSilence = -1;  // takes the request, and never answers

  // Answers with these codes, one after the other, then with 200. `away`: nobody listens at its port until
  // come().
  explicit HttpReceiver(std::deque<int> codes = {}, bool away = false) : codes_(std::move(codes)) {
    listener_ = Descriptor(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    if (::bind(listener_.get(), reinterpret_cast<sockaddr*>(&address), size) != 0 ||
        ::getsockname(listener_.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0)
      throw std::runtime_error("a port of this machine cannot be bound");
    port_ = ntohs(address.sin_port);
    if (!away) come();
  }
  void come() {
    if (::listen(listener_.get(), 64) != 0) throw std::runtime_error("a port cannot be listened at");
    thread_ = std::thread([this] { run(); });
  }
  ~HttpReceiver() {
    stop_ = true;
    ::shutdown(listener_.get(), SHUT_RDWR);
    if (thread_.joinable()) thread_.join();
  }
  int port() const { return port_; }
  std::string url() const { return "http://127.0.0.1:" + std::to_string(port_) + "/notices"; }

  struct Request {
    std::string head, body;
    std::string field(const std::string& name) const {
      const std::size_t at = head.find("\r\n" + name + ": ");
      if (at == std::string::npos) return {};
      const std::size_t begin = at + name.size() + 4;
      return head.substr(begin, head.find("\r\n", begin) - begin);
    }
  };
  // At least so many requests, or those that came within 20 s.
  std::vector<Request> wait_for(std::size_t count) {
    std::unique_lock lock(mutex_);
    came_.wait_for(lock, std::chrono::seconds(20), [&] { return requests_.size() >= count; });
    return requests_;
  }

 private:
  void run() {
    std::vector<Descriptor> silent;  // open until the receiver ends
    while (!stop_) {
      Descriptor socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC));
      if (socket.get() < 0) return;
      const timeval patience{5, 0};
      ::setsockopt(socket.get(), SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
      std::string text;
      std::size_t head = std::string::npos, length = 0;
      char buffer[4096];
      while (head == std::string::npos || text.size() < head + 4 + length) {
        const ssize_t n = ::recv(socket.get(), buffer, sizeof buffer, 0);
        if (n <= 0) break;
        text.append(buffer, static_cast<std::size_t>(n));
        head = text.find("\r\n\r\n");
        const std::size_t at = text.find("Content-Length: ");
        if (head != std::string::npos && at < head) length = std::stoul(text.substr(at + 16));
      }
      if (head == std::string::npos) continue;
      int code = 200;
      {
        const std::lock_guard lock(mutex_);
        requests_.push_back({text.substr(0, head + 2), text.substr(head + 4)});
        if (!codes_.empty()) {
          code = codes_.front();
          codes_.pop_front();
        }
      }
      if (code == kSilence) {
        silent.push_back(std::move(socket));
      } else {
        const std::string answer = "HTTP/1.1 " + std::to_string(code) +
                                   " X\r\nLocation: /elsewhere\r\nContent-Length: 0\r\nConnection: "
                                   "close\r\n\r\n";
        static_cast<void>(::send(socket.get(), answer.data(), answer.size(), MSG_NOSIGNAL));
      }
      came_.notify_all();
    }
  }

  Descriptor listener_;
  int port_ = 0;
  std::atomic<bool> stop_{false};
  std::mutex mutex_;
  std::condition_variable came_;
  std::deque<int> codes_;
  std::vector<Request> requests_;
  std::thread thread_;
};

}  // namespace candela::test
