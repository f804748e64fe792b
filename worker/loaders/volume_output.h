// Volumes as files: Mitsuba's .vol, and OpenVDB's, whether or not Candela was built with OpenVDB.
#pragma once

#include <string>

#include "common/base/result.h"
#include "worker/loaders/volume.h"

namespace candela::loaders {

// A .vol file of float32 values, as load_volume() reads it.
std::string encode_volume(const VolumeData& volume);

// Fails (usage) if vdb_output() cannot work here.
Result<void> check_vdb_output();
// As encode_vdb() of vdb/volume_vdb.h.
Result<std::string> vdb_output(const VolumeData& volume);

}  // namespace candela::loaders
