// Embree 3: one static scene, all triangles in one geometry, and one user geometry, in double, for each kind
// of the others. Of small scenes rays meet the primitives without it (few_primitives.h). A shapegroup is a
// scene of the same kind. All instances together are one more user geometry, whose callback takes the ray
// into the group by our own arithmetic (in double, rounded once) and traces it there: error bounds follow
// from that, where Embree's own instances invert and apply the matrix in float; and an instance costs no
// geometry object.
//
// Build quality is medium: Embree's tree is then the same whatever the number of threads; that of high
// quality is not (RenderKit/embree issue 20). Surfaces that lie in one plane: see ties.h.
#include "worker/scene/accel.h"

#include <embree3/rtcore.h>

#include <atomic>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <limits>
#include <utility>

#include "common/base/work_monitor.h"
#include "worker/scene/clearance.h"
#include "worker/scene/few_primitives.h"
#include "worker/scene/ties.h"

namespace candela::scene {
namespace {

static_assert(RTC_INVALID_GEOMETRY_ID == kNone);

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

// Embree asks this before it takes memory, from several threads.
struct Memory {
  description::ReadingBudget& budget;
  std::atomic<std::uint64_t> refused = 0;  // bytes

  static bool ask(void* user, ssize_t bytes, bool /*post*/) {
    auto* memory = static_cast<Memory*>(user);
    if (bytes <= 0) {
      memory->budget.give_back(static_cast<std::uint64_t>(-bytes));
      return true;
    }
    if (memory->budget.take(static_cast<std::uint64_t>(bytes))) return true;
    memory->refused = static_cast<std::uint64_t>(bytes);
    return false;
  }
};

Error embree_error(const FirstError& first, const char* doing) {
  const std::string message = std::string("Embree failed at ") + doing + ": " + name(first.code) +
                              (first.text.empty() ? "" : ", " + first.text);
  return first.code == RTC_ERROR_OUT_OF_MEMORY ? resource_error(message) : failed_error(message);
}

// True if Embree says that it uses the ISA that was asked for.
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
    ray_hit->hit.instID[0] = args->context->instID[0];
  }

  static void occluded(const RTCOccludedFunctionNArguments* args) {
    if (args->valid[0] == 0) return;
    auto* ray = reinterpret_cast<RTCRay*>(args->ray);
    double t = 0;
    if (met(args->geometryUserPtr, args->primID, *ray, t)) {
      ray->tfar = -std::numeric_limits<float>::infinity();
    }
  }

  static void attach(RTCDevice device, RTCScene scene, const std::vector<Record>& records, const Group& group,
                     PrimitiveKind kind) {
    const Group::Range range = group.primitives[static_cast<std::size_t>(kind)];
    if (range.count == 0) return;
    RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, range.count);
    // Embree's pointer is not const; the callbacks only read.
    rtcSetGeometryUserData(geometry, const_cast<Record*>(records.data() + range.first));
    rtcSetGeometryBoundsFunction(geometry, bounds, nullptr);
    rtcSetGeometryIntersectFunction(geometry, intersect);
    rtcSetGeometryOccludedFunction(geometry, occluded);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, static_cast<unsigned>(kind));
    rtcReleaseGeometry(geometry);
  }
};

void attach_triangles(RTCDevice device, RTCScene scene, const Geometry& geometry, const Group& group) {
  const Group::Range range = group.primitives[static_cast<std::size_t>(PrimitiveKind::triangle)];
  if (range.count == 0) return;
  RTCGeometry triangles = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(triangles, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                             geometry.positions.data(), 0, sizeof(Vec3), geometry.positions.size() - 1);
  rtcSetSharedGeometryBuffer(triangles, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                             geometry.indices.data() + range.first, 0, sizeof(geometry.indices[0]),
                             range.count);
  rtcCommitGeometry(triangles);
  rtcAttachGeometryByID(scene, triangles, static_cast<unsigned>(PrimitiveKind::triangle));
  rtcReleaseGeometry(triangles);
}

void attach_group(RTCDevice device, RTCScene scene, const Geometry& geometry, const Group& group,
                  bool round) {
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  attach_triangles(device, scene, geometry, group);
  if (!round) return;
  Callbacks<SphereRecord, &SphereRecord::sphere>::attach(device, scene, geometry.spheres, group,
                                                         PrimitiveKind::sphere);
  Callbacks<DiskRecord, &DiskRecord::disk>::attach(device, scene, geometry.disks, group, PrimitiveKind::disk);
  Callbacks<CylinderRecord, &CylinderRecord::cylinder>::attach(device, scene, geometry.cylinders, group,
                                                               PrimitiveKind::cylinder);
}

Ray ray_of(const RTCRay& ray) {
  return {{ray.org_x, ray.org_y, ray.org_z}, {ray.dir_x, ray.dir_y, ray.dir_z}, ray.tfar};
}

// Embree reads origin and direction as 16 bytes each. A processor cannot forward those from narrower stores:
// it would wait until they, and all stores before them, have left for the cache, so that no ray could be
// traced while the hit before it is still being computed. So they are written whole.
using Float4 = float __attribute__((vector_size(16)));

