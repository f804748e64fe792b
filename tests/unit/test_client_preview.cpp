// Pictures while they converge: a viewer that speaks tev's protocol, decoded here from its description and
// not by the product's code, and a PNG that is rewritten.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <sstream>
#include <thread>

#include "client/embedded/app.h"
#include "client/preview/preview.h"
#include "client/preview/tev.h"
#include "common/image/image.h"
#include "tests/temporary_folder.h"
#include "tests/unit/client_outcome.h"

namespace candela::client {
namespace {

namespace fs = std::filesystem;

// Fields of a packet, in order.
class PacketReader {
 public:
  explicit PacketReader(std::string bytes) : bytes_(std::move(bytes)) {}
  template <class T>
  T number() {
    T value{};
    if (at_ + sizeof value > bytes_.size()) throw std::runtime_error("the packet is too short");
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  std::string text() {
    const std::size_t end = bytes_.find('\0', at_);
    if (end == std::string::npos) throw std::runtime_error("a text without end");
    std::string out = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return out;
  }
  std::size_t left() const { return bytes_.size() - at_; }

 private:
  std::string bytes_;
  std::size_t at_ = 0;
};

// A socket that listens on a free port of loopback.
class Listener {
 public:
  Listener() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    struct sockaddr_in address {};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(socket_, reinterpret_cast<struct sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(socket_, 8), 0);
    EXPECT_EQ(::getsockname(socket_, reinterpret_cast<struct sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
  }
  ~Listener() { ::close(socket_); }
  Listener(const Listener&) = delete;
  Listener& operator=(const Listener&) = delete;
  int socket() const { return socket_; }
  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }

 private:
  int socket_, port_ = 0;
};

// Listens, and keeps the image that it is told of.
class FakeTev {
 public:
  // `packets`: after so many of a connection the viewer goes away.
  explicit FakeTev(int packets = 1 << 30) : packets_(packets), thread_([this] { serve(); }) {}
  ~FakeTev() { stop(); }
  // Reads what is under way, and ends.
  void stop() {
    if (!thread_.joinable()) return;
    ::shutdown(listener_.socket(), SHUT_RDWR);  // refuses all that come later
    thread_.join();
  }
  std::string address() const { return listener_.address(); }

  // After stop().
  std::string name, error;
  std::int32_t width = 0, height = 0;
  int connections = 0, created = 0, updated_rows = 0;
  std::vector<std::string> channels;
  std::vector<float> rgb;

 private:
  static bool read_all(int from, char* to, std::size_t size) {
    while (size > 0) {
      const ssize_t got = ::recv(from, to, size, 0);
      if (got <= 0) return false;
      to += got;
      size -= static_cast<std::size_t>(got);
    }
    return true;
  }
  void serve() {
    for (;;) {
      const int peer = ::accept(listener_.socket(), nullptr, nullptr);
      if (peer < 0) return;
      ++connections;
      for (int i = 0; i < packets_; ++i) {
        std::uint32_t length = 0;
        if (!read_all(peer, reinterpret_cast<char*>(&length), sizeof length) || length < 4) break;
        std::string packet(length - 4, '\0');
        if (!read_all(peer, packet.data(), packet.size())) break;
        try {
          take(PacketReader(std::move(packet)));
        } catch (const std::exception& problem) {
          error = problem.what();
        }
      }
      // With unread bytes the close is a reset.
      ::close(peer);
    }
  }
  void take(PacketReader packet) {
    const char type = packet.number<char>();
    packet.number<char>();  // focus
    name = packet.text();
    if (type == 4) {
      width = packet.number<std::int32_t>();
      height = packet.number<std::int32_t>();
      channels = channels_of(packet);
      rgb.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 3, -1.0F);
      ++created;
    } else if (type == 6) {
      if (channels_of(packet) != channels) throw std::runtime_error("other channels than at first");
      const int x = packet.number<std::int32_t>(), y = packet.number<std::int32_t>();
      const int w = packet.number<std::int32_t>(), h = packet.number<std::int32_t>();
      std::vector<std::int64_t> offsets(channels.size()), strides(channels.size());
      for (auto& value : offsets) value = packet.number<std::int64_t>();
      for (auto& value : strides) value = packet.number<std::int64_t>();
      if (x < 0 || y < 0 || x + w > width || y + h > height) throw std::runtime_error("outside of the image");
      std::vector<float> data(packet.left() / sizeof(float));
      for (float& value : data) value = packet.number<float>();
      for (int row = 0; row < h; ++row)
        for (int column = 0; column < w; ++column)
          for (std::size_t c = 0; c < 3; ++c)
            rgb[static_cast<std::size_t>((y + row) * width + x + column) * 3 + c] =
                data.at(static_cast<std::size_t>(offsets[c] + (row * w + column) * strides[c]));
      updated_rows += h;
    } else {
      throw std::runtime_error("a packet of type " + std::to_string(static_cast<int>(type)));
    }
  }
  // The first three are those of the image.
  static std::vector<std::string> channels_of(PacketReader& packet) {
    const auto count = packet.number<std::int32_t>();
    if (count < 3 || count > 100) throw std::runtime_error("not three channels or more");
    std::vector<std::string> names;
    for (std::int32_t c = 0; c < count; ++c) names.push_back(packet.text());
    for (std::size_t c = 0; c < 3; ++c)
      if (names[c] != std::string(1, "RGB"[c])) throw std::runtime_error("no channel " + names[c]);
    return names;
  }

