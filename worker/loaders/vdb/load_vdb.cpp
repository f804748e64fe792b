// Loads the module of OpenVDB's files.
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

}  // namespace candela::loaders