// False, and the ray meets nothing, where it is not finite or too far away. Embree's arithmetic ends
// at 1.8e18; builds of it that check what they are given end the program there. What may lie that far is a
// vertex in a medium without end, or the ray's origin as a tiny instance sees it.
[[nodiscard]] bool set_ray(const Ray& ray, RTCRay& out) {
  const Float4 origin = {ray.origin.x, ray.origin.y, ray.origin.z, 0};              // and tnear
  const Float4 direction = {ray.direction.x, ray.direction.y, ray.direction.z, 0};  // and time
  static_assert(offsetof(RTCRay, org_x) == 0 && offsetof(RTCRay, tnear) == 12 &&
                offsetof(RTCRay, dir_x) == 16 && offsetof(RTCRay, time) == 28 &&
                offsetof(RTCRay, tfar) == 32);
  // One comparison in place of six, as every ray pays for it. What is not a number is not below either.
  constexpr float kFarthest = 1.8e18f;
  const Float4 squares = origin * origin + direction * direction;
  if (!(squares[0] + squares[1] + squares[2] <= kFarthest * kFarthest)) [[unlikely]]
    return false;
  auto* bytes = reinterpret_cast<char*>(&out);
  std::memcpy(bytes, &origin, sizeof origin);
  std::memcpy(bytes + sizeof origin, &direction, sizeof direction);
  out.tfar = ray.t_max;
  out.mask = 0xffffffffu;
  out.id = 0;
  out.flags = 0;
  return true;
}

// The user data of the instances' geometry.
struct Instances {
  const Geometry* geometry = nullptr;
  std::vector<EmbreeScene> scenes;  // by group; the first, which is the scene itself, is null
};

constexpr unsigned kInstances = kPrimitiveKinds;  // the geometry's id, after those of the kinds

void instance_bounds(const RTCBoundsFunctionArguments* args) {
  const auto* user = static_cast<const Instances*>(args->geometryUserPtr);
  const Bounds& box = user->geometry->instances[args->primID].bounds;
  // The ray is rounded on its way into the group, by a part of the box's distance from it.
  const auto slack = [](double a, double b) { return 0x1p-20 * std::max(std::abs(a), std::abs(b)); };
  const Vec3d pad{slack(box.low.x, box.high.x), slack(box.low.y, box.high.y), slack(box.low.z, box.high.z)};
  RTCBounds& b = *args->bounds_o;
  b.lower_x = round_down(box.low.x - pad.x);
  b.lower_y = round_down(box.low.y - pad.y);
  b.lower_z = round_down(box.low.z - pad.z);
  b.upper_x = round_up(box.high.x + pad.x);
  b.upper_y = round_up(box.high.y + pad.y);
  b.upper_z = round_up(box.high.z + pad.z);
}

void instance_intersect(const RTCIntersectFunctionNArguments* args) {
  if (args->valid[0] == 0) return;
  const auto* user = static_cast<const Instances*>(args->geometryUserPtr);
  const Instance& instance = user->geometry->instances[args->primID];
  auto* found = reinterpret_cast<RTCRayHit*>(args->rayhit);
  const Ray ray = Geometry::to_group(instance, ray_of(found->ray));
  RTCRayHit query;
  if (!set_ray(ray, query.ray)) return;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  args->context->instID[0] = args->primID;
  rtcIntersect1(user->scenes[instance.group].get(), args->context, &query);
  args->context->instID[0] = RTC_INVALID_GEOMETRY_ID;
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return;
  found->ray.tfar = query.ray.tfar;
  found->hit = query.hit;
}

void instance_occluded(const RTCOccludedFunctionNArguments* args) {
  if (args->valid[0] == 0) return;
  const auto* user = static_cast<const Instances*>(args->geometryUserPtr);
  const Instance& instance = user->geometry->instances[args->primID];
  auto* ray = reinterpret_cast<RTCRay*>(args->ray);
  const Ray inside = Geometry::to_group(instance, ray_of(*ray));
  RTCRay query;
  if (!set_ray(inside, query)) return;
  args->context->instID[0] = args->primID;
  rtcOccluded1(user->scenes[instance.group].get(), args->context, &query);
  args->context->instID[0] = RTC_INVALID_GEOMETRY_ID;
  if (query.tfar < 0) ray->tfar = query.tfar;
}

// Builds the tree. Embree asks the monitor of the calling thread, from any of its own, whether to go on.
void commit(RTCScene scene) {
  const auto goes_on = [](void* user, double /*fraction*/) {
    auto* monitor = static_cast<WorkMonitor*>(user);
    monitor->steps.fetch_add(1, std::memory_order_relaxed);
    return !monitor->stop.load(std::memory_order_relaxed);
  };
  if (WorkMonitor* monitor = watched_work()) rtcSetSceneProgressMonitorFunction(scene, goes_on, monitor);
  rtcCommitScene(scene);
  rtcSetSceneProgressMonitorFunction(scene, nullptr, nullptr);
  work_step();
}