  const int packets_;
  const Listener listener_;
  std::thread thread_;
};

class PreviewTest : public testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(folder_.path() / "scene.xml")
        << "<scene version='3.0.0'><integrator type='path'/><sensor type='perspective'><film type='hdrfilm'>"
           "<integer name='width' value='40'/><integer name='height' value='30'/></film></sensor>"
           "<emitter type='constant'/><shape type='sphere'><point name='center' x='0' y='0' "
           "z='4'/></shape></scene>";
  }
  std::string in_folder(const std::string& name) const { return (folder_.path() / name).string(); }
  Outcome render(const std::vector<std::string>& more) const {
    std::vector<std::string> arguments = {
        "render", in_folder("scene.xml"), "-o", in_folder("x.exr"), "--quiet", "--threads", "1"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_candela(arguments);
  }
  std::vector<float> pixels(const std::string& name) const { return image::read_image(in_folder(name))->rgb; }

  test::TemporaryFolder folder_;
};

// Claim: the viewer is told of the image once, by its scene's name, and its last pixels are those of the EXR,
// to the last bit.
TEST_F(PreviewTest, TevShowsThePicture) {
  FakeTev tev;
  const Outcome r = render({"--time", "1", "--tev", tev.address(), "--preview", "50ms"});
  tev.stop();
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(r.err, "");
  EXPECT_EQ(tev.error, "");
  EXPECT_EQ(tev.connections, 1);
  EXPECT_EQ(tev.created, 1);
  EXPECT_GE(tev.updated_rows, 30);
  EXPECT_EQ(tev.name, "candela " + folder_.path().filename().string());  // the name of its folder
  EXPECT_EQ(tev.width, 40);
  EXPECT_EQ(tev.height, 30);
  EXPECT_EQ(tev.rgb, pixels("x.exr"));
  EXPECT_EQ(tev.channels, (std::vector<std::string>{"R", "G", "B"}));
}

// Claim: layers are channels of their own, by which tev shows them.
TEST_F(PreviewTest, TevShowsLayers) {
  FakeTev tev;
  const Outcome r = render({"--iterations", "8", "--tev", tev.address(), "--light-groups", "--aov", "depth"});
  tev.stop();
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(tev.error, "");
  EXPECT_EQ(tev.channels, (std::vector<std::string>{"R", "G", "B", "depth.Z", "light.constant.1.R",
                                                    "light.constant.1.G", "light.constant.1.B"}));
  EXPECT_EQ(tev.rgb, pixels("x.exr"));
}

// Claim: a viewer that is not there, or that goes away again and again, costs a warning and no pixel; an
// address that is none is told before anything is rendered.
TEST_F(PreviewTest, AViewerThatGoesAwayHarmsNothing) {
  const std::vector<std::string> job = {"--iterations", "8"};
  ASSERT_EQ(render(job).code, 0);
  const std::vector<float> alone = pixels("x.exr");
  std::string address;
  {
    FakeTev tev(1);
    address = tev.address();
    const Outcome r = render({"--iterations", "8", "--tev", address, "--preview", "20ms"});
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_EQ(pixels("x.exr"), alone);
  }
  const Outcome r = render({"--iterations", "8", "--tev", address});
  EXPECT_EQ(r.code, 0) << r.err;
  EXPECT_NE(r.err.find("candela: warning: the viewer tev at " + address + " cannot be reached: "),
            std::string::npos)
      << r.err;
  EXPECT_EQ(r.err.find("candela: warning:"), r.err.rfind("candela: warning:")) << "said once";
  EXPECT_EQ(pixels("x.exr"), alone);
  fs::remove(in_folder("x.exr"));
  const Outcome bad = render({"--iterations", "8", "--tev", "nowhere"});
  EXPECT_EQ(bad.code, 2);
  EXPECT_TRUE(bad.err.starts_with("candela: error: --tev: ")) << bad.err;
  EXPECT_FALSE(fs::exists(in_folder("x.exr")));
  EXPECT_EQ(render({"--iterations", "8", "--preview", "1s"}).code, 2) << "nothing to preview";
}

// Claim: a picture that took long because others had the processors is followed by the next after as long,
// not after minutes; one that costs much work comes more rarely; cheap ones come at the interval.
TEST(PreviewPause, IsOfWorkAndNotOfWaiting) {
  EXPECT_EQ(preview_pause(2, 0.01, 0.02), 2);
  EXPECT_EQ(preview_pause(2, 0.03, 7), 7);
  EXPECT_GE(preview_pause(2, 1, 1), 9 * 1);
  EXPECT_EQ(preview_pause(60, 0.01, 7), 60);
}

// Claim: a page on a port that is taken ends the render before it begins, and the next one begins as if there
// had been none.
TEST_F(PreviewTest, APageOnABusyPortLeavesNothing) {
  const Listener listener;
  const Outcome first = render({"--iterations", "2", "--page", listener.address()});
  EXPECT_EQ(first.code, 2) << first.err;
  EXPECT_NE(first.err.find("--page"), std::string::npos) << first.err;
  EXPECT_FALSE(fs::exists(in_folder("x.exr.candela")));
  const Outcome second = render({"--iterations", "2"});
  EXPECT_EQ(second.code, 0) << second.err;
}

// Claim: a viewer that takes nothing is given up soon, however large the picture.
TEST(TevViewerTest, OneThatTakesNothingIsGivenUp) {
  const Listener listener;
  auto tev = TevViewer::create(listener.address(), "x", 100);
  ASSERT_TRUE(tev.ok());
  const std::vector<float> large(std::size_t{3000} * 2000 * 3, 1.0F);
  const auto begin = std::chrono::steady_clock::now();
  const std::vector<std::string> channels = {"R", "G", "B"};
  const auto shown = tev->show({3000, 2000, channels, large});
  ASSERT_FALSE(shown.ok());
  EXPECT_EQ(shown.error().kind, ErrorKind::unreachable);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(30));
}

