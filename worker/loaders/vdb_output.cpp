#include "worker/loaders/vdb_output.h"

#include "common/base/module.h"
#include "worker/loaders/vdb/volume_vdb.h"

namespace candela::loaders {

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
