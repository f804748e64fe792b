// Embree 3: one static scene, all triangles in one geometry, and one user geometry, in double, for each kind
// of the others.
//
// Build quality is medium: Embree's tree is then the same whatever the number of threads; that of high
// quality is not (RenderKit/embree issue 20).
#include "worker/scene/accel.h"

#include <embree3/rtcore.h>

#include <cmath>
#include <limits>
#include <utility>

namespace candela::scene {
namespace {

struct DeviceRelease {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneRelease {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using Device = std::unique_ptr<RTCDeviceTy, DeviceRelease>;
using EmbreeScene = std::unique_ptr<RTCSceneTy, SceneRelease>;

struct FirstError {
  RTCError code = RTC_ERROR_NONE;
  std::string text;
};

void remember_error(void* user, RTCError code, const char* text) {
  auto* first = static_cast<FirstError*>(user);
  if (first->code == RTC_ERROR_NONE) {
    first->code = code;
    first->text = text != nullptr ? text : "";
  }
}

const char* name(RTCError code) {
  switch (code) {
    case RTC_ERROR_NONE:
      return "no error";
    case RTC_ERROR_INVALID_ARGUMENT:
      return "invalid argument";
    case RTC_ERROR_INVALID_OPERATION:
      return "invalid operation";
    case RTC_ERROR_OUT_OF_MEMORY:
      return "out of memory";
    case RTC_ERROR_UNSUPPORTED_CPU:
      return "unsupported CPU";
    case RTC_ERROR_CANCELLED:
      return "cancelled";
    case RTC_ERROR_UNKNOWN:
      break;
  }
  return "unknown error";
}

Error embree_error(const FirstError& first, const char* doing) {
  const std::string message = std::string("Embree failed at ") + doing + ": " + name(first.code) +
                              (first.text.empty() ? "" : ", " + first.text);
  return first.code == RTC_ERROR_OUT_OF_MEMORY ? resource_error(message) : failed_error(message);
}

// Embree takes an unknown or unsupported `isa` without a word and uses another, so that both are checked
// here.
Result<void> check_isa(const std::string& isa) {
  bool here = false;
  if (isa == "sse2") {
    here = true;
  } else if (isa == "sse4.2") {
    here = __builtin_cpu_supports("sse4.2");
  } else if (isa == "avx") {
    here = __builtin_cpu_supports("avx");
  } else if (isa == "avx2") {
    here = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && __builtin_cpu_supports("bmi2");
  } else if (isa == "avx512") {
    here = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512bw") &&
           __builtin_cpu_supports("avx512vl");
  } else {
    return usage_error("unknown instruction set '" + isa + "' (sse2, sse4.2, avx, avx2, avx512)")
        .with_field("isa");
  }
  if (!here) {
    return usage_error("this machine has no " + isa + ", which the job asks for")
        .with_field("isa")
        .with_mend("submit with an instruction set that all workers have");
  }
  return {};
}

// What Embree says it will use agrees with what was asked for.
bool device_has_isa(RTCDevice device, const std::string& isa) {
  const bool width8 = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) != 0;
  const bool width16 = rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED) != 0;
  if (isa == "avx512") return width16;
  if (isa == "avx" || isa == "avx2") return width8 && !width16;
  return !width8 && !width16;
}

float round_down(double v) {
  const auto f = static_cast<float>(v);
  return static_cast<double>(f) > v ? std::nextafter(f, -std::numeric_limits<float>::infinity()) : f;
}
float round_up(double v) {
  const auto f = static_cast<float>(v);
  return static_cast<double>(f) < v ? std::nextafter(f, std::numeric_limits<float>::infinity()) : f;
}

// Callbacks of the user geometries, whose user data is the array of records.
template <class Record, auto kPrimitive>
struct Callbacks {
  static const auto& primitive(const void* user, unsigned index) {
    return static_cast<const Record*>(user)[index].*kPrimitive;
  }

  static void bounds(const RTCBoundsFunctionArguments* args) {
    const Bounds box = bounds_of(primitive(args->geometryUserPtr, args->primID));
    RTCBounds& b = *args->bounds_o;
    b.lower_x = round_down(box.low.x);
    b.lower_y = round_down(box.low.y);
    b.lower_z = round_down(box.low.z);
    b.upper_x = round_up(box.high.x);
    b.upper_y = round_up(box.high.y);
    b.upper_z = round_up(box.high.z);
  }

  static bool met(const void* user, unsigned index, const RTCRay& ray, double& t) {
    return meet(
        primitive(user, index),
        Vec3d(static_cast<double>(ray.org_x), static_cast<double>(ray.org_y), static_cast<double>(ray.org_z)),
        Vec3d(static_cast<double>(ray.dir_x), static_cast<double>(ray.dir_y), static_cast<double>(ray.dir_z)),
        static_cast<double>(ray.tnear), static_cast<double>(ray.tfar), t);
  }