void attach_instances(RTCDevice device, RTCScene scene, const Geometry& geometry, Instances& instances) {
  if (geometry.instances.empty()) return;
  instances.geometry = &geometry;
  instances.scenes.resize(geometry.groups.size());
  for (std::size_t i = 1; i < geometry.groups.size(); ++i) {
    instances.scenes[i].reset(rtcNewScene(device));
    if (!instances.scenes[i]) return;  // the device has heard of it
    attach_group(device, instances.scenes[i].get(), geometry, geometry.groups[i], true);
    commit(instances.scenes[i].get());
  }
  RTCGeometry all = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
  rtcSetGeometryUserPrimitiveCount(all, static_cast<unsigned>(geometry.instances.size()));
  rtcSetGeometryUserData(all, &instances);
  rtcSetGeometryBoundsFunction(all, instance_bounds, nullptr);
  rtcSetGeometryIntersectFunction(all, instance_intersect);
  rtcSetGeometryOccludedFunction(all, instance_occluded);
  rtcCommitGeometry(all);
  rtcAttachGeometryByID(scene, all, kInstances);
  rtcReleaseGeometry(all);
}

}  // namespace

// Scenes are released before the device.
struct Accel::Impl {
  Device device;
  const Geometry* geometry = nullptr;
  Instances instances;
  EmbreeScene scene;
  std::unique_ptr<Ties> ties;
  std::unique_ptr<FewPrimitives> few;  // null: the tree has all
};

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

Accel::Accel(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Accel::Accel(Accel&&) noexcept = default;
Accel& Accel::operator=(Accel&&) noexcept = default;
Accel::~Accel() = default;

Result<Accel> Accel::build(const Geometry& geometry, const std::string& isa, unsigned threads,
                           description::ReadingBudget& budget) {
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
  Memory memory{budget};
  rtcSetDeviceErrorFunction(device, remember_error, &first);
  rtcSetDeviceMemoryMonitorFunction(device, Memory::ask, &memory);
  impl->geometry = &geometry;
  impl->few = FewPrimitives::build(geometry);
  const bool has_tree = impl->few == nullptr || !impl->few->whole();
  if (has_tree) impl->scene.reset(rtcNewScene(device));
  if (RTCScene scene = impl->scene.get(); scene != nullptr) {
    attach_group(device, scene, geometry, geometry.groups[0], impl->few == nullptr);
    attach_instances(device, scene, geometry, impl->instances);
    commit(scene);
  }
  if (!has_tree || impl->scene) impl->ties = Ties::build(device, geometry);
  rtcSetDeviceErrorFunction(device, nullptr, nullptr);
  rtcSetDeviceMemoryMonitorFunction(device, nullptr, nullptr);
  if (const std::uint64_t bytes = memory.refused; bytes > 0)
    return budget.refusal({}, "Embree's trees", bytes);
  if (first.code != RTC_ERROR_NONE || (has_tree && !impl->scene))
    return embree_error(first, "building the scene");
  return Accel(std::move(impl));
}

bool Accel::intersect(const Ray& ray, Found& found) const {
  RTCRayHit query;
  if (!set_ray(ray, query.ray)) return false;
  const FewPrimitives* const few = impl_->few.get();
  if (few != nullptr && few->whole()) return intersect_few(ray, found);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->scene.get(), &context, &query);
  if (few != nullptr && few->may_meet_round(ray, query.ray.tfar) &&
      intersect_few({ray.origin, ray.direction, query.ray.tfar}, found))
    return true;
  if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return false;
  found = {query.hit.primID, static_cast<PrimitiveKind>(query.hit.geomID), query.hit.instID[0]};
  if (found.instance != kNone) [[unlikely]] {
    const Geometry& geometry = *impl_->geometry;
    const Group& group = geometry.groups[geometry.instances[found.instance].group];
    found.primitive += group.primitives[query.hit.geomID].first;
  } else if (impl_->ties != nullptr) [[unlikely]] {
    impl_->ties->settle(ray, query.ray.tfar, found.kind, found.primitive);
  }
  return true;
}

bool Accel::intersect_few(const Ray& ray, Found& found) const {
  float distance = 0;
  if (!impl_->few->intersect(ray, distance, found.kind, found.primitive)) return false;
  found.instance = kNone;
  if (impl_->ties != nullptr) [[unlikely]]
    impl_->ties->settle(ray, distance, found.kind, found.primitive);
  return true;
}

float Accel::clearance(Vec3 p, float limit) const {
  if (impl_->few != nullptr) limit = impl_->few->clearance(p, limit);
  return impl_->scene ? tree_clearance(impl_->scene.get(), *impl_->geometry, p, limit) : limit;
}

void* Accel::embree_scene() const {
  return impl_->scene.get();
}

bool Accel::occluded(const Ray& ray) const {
  RTCRay query;
  if (!set_ray(ray, query)) return false;
  const FewPrimitives* const few = impl_->few.get();
  if (few != nullptr) {
    if (few->whole()) return few->occluded(ray);
    if (few->may_meet_round(ray, ray.t_max) && few->occluded(ray)) return true;
  }
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(impl_->scene.get(), &context, &query);
  return query.tfar < 0;
}

}  // namespace candela::scene
