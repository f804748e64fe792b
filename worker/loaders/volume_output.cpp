#include "worker/loaders/volume_output.h"

#include <cstdint>

#include "common/base/module.h"
#include "worker/loaders/vdb/volume_vdb.h"

namespace candela::loaders {

std::string encode_volume(const VolumeData& volume) {
  constexpr std::int32_t float32 = 1;
  constexpr std::size_t header_bytes = 48;
  std::string bytes = "VOL\x03";
  const auto put = [&](auto number) { bytes.append(reinterpret_cast<const char*>(&number), sizeof number); };
  bytes.reserve(header_bytes + sizeof(float) * volume.values.size());
  put(float32);
  for (const std::uint32_t size : volume.size) put(static_cast<std::int32_t>(size));
  put(static_cast<std::int32_t>(volume.channels));
  for (const Vec3 corner : {volume.low, volume.high})
    for (const float coordinate : {corner.x, corner.y, corner.z}) put(coordinate);
  bytes.append(reinterpret_cast<const char*>(volume.values.data()), sizeof(float) * volume.values.size());
  return bytes;
}

#ifdef CANDELA_OPENVDB

Result<void> check_vdb_output() {
  return check_module("vdb");
}
Result<std::string> vdb_output(const VolumeData& volume) {
  return encode_vdb(volume);
}

#else

Result<void> check_vdb_output() {
  return usage_error("this build of Candela does not write OpenVDB files")
      .with_mend("install libopenvdb-dev and build again, or write a .vol file");
}
Result<std::string> vdb_output(const VolumeData& /*volume*/) {
  return check_vdb_output().error();
}

#endif

}  // namespace candela::loaders
