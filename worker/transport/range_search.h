// All points within a radius of a place: what merging, photon mapping and kernel statistics ask for.
//
// Points are binned by rows of cells along x. The bucket of a cell is hash(y, z) + x modulo the table's size,
// so the cells a query meets in one row are one run of buckets, and the points are sorted by bucket: a query
// reads a few runs of consecutive positions, eight at a time. Rows that share buckets by chance cost distance
// tests and nothing else: a query joins runs that overlap, so no point is visited twice.
//
// The structure depends on the points and the radius alone, not on the number of threads that build it, and a
// query visits in an order that depends on nothing else either. Points of one bucket are in index order.
//
// Slots are the places of the sorted order. A caller that stores what it gathers in that order (see
// permuted()) reads memory in runs, and needs neither an index per point nor a position in its records.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <span>

#include "worker/core/huge_pages.h"
#include "worker/core/vec.h"

#if defined(__AVX2__)
#include <immintrin.h>
#endif

namespace candela::transport {

// Positions inside an array of records. All have to be finite.
class PositionView {
 public:
  PositionView() = default;
  PositionView(std::span<const Vec3> positions)
      : PositionView(positions.data(), sizeof(Vec3), positions.size()) {}
  // first: the first record's position (three floats); stride: bytes from one record to the next.
  PositionView(const void* first, std::size_t stride, std::size_t count)
      : first_(static_cast<const std::byte*>(first)), stride_(stride), count_(count) {}
  template <class Record>
  PositionView(std::span<const Record> records, Vec3 Record::*member)
      : PositionView(records.empty() ? nullptr : &(records.front().*member), sizeof(Record), records.size()) {
  }

  std::size_t size() const { return count_; }
  Vec3 operator[](std::size_t i) const {
    Vec3 p;
    std::memcpy(&p, first_ + i * stride_, sizeof p);
    return p;
  }

 private:
  const std::byte* first_ = nullptr;
  std::size_t stride_ = 0, count_ = 0;
};

class RangeSearch {
 public:
  // Fewer than 2^32 - 8 points. radius >= 0: that of most queries; it sets the size of the cells and bounds
  // nothing. Peak memory while building: 16 bytes a point beside bytes().
  void build(PositionView points, float radius, unsigned threads);

  std::size_t size() const { return size_; }
  // Bytes that the structure holds.
  std::uint64_t bytes() const;
  Vec3 position(std::uint32_t slot) const { return {x()[slot], y()[slot], z()[slot]}; }
  // The index of each slot's point; empty once forgotten.
  std::span<const std::uint32_t> order() const { return order_; }
  // Frees order(): four bytes a point. visit_slots() goes on working, visit() does not.
  void forget_order();

  // visit(slot, d2) for each point whose squared distance d2 = dx dx + dy dy + dz dz, in float and in that
  // order, is finite and at most radius * radius in float. Each point once.
  template <class Visit>
  void visit_slots(Vec3 p, float radius, Visit&& visit) const;
  // The same in steps, for callers with other work to do while memory is fetched: prefetch() asks for what
  // find() reads, and find() for what visit_slots(query) reads.
  class Query;
  void prefetch(Vec3 p, float radius) const;
  void find(Vec3 p, float radius, Query& query) const;
  template <class Visit>
  void visit_slots(const Query& query, Visit&& visit) const;
  // visit_slots() with visit(index, d2).
  template <class Visit>
  void visit(Vec3 p, float radius, Visit&& visit) const {
    visit_slots(p, radius, [&](std::uint32_t slot, float d2) { visit(order_[slot], d2); });
  }

 private:
  struct Run {
    std::uint32_t begin, end;  // slots
  };
  static constexpr int kMaxRows = 16;
  // A box of cells; empty if x0 > x1.
  struct CellBox {
    std::int32_t x0 = 0, x1 = -1, y0 = 0, y1 = -1, z0 = 0, z1 = -1;
    std::int64_t rows() const { return std::int64_t{y1 - y0 + 1} * std::int64_t{z1 - z0 + 1}; }
  };
  struct Cell {
    std::int32_t x, y, z;
  };