// Claim: the PNG is there before the render ends, and another one at the end; every time that somebody reads
// the file it is whole. (A machine may be so slow that the first unit takes all of the first time.)
TEST_F(PreviewTest, ThePngIsRewritten) {
  const auto read = [&] {
    std::ifstream file(in_folder("x.png"), std::ios::binary);
    std::stringstream bytes;
    bytes << file.rdbuf();
    return bytes.str();
  };
  int pictures = 0;
  for (const char* seconds : {"2", "8", "30"}) {
    fs::remove(in_folder("x.png"));
    pictures = 0;
    std::atomic<bool> ended{false};
    int damaged = 0;
    std::thread reader([&] {
      std::string last;
      while (!ended) {
        const std::string now = read();
        if (!now.empty() && now != last) {
          ++pictures;
          damaged += now.size() < 12 || now.substr(now.size() - 8, 4) != "IEND" ? 1 : 0;
          last = now;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
      }
    });
    const Outcome r = render({"--time", seconds, "--png", in_folder("x.png"), "--preview", "50ms"});
    ended = true;
    reader.join();
    ASSERT_EQ(r.code, 0) << r.err;
    ASSERT_EQ(damaged, 0);
    ASSERT_EQ(read(), *image::encode_png(*image::read_image(in_folder("x.exr"))));
    if (pictures >= 2) break;
  }
  EXPECT_GE(pictures, 2);
}

}  // namespace
}  // namespace candela::client
