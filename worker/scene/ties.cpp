#include "worker/scene/ties.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "common/base/huge_page_advice.h"
#include "common/base/work_monitor.h"
#include "worker/scene/shapes/geometry_steps.h"

namespace candela::scene {
namespace {

// A flat primitive with its plane: normal (one of the two, by rule) and distance of the plane from the
// origin. Small, since a scene may have millions; all else of the primitive is in the geometry.
struct Flat {
  std::uint64_t normal;  // rounded
  double distance;
  std::uint32_t shape;
  std::uint32_t primitive;  // in Geometry's array of the shape's kind
};

// Returns +n or -n: the one whose first large component is positive.
Vec3d without_sign(Vec3d n) {
  for (const double c : {n.x, n.y, n.z})
    if (std::abs(c) > 0.5) return c < 0 ? n * -1.0 : n;
  return n;
}

std::uint64_t rounded(Vec3d n) {
  const auto cell = [](double c) { return static_cast<std::uint64_t>(std::lround(c * 1024) + 1024); };
  return cell(n.x) << 32 | cell(n.y) << 16 | cell(n.z);
}

double largest_coordinate(const Bounds& b) {
  return std::max({std::abs(b.low.x), std::abs(b.low.y), std::abs(b.low.z), std::abs(b.high.x),
                   std::abs(b.high.y), std::abs(b.high.z)});
}

PrimitiveKind kind_of(const Geometry& geometry, std::uint32_t shape) {
  return geometry.shapes[shape].disk == kNone ? PrimitiveKind::triangle : PrimitiveKind::disk;
}

Bounds box_of(const Geometry& geometry, const Flat& flat) {
  if (kind_of(geometry, flat.shape) == PrimitiveKind::disk)
    return bounds_of(geometry.disks[flat.primitive].disk);
  Bounds box;
  for (const Vec3& corner : corners_of(geometry, flat.primitive)) box.add(Vec3d(corner));
  return box;
}

Group::Range range_of(const Geometry& geometry, PrimitiveKind kind) {
  return geometry.groups[0].primitives[static_cast<std::size_t>(kind)];
}

// True if at least two shapes of the scene itself have flat primitives and are looked at.
bool several_shapes(const Geometry& geometry, const std::vector<bool>* looked_at) {
  const auto inside = [](const Group::Range& range, std::uint32_t i) {
    return i >= range.first && i - range.first < range.count;
  };
  int count = 0;
  for (std::uint32_t i = 0; i < geometry.shapes.size() && count < 2; ++i) {
    const ShapeRecord& shape = geometry.shapes[i];
    if (looked_at != nullptr && !(*looked_at)[i]) continue;
    const bool flat = shape.disk != kNone
                          ? inside(range_of(geometry, PrimitiveKind::disk), shape.disk)
                          : shape.triangle_count > 0 &&
                                inside(range_of(geometry, PrimitiveKind::triangle), shape.first_triangle);
    count += flat ? 1 : 0;
  }
  return count >= 2;
}

// skip(number): of a flat in the order of visits; true: it is not visited.
template <class Skip, class Visit>
void for_each_flat(const Geometry& geometry, const std::vector<bool>* looked_at, const Skip& skip,
                   const Visit& visit) {
  std::size_t number = 0;
  const auto add = [&](std::uint32_t shape, std::uint32_t primitive, Vec3d normal, Vec3d point) {
    if (looked_at != nullptr && !(*looked_at)[shape]) return;
    const double l = length(normal);
    if (!(l > 0) || !std::isfinite(l)) return;
    const Vec3d n = without_sign(normal / l);
    visit(number, Flat{rounded(n), dot(n, point), shape, primitive});
  };
  const Group::Range triangles = range_of(geometry, PrimitiveKind::triangle);
  std::uint32_t shape = 0;
  for (std::uint32_t i = triangles.first; i < triangles.first + triangles.count; ++i, ++number) {
    if (skip(number)) continue;
    while (i - geometry.shapes[shape].first_triangle >= geometry.shapes[shape].triangle_count) ++shape;
    const auto [v0, v1, v2] = corners_of(geometry, i);
    const Vec3d a(v0);
    add(shape, i, cross(Vec3d(v1) - a, Vec3d(v2) - a), a);
  }
  const Group::Range disks = range_of(geometry, PrimitiveKind::disk);
  for (std::uint32_t i = disks.first; i < disks.first + disks.count; ++i, ++number) {
    if (skip(number)) continue;
    const DiskRecord& d = geometry.disks[i];
    add(d.shape, i, d.disk.axes[2], d.disk.center);
  }
}

// Flats that may lie in one plane with those of another shape. A first pass finds the normals (by their
// hash) that several shapes have, so that a mesh of millions beside few other shapes costs little memory, and
// computes each normal but once.
std::vector<Flat> flats_of(const Geometry& geometry, const std::vector<bool>* looked_at) {
  std::vector<Flat> flats;
  if (!several_shapes(geometry, looked_at)) return flats;
  constexpr std::size_t kSlots = std::size_t{1} << 16;
  constexpr std::uint32_t kSeveral = kNone - 1;
  const auto slot = [](std::uint64_t normal) {
    return static_cast<std::uint16_t>(normal * 0x9e3779b97f4a7c15u >> 48);
  };
  std::vector<std::uint32_t> shape_of(kSlots, kNone);
  std::vector<std::uint16_t> slots(std::size_t{range_of(geometry, PrimitiveKind::triangle).count} +
                                   range_of(geometry, PrimitiveKind::disk).count);
  for_each_flat(
      geometry, looked_at, [](std::size_t) { return false; },
      [&](std::size_t number, const Flat& flat) {
        slots[number] = slot(flat.normal);
        std::uint32_t& shape = shape_of[slots[number]];
        if (shape == kNone)
          shape = flat.shape;
        else if (shape != flat.shape)
          shape = kSeveral;
      });
  const auto alone = [&](std::size_t number) { return shape_of[slots[number]] != kSeveral; };
  std::size_t count = 0;
  for (std::size_t number = 0; number < slots.size(); ++number) count += alone(number) ? 0 : 1;
  reserve_huge(flats, count);
  for_each_flat(geometry, looked_at, alone, [&](std::size_t, const Flat& flat) { flats.push_back(flat); });
  return flats;
}

// Sorts by normal, distance, shape and primitive. The normals' first coordinates, of which there are few,
// divide the flats in place before the parts are sorted: with millions of flats that takes half the time.
void sort(std::vector<Flat>& flats) {
  constexpr std::size_t kCells = 2049;
  const auto cell = [](const Flat& flat) { return static_cast<std::size_t>(flat.normal >> 32); };
  std::vector<std::size_t> next(kCells + 1), end(kCells);
  for (const Flat& flat : flats) ++next[cell(flat) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  std::copy(next.begin() + 1, next.end(), end.begin());
  for (std::size_t c = 0; c < kCells; ++c)
    while (next[c] < end[c]) {
      Flat& flat = flats[next[c]];
      if (const std::size_t home = cell(flat); home == c)
        ++next[c];
      else
        std::swap(flat, flats[next[home]++]);
    }
  std::size_t begin = 0;
  for (const std::size_t stop : end) {
    work_step();
    const auto at = [&](std::size_t i) { return flats.begin() + static_cast<std::ptrdiff_t>(i); };
    std::sort(at(begin), at(stop), [](const Flat& a, const Flat& b) {
      return std::tie(a.normal, a.distance, a.shape, a.primitive) <
             std::tie(b.normal, b.distance, b.shape, b.primitive);
    });
    begin = stop;
  }
}

// True if boxes in one plane have more than an edge in common.
bool overlap_in_plane(const Bounds& a, const Bounds& b, double edge) {
  int wide = 0;
  for (double Vec3d::*axis : {&Vec3d::x, &Vec3d::y, &Vec3d::z}) {
    const double common = std::min(a.high.*axis, b.high.*axis) - std::max(a.low.*axis, b.low.*axis);
    if (common < -edge) return false;
    wide += common > edge ? 1 : 0;
  }
  return wide >= 2;
}

// One shape's part of a plane: flats [first, last), sorted by shape.
struct Part {
  std::size_t first, last;
  Bounds box;
  Place place;
  std::vector<const Part*> others;  // those whose boxes overlap this one's
};

Place place_in(const Bounds& box, double pad) {
  const auto below = [&](double v) { return std::nextafter(static_cast<float>(v - pad), -INFINITY); };
  const auto above = [&](double v) { return std::nextafter(static_cast<float>(v + pad), INFINITY); };
  Place place;
  place.low = {below(box.low.x), below(box.low.y), below(box.low.z)};
  place.high = {above(box.high.x), above(box.high.y), above(box.high.z)};
  return place;
}

// Corners of the triangles in [begin, end), three of each. Empty where there are many or disks are among
// them.
std::vector<Vec3d> few_corners(const Geometry& geometry, std::vector<Flat>::iterator begin,
                               std::vector<Flat>::iterator end) {
  constexpr std::ptrdiff_t kMax = 16;
  std::vector<Vec3d> corners;
  if (end - begin > kMax) return corners;
  for (auto i = begin; i != end; ++i) {
    if (kind_of(geometry, i->shape) != PrimitiveKind::triangle) return {};
    for (const Vec3& corner : corners_of(geometry, i->primitive)) corners.emplace_back(corner);
  }
  return corners;
}

// Adds the edges of triangles that have all corners on one side.
void add_outline(const std::vector<Vec3d>& corners, double pad, Place& place) {
  for (std::size_t i = 0; i < corners.size() && place.edge_count < Place::kMaxEdges; ++i) {
    const std::size_t t = i / 3 * 3;
    const Vec3d a = corners[i], b = corners[t + (i + 1) % 3], c = corners[t + (i + 2) % 3];
    const Vec3d along = b - a, inward = (c - a) - along * (dot(c - a, along) / length_squared(along));
    if (!(length(inward) > pad)) continue;  // a sliver tells no direction
    const Vec3d outward = inward / -length(inward);
    const double distance = dot(outward, a) + pad;
    if (std::all_of(corners.begin(), corners.end(),
                    [&](const Vec3d& corner) { return dot(outward, corner) <= distance; }))
      place.edges[place.edge_count++] = {Vec3(outward), static_cast<float>(distance + pad)};
  }
}

// Adds a place. If there are too many places, the last one holds all the rest.
void add_place(const Place& place, std::vector<Place>& places) {
  constexpr std::size_t kMax = 8;
  if (places.size() < kMax) {
    places.push_back(place);
    return;
  }
  Place& last = places.back();
  last.low = {std::min(last.low.x, place.low.x), std::min(last.low.y, place.low.y),
              std::min(last.low.z, place.low.z)};
  last.high = {std::max(last.high.x, place.high.x), std::max(last.high.y, place.high.y),
               std::max(last.high.z, place.high.z)};
  last.edge_count = 0;
}

// flats: in one plane, sorted by shape. Adds those that are contested.
void find_in_plane(const Geometry& geometry, std::vector<Flat>::iterator begin,
                   std::vector<Flat>::iterator end, double edge, std::uint32_t plane,
                   std::vector<Contested>& out) {
  if (std::all_of(begin, end, [&](const Flat& flat) { return flat.shape == begin->shape; })) return;
  std::vector<Bounds> boxes;
  for (auto i = begin; i != end; ++i) boxes.push_back(box_of(geometry, *i));
  std::vector<Part> parts;
  for (auto i = begin; i != end; ++i) {
    const auto at = static_cast<std::size_t>(i - begin);
    if (i == begin || i->shape != (i - 1)->shape) parts.push_back({at, at, {}, {}, {}});
    parts.back().last = at + 1;
    parts.back().box.add(boxes[at]);
  }
  std::sort(parts.begin(), parts.end(),
            [](const Part& a, const Part& b) { return a.box.low.x < b.box.low.x; });
  for (std::size_t i = 0; i < parts.size(); ++i) {
    work_step();
    for (std::size_t j = i + 1; j < parts.size() && parts[j].box.low.x <= parts[i].box.high.x + edge; ++j)
      if (overlap_in_plane(parts[i].box, parts[j].box, edge)) {
        parts[i].others.push_back(&parts[j]);
        parts[j].others.push_back(&parts[i]);
      }
  }
  const auto flat = [&](std::size_t i) { return begin + static_cast<std::ptrdiff_t>(i); };
  for (Part& part : parts) {
    const double pad = 64 * edge;
    part.place = place_in(part.box, pad);
    if (!part.others.empty())
      add_outline(few_corners(geometry, flat(part.first), flat(part.last)), pad, part.place);
  }
  for (const Part& part : parts)
    for (std::size_t k = part.first; k < part.last && !part.others.empty(); ++k) {
      work_step();
      Contested what{kind_of(geometry, flat(k)->shape), flat(k)->shape, flat(k)->primitive, plane, {}};
      for (const Part* other : part.others)
        if (overlap_in_plane(boxes[k], other->box, edge)) add_place(other->place, what.others);
      if (!what.others.empty()) out.push_back(std::move(what));
    }
}

}  // namespace

std::vector<Contested> find_contested(const Geometry& geometry, const std::vector<bool>* looked_at) {
  std::vector<Flat> flats = flats_of(geometry, looked_at);
  std::vector<Contested> out;
  sort(flats);
  // Bounds the rounding of coordinates and of Embree's distances.
  const double tolerance = 0x1p-20 * largest_coordinate(geometry.groups[0].bounds);
  std::uint32_t plane = 0;
  for (auto begin = flats.begin(); begin != flats.end();) {
    work_step(static_cast<std::size_t>(begin - flats.begin()));
    auto end = begin + 1;
    while (end != flats.end() && end->normal == begin->normal &&
           end->distance - (end - 1)->distance <= tolerance)
      ++end;
    if (end - begin > 1) {
      std::sort(begin, end, [](const Flat& a, const Flat& b) { return a.shape < b.shape; });
      find_in_plane(geometry, begin, end, tolerance, plane++, out);
    }
    begin = end;
  }
  std::sort(out.begin(), out.end(), [](const Contested& a, const Contested& b) {
    return std::tie(a.shape, a.kind, a.primitive) < std::tie(b.shape, b.kind, b.primitive);
  });
  return out;
}

namespace {

constexpr unsigned kTriangles = 0, kDisks = 1;  // Embree's geometries

// The part of one of them that Embree's callbacks see.
struct TieGeometry {
  const Geometry* geometry = nullptr;
  const std::vector<Contested>* contested = nullptr;
  std::vector<std::uint32_t> index;  // in contested, by primitive

