#include "common/base/version.h"

#include "common/base/version_generated.h"

namespace candela {

std::string_view version() {
  return CANDELA_VERSION;
}
std::string_view build_id() {
  return CANDELA_BUILD_ID;
}

const char* missing_cpu_feature() {
#ifdef __AVX2__
  if (!__builtin_cpu_supports("avx2")) return "avx2";
#endif
#ifdef __FMA__
  if (!__builtin_cpu_supports("fma")) return "fma";
#endif
#ifdef __AVX512F__
  if (!__builtin_cpu_supports("avx512f")) return "avx512f";
#endif
#ifdef __SSE4_2__
  if (!__builtin_cpu_supports("sse4.2")) return "sse4.2";
#endif
  return nullptr;
}

}  // namespace candela
