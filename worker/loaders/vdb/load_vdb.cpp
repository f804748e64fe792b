// Loads the module of OpenVDB's files.
#include "common/base/hash.h"
#include "common/base/module.h"
#include "common/base/work_monitor.h"
#include "worker/loaders/vdb/volume_vdb.h"

namespace candela::loaders {

Result<VolumeData> load_vdb(std::string_view bytes, const std::string& name, const VdbChoice& choice) {
  static const Result<void*> function = load_from_module("vdb", "candela_load_vdb_1");
  if (!function.ok()) return Error(function.error()).at(name, 0);
  Result<VolumeData> volume = VolumeData{};
  VdbChoice watched = choice;
  watched.step = static_cast<void (*)()>(&work_step);
  work_step();
  reinterpret_cast<decltype(&candela_load_vdb_1)> (*function)(bytes, name, watched, volume);
  return volume;
}

Result<std::string> encode_vdb(const VolumeData& volume) {
  static const Result<void*> function = load_from_module("vdb", "candela_save_vdb_1");
  if (!function.ok()) return Error(function.error());
  Result<std::string> bytes = std::string();
  reinterpret_cast<decltype(&candela_save_vdb_1)> (*function)(volume, bytes);
  if (!bytes.ok()) return bytes;
  // OpenVDB draws the file's identifier at random.
  constexpr std::size_t at = 21, size = 36;  // in the header
  bytes->replace(at, size, size, '0');
  std::string identifier = sha256_hex(*bytes).substr(0, size);
  for (const std::size_t dash : {8u, 13u, 18u, 23u}) identifier[dash] = '-';
  bytes->replace(at, size, identifier);
  return bytes;
}

}  // namespace candela::loaders
