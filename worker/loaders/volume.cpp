// Mitsuba's .vol: "VOL", version, then little-endian 32-bit: encoding, three sizes, channels, six floats of
// the bounding box; then the values.
#include "worker/loaders/volume.h"

#include <bit>
#include <cmath>
#include <cstring>

#include "common/base/work_monitor.h"

namespace candela::loaders {
namespace {

static_assert(std::endian::native == std::endian::little, "the format is little-endian and read as it lies");

constexpr std::size_t kHeaderBytes = 48;
constexpr std::int32_t kFloat32 = 1, kFloat16 = 2, kUint8 = 3, kDirections = 4;
constexpr std::int64_t kMaxCells = std::int64_t{1} << 32;  // keeps products of sizes within 64 bits

template <class T>
T read_at(std::string_view bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof value);
  return value;
}

// IEEE 754 binary16, exactly.
float from_half(std::uint16_t h) {
  const std::uint32_t sign = (h & 0x8000u) << 16, exponent = (h >> 10) & 0x1fu, mantissa = h & 0x3ffu;
  if (exponent == 0) {
    const float magnitude = static_cast<float>(mantissa) * 0x1p-24f;
    return sign != 0 ? -magnitude : magnitude;
  }
  const std::uint32_t bits =
      exponent == 31 ? 0x7f800000u | (mantissa << 13) : ((exponent + 112) << 23) | (mantissa << 13);
  return std::bit_cast<float>(sign | bits);
}

float value_at(std::string_view data, std::int32_t encoding, std::size_t i) {
  if (encoding == kFloat32) return read_at<float>(data, 4 * i);
  if (encoding == kFloat16) return from_half(read_at<std::uint16_t>(data, 2 * i));
  return static_cast<float>(static_cast<unsigned char>(data[i])) / 255.0f;
}

}  // namespace

Result<VolumeData> load_volume(std::string_view bytes, const std::string& name, bool keeps_negative) {
  const auto fail = [&](std::string message) { return input_error(std::move(message)).at(name, 0); };
  if (bytes.size() < kHeaderBytes || bytes.substr(0, 3) != "VOL")
    return fail("not a volume file (it does not start with VOL and a header of 48 bytes)");
  const auto version = static_cast<unsigned char>(bytes[3]);
  if (version != 3)
    return fail("volume format version " + std::to_string(version) + " is not supported (3 is)");
  const auto encoding = read_at<std::int32_t>(bytes, 4);
  if (encoding == kDirections) return fail("volumes of directions are not supported");
  if (encoding < kFloat32 || encoding > kUint8)
    return fail("volume encoding " + std::to_string(encoding) +
                " is unknown (there is 1: float32, 2: float16, 3: uint8)");

  VolumeData volume;
  std::uint64_t cells = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto size = read_at<std::int32_t>(bytes, 8 + 4 * axis);
    if (size < 1) return fail("the volume has " + std::to_string(size) + " cells along one axis");
    volume.size[axis] = static_cast<std::uint32_t>(size);
    cells *= static_cast<std::uint64_t>(size);
    if (cells > static_cast<std::uint64_t>(kMaxCells)) return fail("the volume has more than 2^32 cells");
  }
  const auto channels = read_at<std::int32_t>(bytes, 20);
  if (channels != 1 && channels != 3)
    return fail("volumes of " + std::to_string(channels) + " channels are not supported (1 and 3 are)");
  volume.channels = static_cast<std::uint32_t>(channels);
  volume.low = {read_at<float>(bytes, 24), read_at<float>(bytes, 28), read_at<float>(bytes, 32)};
  volume.high = {read_at<float>(bytes, 36), read_at<float>(bytes, 40), read_at<float>(bytes, 44)};

  const std::uint64_t count = cells * volume.channels;
  const std::uint64_t value_bytes = encoding == kFloat32 ? 4 : encoding == kFloat16 ? 2 : 1;
  const std::string_view data = bytes.substr(kHeaderBytes);
  if (count * value_bytes > data.size()) {
    return fail("the volume claims " + std::to_string(count) + " values, but the file holds " +
                std::to_string(data.size() / value_bytes));
  }
  volume.values.resize(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < volume.values.size(); ++i) {
    work_step(i);
    const float value = value_at(data, encoding, i);
    if (!std::isfinite(value)) return fail("value " + std::to_string(i) + " of the volume is not finite");
    if (value < 0) ++volume.negative_count;
    volume.values[i] = value < 0 && !keeps_negative ? 0.0f : value;
  }
  return volume;
}

}  // namespace candela::loaders