  const Contested& at(unsigned primitive) const { return (*contested)[index[primitive]]; }
  const Disk& disk(unsigned primitive) const { return geometry->disks[at(primitive).primitive].disk; }
};

// Takes note of the first that is met in its plane, and of none as a hit, so that all are met.
struct TieQuery {
  RTCIntersectContext context;
  std::uint32_t plane, first;
};

void note(RTCIntersectContext* context, const TieGeometry& geometry, unsigned primitive) {
  auto* query = reinterpret_cast<TieQuery*>(context);
  if (geometry.at(primitive).plane == query->plane)
    query->first = std::min(query->first, geometry.index[primitive]);
}

void note_triangle(const RTCFilterFunctionNArguments* args) {
  if (args->valid[0] == 0) return;
  note(args->context, *static_cast<const TieGeometry*>(args->geometryUserPtr),
       RTCHitN_primID(args->hit, args->N, 0));
  args->valid[0] = 0;
}

void note_disk(const RTCIntersectFunctionNArguments* args) {
  if (args->valid[0] == 0) return;
  const auto& geometry = *static_cast<const TieGeometry*>(args->geometryUserPtr);
  const RTCRay& ray = reinterpret_cast<const RTCRayHit*>(args->rayhit)->ray;
  const auto vector = [](float x, float y, float z) {
    return Vec3d(static_cast<double>(x), static_cast<double>(y), static_cast<double>(z));
  };
  double t = 0;
  if (meet(geometry.disk(args->primID), vector(ray.org_x, ray.org_y, ray.org_z),
           vector(ray.dir_x, ray.dir_y, ray.dir_z), static_cast<double>(ray.tnear),
           static_cast<double>(ray.tfar), t))
    note(args->context, geometry, args->primID);
}

void disk_bounds(const RTCBoundsFunctionArguments* args) {
  const Bounds box = bounds_of(static_cast<const TieGeometry*>(args->geometryUserPtr)->disk(args->primID));
  const auto below = [](double v) { return std::nextafter(static_cast<float>(v), -INFINITY); };
  const auto above = [](double v) { return std::nextafter(static_cast<float>(v), INFINITY); };
  *args->bounds_o = {below(box.low.x),  below(box.low.y),  below(box.low.z),  0,
                     above(box.high.x), above(box.high.y), above(box.high.z), 0};
}

}  // namespace

// The contested primitives, as a scene of their own.
struct Ties::Scene {
  Scene() = default;
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;
  ~Scene() {
    if (scene != nullptr) rtcReleaseScene(scene);
  }

