// tev's network protocol (github.com/Tom94/tev): an image viewer that programs send pixels to over TCP. A
// packet is its length (uint32, itself included), a type, and fields; integers are little-endian, texts end
// in zero.
#pragma once

#include <chrono>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"

namespace candela::client {

// An image as the viewer gets it. `channels`: their names, such as R and light.key.R; tev shows those with
// one name before the last dot as a layer. `values`: of all channels, interleaved, row by row from the top.
struct TevImage {
  std::uint32_t width = 0, height = 0;
  std::span<const std::string> channels;
  std::span<const float> values;
};

// A new image of this size with these channels.
std::string tev_create_packet(std::string_view name, const TevImage& image);
// Rows [y, y + rows) of the image.
std::string tev_update_packet(std::string_view name, const TevImage& image, std::uint32_t y,
                              std::uint32_t rows);

// A viewer that is called when there is something to show. One that is away, or that takes nothing for some
// seconds, costs that time and an error; the next picture is a new attempt.
class TevViewer {
 public:
  // `address`: HOST:PORT. A usage error, naming --tev, if it is none.
  // `wait_ms`: for a connection, and for a viewer that takes nothing. A picture gets four times as long in
  // all.
  static Result<TevViewer> create(std::string_view address, std::string name, int wait_ms = 3000);
  TevViewer(TevViewer&& other) noexcept;
  TevViewer& operator=(TevViewer&&) = delete;
  ~TevViewer();

  // Errors: ErrorKind::unreachable.
  Result<void> show(const TevImage& image);

 private:
  TevViewer(std::string host, int port, std::string name, int wait_ms);
  Result<void> connect();
  Result<void> send(std::string_view bytes);
  void close();
  bool wait_to_send() const;
  Error lost(std::string_view what) const;

  std::string host_;
  int port_ = 0;
  std::string name_;
  int wait_ms_;
  int socket_ = -1;
  std::vector<std::string> channels_;                 // of the image that the viewer has
  std::chrono::steady_clock::time_point deadline_{};  // of the picture that is being sent
};

}  // namespace candela::client