  const float* x() const { return positions_.data(); }
  const float* y() const { return x() + pitch_; }
  const float* z() const { return y() + pitch_; }
  // floor of the grid coordinate, held to [-1, 2^24]: non-decreasing in `value`.
  std::int32_t cell(float value, float origin, float inv_cell) const {
    const float t = (value - origin) * inv_cell;
    return static_cast<std::int32_t>(std::floor(std::min(std::max(t, -1.0f), 16777216.0f)));
  }
  Cell cell_of(Vec3 p) const {
    return {cell(p.x, origin_.x, inv_cell_x_), cell(p.y, origin_.y, inv_cell_),
            cell(p.z, origin_.z, inv_cell_)};
  }
  std::uint32_t row_base(std::int32_t y, std::int32_t z) const {
    std::uint32_t h =
        static_cast<std::uint32_t>(y) * 0x8da6b343u + static_cast<std::uint32_t>(z) * 0xd8163841u;
    h ^= h >> 15;
    h *= 0x2c1b3c6du;
    return h >> shift_;
  }
  std::uint32_t bucket_of(Cell c) const {
    return (row_base(c.y, c.z) + static_cast<std::uint32_t>(c.x)) & mask_;
  }
  CellBox box_of(Vec3 p, float radius) const;
  void find_runs(Vec3 p, float radius, Query& query) const;
  int row_runs(std::int32_t y, std::int32_t z, std::int32_t x0, std::int32_t x1, Run* out) const;
  template <class Visit>
  void scan(Run run, Vec3 p, float r2, Visit&& visit) const;

  std::size_t size_ = 0, pitch_ = 0;
  HugeVector<float> positions_;       // all x, all y, all z, `pitch_` apart
  HugeVector<std::uint32_t> order_;   // slot -> index
  HugeVector<std::uint32_t> starts_;  // bucket -> first slot, and one more
  Vec3 origin_;
  float inv_cell_ = 1, inv_cell_x_ = 1;
  Cell last_{-1, -1, -1};  // greatest coordinate of any point's cell, per axis
  std::uint32_t mask_ = 0;
  int shift_ = 31;
};

// The runs of a query, ascending and disjoint; or, if they are too many for that, the rows to be gone
// through.
class RangeSearch::Query {
 private:
  friend class RangeSearch;
  Vec3 p_;
  float radius_ = 0;
  int count_ = 0;
  bool rows_left_ = false;
  CellBox box_;
  Run run_[2 * kMaxRows];
};

template <class Visit>
inline void RangeSearch::scan(Run run, Vec3 p, float r2, Visit&& visit) const {
#if defined(__AVX2__)
  const __m256 px = _mm256_set1_ps(p.x);
  const __m256 py = _mm256_set1_ps(p.y);
  const __m256 pz = _mm256_set1_ps(p.z);
  const __m256 limit = _mm256_set1_ps(r2);
  for (std::uint32_t s = run.begin; s < run.end; s += 8) {  // reads past the end: padded
    const __m256 dx = _mm256_sub_ps(_mm256_loadu_ps(x() + s), px);
    const __m256 dy = _mm256_sub_ps(_mm256_loadu_ps(y() + s), py);
    const __m256 dz = _mm256_sub_ps(_mm256_loadu_ps(z() + s), pz);
    const __m256 d2 =
        _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(dx, dx), _mm256_mul_ps(dy, dy)), _mm256_mul_ps(dz, dz));
    auto hits = static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(d2, limit, _CMP_LE_OQ)));
    if (run.end - s < 8) hits &= (1u << (run.end - s)) - 1;
    if (hits == 0) continue;
    alignas(32) float distances[8];
    _mm256_store_ps(distances, d2);
    do {
      const auto lane = static_cast<unsigned>(__builtin_ctz(hits));
      hits &= hits - 1;
      visit(s + lane, distances[lane]);
    } while (hits != 0);
  }
#else
  for (std::uint32_t s = run.begin; s < run.end; ++s) {
    const Vec3 d = position(s) - p;
    const float d2 = dot(d, d);
    if (d2 <= r2) visit(s, d2);
  }
#endif
}

template <class Visit>
inline void RangeSearch::visit_slots(Vec3 p, float radius, Visit&& visit) const {
  Query query;
  find_runs(p, radius, query);
  visit_slots(query, visit);
}

template <class Visit>
inline void RangeSearch::visit_slots(const Query& query, Visit&& visit) const {
  const Vec3 p = query.p_;
  const float r2 = std::min(query.radius_ * query.radius_, std::numeric_limits<float>::max());
  for (int i = 0; i < query.count_; ++i) scan(query.run_[i], p, r2, visit);
  if (!query.rows_left_) return;
  const CellBox& box = query.box_;
  for (std::int32_t z = box.z0; z <= box.z1; ++z) {
    for (std::int32_t y = box.y0; y <= box.y1; ++y) {
      Run runs[2];
      const int count = row_runs(y, z, box.x0, box.x1, runs);
      for (int i = 0; i < count; ++i) {
        scan(runs[i], p, r2, [&](std::uint32_t slot, float d2) {
          const Cell c = cell_of(position(slot));  // another row's points may be among them
          if (c.y == y && c.z == z) visit(slot, d2);
        });
      }
    }
  }
}

// The records in the order of the slots: result[slot] = records[order[slot]].
template <class Record>
HugeVector<Record> permuted(std::span<const Record> records, std::span<const std::uint32_t> order) {
  HugeVector<Record> result;
  result.reserve(order.size());
  for (const std::uint32_t index : order) result.push_back(records[index]);
  return result;
}

}  // namespace candela::transport