  // Only single rays are traced, so that N is 1 in both.
  static void intersect(const RTCIntersectFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    auto* ray_hit = reinterpret_cast<RTCRayHit*>(args->rayhit);
    double t = 0;
    if (!met(args->geometryUserPtr, args->primID, ray_hit->ray, t)) return;
    ray_hit->ray.tfar = static_cast<float>(t);
    ray_hit->hit.geomID = args->geomID;
    ray_hit->hit.primID = args->primID;
  }

  static void occluded(const RTCOccludedFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    auto* ray = reinterpret_cast<RTCRay*>(args->ray);
    double t = 0;
    if (met(args->geometryUserPtr, args->primID, *ray, t)) {
      ray->tfar = -std::numeric_limits<float>::infinity();
    }
  }

  static void attach(RTCDevice device, RTCScene scene, const std::vector<Record>& records,
                     PrimitiveKind kind) {
    if (records.empty()) return;
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(records.size()));
    // Embree's pointer is not const; the callbacks only read.
    rtcSetGeometryUserData(geometry, const_cast<Record*>(records.data()));
    rtcSetGeometryBoundsFunction(geometry, bounds, nullptr);
    rtcSetGeometryIntersectFunction(geometry, intersect);
    rtcSetGeometryOccludedFunction(geometry, occluded);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, static_cast<unsigned>(kind));
    rtcReleaseGeometry(geometry);
  }
};

void attach_triangles(RTCDevice device, RTCScene scene, const Geometry& geometry) {
  if (geometry.triangles.empty()) return;
  RTCGeometry triangles = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(triangles, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                             geometry.positions.data(), 0, sizeof(Vec3), geometry.positions.size() - 1);
  rtcSetSharedGeometryBuffer(triangles, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, geometry.indices.data(),
                             0, sizeof(geometry.indices[0]), geometry.indices.size());
  rtcCommitGeometry(triangles);
  rtcAttachGeometryByID(scene, triangles, static_cast<unsigned>(PrimitiveKind::triangle));
  rtcReleaseGeometry(triangles);
}

void set_ray(const Ray& ray, RTCRay& out) {
  out.org_x = ray.origin.x;
  out.org_y = ray.origin.y;
  out.org_z = ray.origin.z;
  out.tnear = 0;
  out.dir_x = ray.direction.x;
  out.dir_y = ray.direction.y;
  out.dir_z = ray.direction.z;
  out.time = 0;
  out.tfar = ray.t_max;
  out.mask = 0xffffffffu;
  out.id = 0;
  out.flags = 0;
}

}  // namespace

struct Accel::Impl {
  Device device;
  EmbreeScene scene;  // released before the device
};

Accel::Accel(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Accel::Accel(Accel&&) noexcept = default;
Accel& Accel::operator=(Accel&&) noexcept = default;
Accel::~Accel() = default;

Result<Accel> Accel::build(const Geometry& geometry, const std::string& isa, unsigned threads) {
  CANDELA_TRY(check_isa(isa));
  const std::string config =
      "isa=" + isa + ",threads=" + std::to_string(std::max(1u, threads)) + ",verbose=0";
  auto impl = std::make_unique<Impl>();
  FirstError first;
  impl->device.reset(rtcNewDevice(config.c_str()));
  if (!impl->device) {
    first.code = rtcGetDeviceError(nullptr);
    return embree_error(first, "starting");
  }
  RTCDevice device = impl->device.get();
  if (!device_has_isa(device, isa)) {
    return failed_error("this Embree was built without " + isa + ", which the job asks for")
        .with_field("isa");
  }
  rtcSetDeviceErrorFunction(device, remember_error, &first);
  impl->scene.reset(rtcNewScene(device));
  RTCScene scene = impl->scene.get();
  if (scene != nullptr) {
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
    rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    attach_triangles(device, scene, geometry);
    Callbacks<SphereRecord, &SphereRecord::sphere>::attach(device, scene, geometry.spheres,
                                                           PrimitiveKind::sphere);
    Callbacks<DiskRecord, &DiskRecord::disk>::attach(device, scene, geometry.disks, PrimitiveKind::disk);
    Callbacks<CylinderRecord, &CylinderRecord::cylinder>::attach(device, scene, geometry.cylinders,
                                                                 PrimitiveKind::cylinder);
    rtcCommitScene(scene);
  }
  rtcSetDeviceErrorFunction(device, nullptr, nullptr);
  if (first.code != RTC_ERROR_NONE || scene == nullptr) return embree_error(first, "building the scene");
  return Accel(std::move(impl));
}

bool Accel::intersect(const Ray& ray, Found& found) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query;
  set_ray(ray, query.ray);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->scene.get(), &context, &query);
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
  found = {query.hit.primID, static_cast<PrimitiveKind>(query.hit.geomID)};
  return true;
}

void* Accel::embree_scene() const {
  return impl_->scene.get();
}

bool Accel::occluded(const Ray& ray) const {
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRay query;
  set_ray(ray, query);
  rtcOccluded1(impl_->scene.get(), &context, &query);
  return query.tfar < 0;
}

}  // namespace candela::scene
