#include "client/preview/tev.h"

#include <fmt/format.h>
#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>
#include <memory>
#include <utility>

#include "common/wire/wire.h"

namespace candela::client {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kBandBytes = 1 << 20;
constexpr char kCreateImage = 4, kUpdateImage = 6;  // of the protocol's versions 1 and 3

static_assert(std::endian::native == std::endian::little);

template <class T>
void put(std::string& out, T value) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out.append(bytes, sizeof value);
}

void put_text(std::string& out, std::string_view text) {
  out += text.substr(0, text.find('\0'));
  out += '\0';
}

std::string begin_packet(char type, std::string_view name) {
  std::string packet(4, '\0');  // the length, known at the end
  packet += type;
  packet += '\0';  // does not take the focus
  put_text(packet, name);
  return packet;
}

void put_channels(std::string& packet, std::span<const std::string> channels) {
  put(packet, static_cast<std::int32_t>(channels.size()));
  for (const std::string& channel : channels) put_text(packet, channel);
}

std::string end_packet(std::string packet) {
  const auto size = static_cast<std::uint32_t>(packet.size());
  std::memcpy(packet.data(), &size, sizeof size);
  return packet;
}

}  // namespace

std::string tev_create_packet(std::string_view name, const TevImage& image) {
  std::string packet = begin_packet(kCreateImage, name);
  put(packet, static_cast<std::int32_t>(image.width));
  put(packet, static_cast<std::int32_t>(image.height));
  put_channels(packet, image.channels);
  return end_packet(std::move(packet));
}

std::string tev_update_packet(std::string_view name, const TevImage& image, std::uint32_t y,
                              std::uint32_t rows) {
  std::string packet = begin_packet(kUpdateImage, name);
  put_channels(packet, image.channels);
  for (const std::uint32_t value : {0U, y, image.width, rows}) put(packet, static_cast<std::int32_t>(value));
  const auto count = static_cast<std::int64_t>(image.channels.size());
  for (std::int64_t offset = 0; offset < count; ++offset) put(packet, offset);
  for (std::int64_t channel = 0; channel < count; ++channel) put(packet, count);  // strides
  const std::size_t row = std::size_t{image.width} * image.channels.size();
  const std::span<const float> sent = image.values.subspan(y * row, rows * row);
  packet.append(reinterpret_cast<const char*>(sent.data()), sent.size_bytes());
  return end_packet(std::move(packet));
}

TevViewer::TevViewer(std::string host, int port, std::string name, int wait_ms)
    : host_(std::move(host)), port_(port), name_(std::move(name)), wait_ms_(wait_ms) {}
TevViewer::TevViewer(TevViewer&& other) noexcept
    : host_(std::move(other.host_)),
      port_(other.port_),
      name_(std::move(other.name_)),
      wait_ms_(other.wait_ms_),
      socket_(std::exchange(other.socket_, -1)),
      channels_(std::move(other.channels_)) {}
TevViewer::~TevViewer() {
  close();
}

Result<TevViewer> TevViewer::create(std::string_view address, std::string name, int wait_ms) {
  CANDELA_ASSIGN(const wire::Address parsed, wire::parse_address(address, "--tev"));
  if (parsed.port == 0)
    return usage_error(fmt::format("{} has port 0, which nobody can call", parsed.text()))
        .with_field("--tev");
  return TevViewer(parsed.host, parsed.port, std::move(name), wait_ms);
}

void TevViewer::close() {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
}

Error TevViewer::lost(std::string_view what) const {
  return unreachable_error(fmt::format("the viewer tev at {}:{} {}", host_, port_, what))
      .with_mend("is it running? (tev --host HOST:PORT)");
}

bool TevViewer::wait_to_send() const {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline_ - Clock::now()).count();
  if (left <= 0) return false;
  struct pollfd entry {
    socket_, POLLOUT, 0
  };
  int ready = 0;
  do ready = ::poll(&entry, 1, static_cast<int>(std::min<std::int64_t>(wait_ms_, left)));
  while (ready < 0 && errno == EINTR);
  return ready == 1;
}

Result<void> TevViewer::connect() {
  struct addrinfo hints {};
  hints.ai_socktype = SOCK_STREAM;
  struct addrinfo* found = nullptr;
  if (const int code = ::getaddrinfo(host_.c_str(), std::to_string(port_).c_str(), &hints, &found); code != 0)
    return lost(fmt::format("is not known: {}", ::gai_strerror(code)));
  const std::unique_ptr<struct addrinfo, decltype(&::freeaddrinfo)> addresses(found, &::freeaddrinfo);
  int why = ECONNREFUSED;
  for (const struct addrinfo* a = found; a != nullptr; a = a->ai_next) {
    socket_ = ::socket(a->ai_family, a->ai_socktype | SOCK_NONBLOCK | SOCK_CLOEXEC, a->ai_protocol);
    if (socket_ < 0) continue;
    why = ::connect(socket_, a->ai_addr, a->ai_addrlen) == 0 ? 0 : errno;
    if (why == EINPROGRESS) {
      socklen_t size = sizeof why;
      if (!wait_to_send())
        why = ETIMEDOUT;
      else if (::getsockopt(socket_, SOL_SOCKET, SO_ERROR, &why, &size) != 0)
        why = errno;
    }
    if (why == 0) return {};
    close();
  }
  return lost(fmt::format("cannot be reached: {}", std::strerror(why)));
}

Result<void> TevViewer::send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent >= 0) {
      bytes.remove_prefix(static_cast<std::size_t>(sent));
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      if (!wait_to_send()) return lost("takes nothing");
    } else if (errno != EINTR) {
      return lost(fmt::format("went away: {}", std::strerror(errno)));
    }
  }
  return {};
}

Result<void> TevViewer::show(const TevImage& image) {
  if (!std::equal(image.channels.begin(), image.channels.end(), channels_.begin(), channels_.end())) close();
  deadline_ = Clock::now() + std::chrono::milliseconds(4 * wait_ms_);
  const auto attempt = [&]() -> Result<void> {
    if (socket_ < 0) {
      CANDELA_TRY(connect());
      CANDELA_TRY(send(tev_create_packet(name_, image)));
      channels_.assign(image.channels.begin(), image.channels.end());
    }
    const std::size_t row = std::size_t{image.width} * image.channels.size();
    const auto band =
        static_cast<std::uint32_t>(std::max<std::size_t>(1, kBandBytes / (row * sizeof(float))));
    for (std::uint32_t y = 0; y < image.height; y += band)
      CANDELA_TRY(send(tev_update_packet(name_, image, y, std::min(band, image.height - y))));
    return {};
  };
  auto shown = attempt();
  if (!shown) close();
  return shown;
}

}  // namespace candela::client