  TieGeometry triangles, disks;
  std::vector<std::array<std::uint32_t, 3>> corners;  // of the triangles, in Geometry::positions
  RTCScene scene = nullptr;
};

Ties::Ties() : scene_(std::make_unique<Scene>()) {}
Ties::~Ties() = default;

std::unique_ptr<Ties> Ties::build(RTCDevice device, const Geometry& geometry) {
  std::vector<Contested> contested = find_contested(geometry);
  if (contested.empty()) return nullptr;
  std::unique_ptr<Ties> ties(new Ties);
  ties->contested_ = std::move(contested);
  Scene& made = *ties->scene_;
  made.triangles = {&geometry, &ties->contested_, {}};
  made.disks = made.triangles;
  for (std::uint32_t i = 0; i < ties->contested_.size(); ++i) {
    const Contested& c = ties->contested_[i];
    auto& index = ties->index_[static_cast<std::size_t>(c.kind)];
    if (index.empty())
      index.assign(geometry.groups[0].primitives[static_cast<std::size_t>(c.kind)].count, kNone);
    index[c.primitive] = i;
    std::uint32_t& last = ties->contested_end_[static_cast<std::size_t>(c.kind)];
    last = std::max(last, c.primitive + 1);
    if (c.kind == PrimitiveKind::triangle) {
      made.triangles.index.push_back(i);
      made.corners.push_back(geometry.indices[c.primitive]);
    } else {
      made.disks.index.push_back(i);
    }
  }
  made.scene = rtcNewScene(device);
  if (made.scene == nullptr) return nullptr;  // the device has heard of it
  rtcSetSceneFlags(made.scene, RTC_SCENE_FLAG_ROBUST);
  const auto attach = [&](RTCGeometry of, unsigned id) {
    rtcCommitGeometry(of);
    rtcAttachGeometryByID(made.scene, of, id);
    rtcReleaseGeometry(of);
  };
  if (!made.corners.empty()) {
    RTCGeometry of = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    rtcSetSharedGeometryBuffer(of, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, geometry.positions.data(), 0,
                               sizeof(Vec3), geometry.positions.size() - 1);
    rtcSetSharedGeometryBuffer(of, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, made.corners.data(), 0,
                               sizeof made.corners[0], made.corners.size());
    rtcSetGeometryUserData(of, &made.triangles);
    rtcSetGeometryIntersectFilterFunction(of, note_triangle);
    attach(of, kTriangles);
  }
  if (!made.disks.index.empty()) {
    RTCGeometry of = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(of, static_cast<unsigned>(made.disks.index.size()));
    rtcSetGeometryUserData(of, &made.disks);
    rtcSetGeometryBoundsFunction(of, disk_bounds, nullptr);
    rtcSetGeometryIntersectFunction(of, note_disk);
    attach(of, kDisks);
  }
  rtcCommitScene(made.scene);
  return ties;
}

void Ties::settle_contested(const Ray& ray, float distance, std::uint32_t index, PrimitiveKind& kind,
                            std::uint32_t& primitive) const {
  const Vec3 p = ray.origin + ray.direction * distance;
  const std::vector<Place>& others = contested_[index].others;
  if (std::none_of(others.begin(), others.end(), [&](const Place& place) { return place.holds(p); })) return;
  TieQuery query;
  rtcInitIntersectContext(&query.context);
  query.plane = contested_[index].plane;
  query.first = index;
  // All in the plane are met at one place: the stretch only has to hold what Embree's rounding makes of it.
  constexpr float kStretch = 0x1p-10f;
  RTCRayHit hit{};
  hit.ray.org_x = ray.origin.x;
  hit.ray.org_y = ray.origin.y;
  hit.ray.org_z = ray.origin.z;
  hit.ray.dir_x = ray.direction.x;
  hit.ray.dir_y = ray.direction.y;
  hit.ray.dir_z = ray.direction.z;
  hit.ray.tnear = distance * (1 - kStretch);
  hit.ray.tfar = distance * (1 + kStretch);
  hit.ray.mask = 0xffffffffU;
  hit.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  hit.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(scene_->scene, &query.context, &hit);
  kind = contested_[query.first].kind;
  primitive = contested_[query.first].primitive;
}

}  // namespace candela::scene
