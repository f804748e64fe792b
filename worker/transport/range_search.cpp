#include "worker/transport/range_search.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <bit>

#include "common/base/work_monitor.h"

namespace candela::transport {
namespace {

// In radii: the width of rows and the length of cells along them. Rows as wide as a disc, of which a query
// meets two by two; narrower ones mean more runs, which cost more than the candidates they save, and so does
// the arithmetic that would tell how near each row comes.
constexpr double kCell = 2.0;
constexpr double kCellX = 0.7;

struct Point {
  Vec3 position;
  std::uint32_t index;
};

// A range of [0, count) cut into parts.
struct Parts {
  std::size_t count, parts;
  std::size_t begin(std::size_t part) const { return count * part / parts; }
};

}  // namespace

void RangeSearch::build(PositionView points, float radius, unsigned threads) {
  const std::size_t n = points.size();
  size_ = n;
  pitch_ = (n + 15) / 8 * 8;
  positions_.resize(3 * pitch_);
  for (std::size_t axis = 0; axis < 3; ++axis)  // what a query may read past the last point
    std::fill(positions_.data() + axis * pitch_ + n, positions_.data() + (axis + 1) * pitch_, 0.0f);
  order_.resize(n);
  last_ = {-1, -1, -1};
  if (n == 0) return;

  const Parts chunks{n, std::clamp<std::size_t>(n / 32768, 1, 64)};
  tbb::task_arena arena(static_cast<int>(std::max(1u, threads)));
  const auto in_parallel = [&](std::size_t count, const auto& body) {
    if (threads <= 1 || count <= 1) {
      for (std::size_t i = 0; i < count; ++i) {
        work_step();
        body(i);
      }
    } else {
      work_step();
      arena.execute([&] { tbb::parallel_for(std::size_t{0}, count, body); });
    }
  };

  struct Box {
    Vec3 low, high;
  };
  std::vector<Box> boxes(chunks.parts);
  in_parallel(chunks.parts, [&](std::size_t c) {
    Box box{points[chunks.begin(c)], points[chunks.begin(c)]};
    for (std::size_t i = chunks.begin(c); i < chunks.begin(c + 1); ++i) {
      const Vec3 p = points[i];
      box.low = {std::min(box.low.x, p.x), std::min(box.low.y, p.y), std::min(box.low.z, p.z)};
      box.high = {std::max(box.high.x, p.x), std::max(box.high.y, p.y), std::max(box.high.z, p.z)};
    }
    boxes[c] = box;
  });
  Box box = boxes[0];
  for (const Box& b : boxes) {
    box.low = {std::min(box.low.x, b.low.x), std::min(box.low.y, b.low.y), std::min(box.low.z, b.low.z)};
    box.high = {std::max(box.high.x, b.high.x), std::max(box.high.y, b.high.y),
                std::max(box.high.z, b.high.z)};
  }
  origin_ = box.low;
  // Cells below 2^-23 of the extent tell nothing apart that floats can, and their numbers would overflow.
  const Vec3d size = Vec3d(box.high) - Vec3d(box.low);
  const double least = std::max(1e-30, std::max(size.x, std::max(size.y, size.z)) * 0x1p-23);
  const double r = std::min(static_cast<double>(radius) * (1 + 1e-5), 1e30);
  inv_cell_ = static_cast<float>(1 / std::max(least, kCell * r));
  inv_cell_x_ = static_cast<float>(1 / std::max(least, kCellX * r));
  last_ = cell_of(box.high);

  // From n / 2 to n buckets: two to four bytes a point.
  const int bits = std::clamp(static_cast<int>(std::bit_width(n / 2)), 1, 31);
  mask_ = (1u << bits) - 1;
  shift_ = 32 - bits;
  starts_.resize((std::size_t{1} << bits) + 1);

  // A stable counting sort by bucket in two steps: into partitions of consecutive buckets, then inside each.
  // The place of a point follows from all buckets before it and all indices of its own: not from the chunks.
  const int partition_bits = std::clamp(bits - 11, 0, 10);
  const int low_bits = bits - partition_bits;
  const std::size_t partitions = std::size_t{1} << partition_bits;
  std::vector<std::uint32_t> offsets(chunks.parts * partitions, 0);
  in_parallel(chunks.parts, [&](std::size_t c) {
    std::uint32_t* count = offsets.data() + c * partitions;
    for (std::size_t i = chunks.begin(c); i < chunks.begin(c + 1); ++i)
      ++count[bucket_of(cell_of(points[i])) >> low_bits];
  });
  std::vector<std::uint32_t> first(partitions + 1);
  std::uint32_t sum = 0;
  for (std::size_t p = 0; p < partitions; ++p) {
    first[p] = sum;
    for (std::size_t c = 0; c < chunks.parts; ++c) {
      const std::uint32_t count = offsets[c * partitions + p];
      offsets[c * partitions + p] = sum;
      sum += count;
    }
  }
  first[partitions] = sum;
  HugeVector<Point> grouped(n);
  in_parallel(chunks.parts, [&](std::size_t c) {
    std::uint32_t* next = offsets.data() + c * partitions;
    for (std::size_t i = chunks.begin(c); i < chunks.begin(c + 1); ++i) {
      const Vec3 p = points[i];
      grouped[next[bucket_of(cell_of(p)) >> low_bits]++] = {p, static_cast<std::uint32_t>(i)};
    }
  });
  starts_.back() = static_cast<std::uint32_t>(n);
  in_parallel(partitions, [&](std::size_t p) {
    const std::size_t buckets = std::size_t{1} << low_bits;
    const auto low_mask = static_cast<std::uint32_t>(buckets - 1);
    std::uint32_t* start = starts_.data() + p * buckets;
    std::vector<std::uint32_t> next(buckets, 0);
    for (std::uint32_t s = first[p]; s < first[p + 1]; ++s)
      ++next[bucket_of(cell_of(grouped[s].position)) & low_mask];
    std::uint32_t slot = first[p];
    for (std::size_t b = 0; b < buckets; ++b) {
      start[b] = slot;
      slot += next[b];
      next[b] = start[b];
    }
    for (std::uint32_t s = first[p]; s < first[p + 1]; ++s) {
      const Point& point = grouped[s];
      const std::uint32_t to = next[bucket_of(cell_of(point.position)) & low_mask]++;
      order_[to] = point.index;
      positions_[to] = point.position.x;
      positions_[pitch_ + to] = point.position.y;
      positions_[2 * pitch_ + to] = point.position.z;
    }
  });
}

std::uint64_t RangeSearch::bytes() const {
  return positions_.capacity() * sizeof(float) +
         (order_.capacity() + starts_.capacity()) * sizeof(std::uint32_t);
}

void RangeSearch::forget_order() {
  HugeVector<std::uint32_t>().swap(order_);
}

int RangeSearch::row_runs(std::int32_t y, std::int32_t z, std::int32_t x0, std::int32_t x1, Run* out) const {
  const auto cells = static_cast<std::uint32_t>(x1 - x0);
  if (cells >= mask_) {  // more cells than buckets
    out[0] = {0, static_cast<std::uint32_t>(size_)};
    return 1;
  }
  const std::uint32_t begin = (row_base(y, z) + static_cast<std::uint32_t>(x0)) & mask_;
  const std::uint32_t end = (begin + cells) & mask_;
  if (begin <= end) {
    out[0] = {starts_[begin], starts_[end + 1]};
    return out[0].begin < out[0].end ? 1 : 0;
  }
  out[0] = {0, starts_[end + 1]};
  out[1] = {starts_[begin], static_cast<std::uint32_t>(size_)};
  return 2;
}

RangeSearch::CellBox RangeSearch::box_of(Vec3 p, float radius) const {
  // Room for the rounding of differences, squares and their sum, and for squares that underflow: whatever is
  // found within the radius lies in the box of this half width. The box's own rounding is harmless, since
  // rounding and cell() are both monotone.
  const float reach = radius * 1.000001f + 1e-22f;
  const CellBox box{std::max(cell(p.x - reach, origin_.x, inv_cell_x_), 0),
                    std::min(cell(p.x + reach, origin_.x, inv_cell_x_), last_.x),
                    std::max(cell(p.y - reach, origin_.y, inv_cell_), 0),
                    std::min(cell(p.y + reach, origin_.y, inv_cell_), last_.y),
                    std::max(cell(p.z - reach, origin_.z, inv_cell_), 0),
                    std::min(cell(p.z + reach, origin_.z, inv_cell_), last_.z)};
  return box.x0 > box.x1 || box.y0 > box.y1 || box.z0 > box.z1 ? CellBox() : box;
}

void RangeSearch::prefetch(Vec3 p, float radius) const {
  const CellBox box = box_of(p, radius);
  if (box.x0 > box.x1 || box.rows() > kMaxRows) return;
  const auto cells = static_cast<std::uint32_t>(box.x1 - box.x0);
  for (std::int32_t z = box.z0; z <= box.z1; ++z) {
    for (std::int32_t y = box.y0; y <= box.y1; ++y) {
      const std::uint32_t begin = (row_base(y, z) + static_cast<std::uint32_t>(box.x0)) & mask_;
      __builtin_prefetch(&starts_[begin]);
      __builtin_prefetch(&starts_[((begin + cells) & mask_) + 1]);
    }
  }
}

void RangeSearch::find(Vec3 p, float radius, Query& query) const {
  find_runs(p, radius, query);
  for (int i = 0; i < query.count_; ++i) {
    const Run run = query.run_[i];
    // Hardware goes on by itself where a run is long.
    for (const float* axis : {x(), y(), z()}) {
      __builtin_prefetch(axis + run.begin);
      __builtin_prefetch(axis + std::min(run.begin + 16, run.end));
    }
  }
}

void RangeSearch::find_runs(Vec3 p, float radius, Query& query) const {
  query.p_ = p;
  query.radius_ = radius;
  query.count_ = 0;
  query.rows_left_ = false;
  query.box_ = box_of(p, radius);
  const auto [x0, x1, y0, y1, z0, z1] = query.box_;
  if (x0 > x1) return;
  const std::int64_t rows = query.box_.rows();
  if (rows > kMaxRows) {
    if (rows > static_cast<std::int64_t>(size_ / 16))  // reading all of them is quicker than the rows
      query.run_[query.count_++] = {0, static_cast<std::uint32_t>(size_)};
    else
      query.rows_left_ = true;
    return;
  }
  Run* run = query.run_;
  int count = 0;
  for (std::int32_t z = z0; z <= z1; ++z) {
    for (std::int32_t y = y0; y <= y1; ++y) count += row_runs(y, z, x0, x1, run + count);
  }
  // Runs that touch or overlap become one. They are few.
  for (int i = 1; i < count; ++i) {
    const Run moved = run[i];
    int j = i;
    for (; j > 0 && run[j - 1].begin > moved.begin; --j) run[j] = run[j - 1];
    run[j] = moved;
  }
  int last = 0;
  for (int i = 1; i < count; ++i) {
    if (run[i].begin <= run[last].end) {
      run[last].end = std::max(run[last].end, run[i].end);
    } else {
      run[++last] = run[i];
    }
  }
  query.count_ = count == 0 ? 0 : last + 1;
}

}  // namespace candela::transport
