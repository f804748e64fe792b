#include "common/stats/movement.h"

#include <cmath>
#include <cstring>

#include "common/film/codec.h"

namespace candela::stats {
namespace {

constexpr std::string_view kMagic = "CANMOVE1";

// The mean of i^(alpha - 1) over the iterations (from, to], by the integral of its midpoints.
double mean_weight(double from, double to, double alpha) {
  return (std::pow(to + 0.5, alpha) - std::pow(from + 0.5, alpha)) / (alpha * (to - from));
}

void put_double(std::string& out, double value) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  film::put_u64(out, bits);
}
double read_double(film::Reader& reader) {
  const std::uint64_t bits = reader.u64();
  double value = 0;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}
void put_floats(std::string& out, const std::vector<float>& values) {
  for (const float value : values) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    film::put_u32(out, bits);
  }
}
void read_floats(film::Reader& reader, std::vector<float>& values) {
  for (float& value : values) {
    const std::uint32_t bits = reader.u32();
    std::memcpy(&value, &bits, sizeof value);
  }
}

}  // namespace

bool Movement::due(double n0, double n1) const {
  return n0 >= 1 && n1 >= 1 && n0 >= 2 * last_.n0 && n1 >= 2 * last_.n1;
}

bool Movement::fits(const BlockMeans& now) const {
  return now.side == last_.side && now.width == last_.width && now.height == last_.height;
}

void Movement::extend(Half& half, double from, double to, double weight, const std::vector<float>& before,
                      const std::vector<float>& now) {
  half.weighted.resize(now.size(), 0.0F);
  half.g += weight * (to - from);
  half.gg += weight * weight * (to - from);
  for (std::size_t i = 0; i < now.size(); ++i) {
    const double sum = double{now[i]} * to - (from > 0 ? double{before[i]} * from : 0);
    half.weighted[i] += static_cast<float>(weight * sum);
  }
}

void Movement::add(const BlockMeans& now, double alpha) {
  if (last_.n0 > 0 && !fits(now)) *this = {};
  if (!due(now.n0, now.n1)) return;
  const double weight = mean_weight(last_.n0 + last_.n1, now.n0 + now.n1, alpha);
  extend(half_[0], last_.n0, now.n0, weight, last_.a, now.a);
  extend(half_[1], last_.n1, now.n1, weight, last_.b, now.b);
  last_ = now;
}

Movement::Bias Movement::bias(const BlockMeans& now, double alpha) const {
  if (!(last_.n0 > 0) || !fits(now) || now.n0 < last_.n0 || now.n1 < last_.n1) return {};
  Bias bias;
  for (int h = 0; h < 2; ++h) {
    const double from = h == 0 ? last_.n0 : last_.n1, to = h == 0 ? now.n0 : now.n1;
    const std::vector<float>& image = h == 0 ? now.a : now.b;
    Half half = half_[h];
    if (to > from)
      extend(half, from, to, mean_weight(last_.n0 + last_.n1, now.n0 + now.n1, alpha),
             h == 0 ? last_.a : last_.b, image);
    // Least squares of the iterations' means on their weights: slope = cov / var; the image's bias is the
    // slope times the mean weight.
    const double mean = half.g / to, variance = half.gg / to - mean * mean;
    if (!(variance > 1e-4 * mean * mean)) return {};
    std::vector<float>& out = h == 0 ? bias.a : bias.b;
    out.reserve(image.size());
    for (std::size_t i = 0; i < image.size(); ++i)
      out.push_back(static_cast<float>((half.weighted[i] / to - mean * image[i]) / variance * mean));
  }
  return bias;
}

std::string Movement::serialise() const {
  std::string out(kMagic);
  for (const std::uint32_t value : {last_.side, last_.width, last_.height}) film::put_u32(out, value);
  for (const double value : {last_.n0, last_.n1, half_[0].g, half_[0].gg, half_[1].g, half_[1].gg})
    put_double(out, value);
  for (const std::vector<float>* values : {&last_.a, &last_.b, &half_[0].weighted, &half_[1].weighted})
    put_floats(out, *values);
  film::seal(out);
  return out;
}

Result<Movement> Movement::parse(std::string_view bytes) {
  CANDELA_ASSIGN(const std::string_view content, film::unseal(bytes, kMagic, "the movement of the image"));
  film::Reader reader(content);
  Movement movement;
  BlockMeans& last = movement.last_;
  for (std::uint32_t* value : {&last.side, &last.width, &last.height}) *value = reader.u32();
  for (double* value : {&last.n0, &last.n1, &movement.half_[0].g, &movement.half_[0].gg, &movement.half_[1].g,
                        &movement.half_[1].gg})
    *value = read_double(reader);
  if (!reader.ok() || last.side == 0 || last.width > kMaxBlocks || last.height > kMaxBlocks)
    return input_error("the movement of the image has an impossible size").with_field("size");
  const std::size_t count = last.n0 > 0 ? std::size_t{last.width} * last.height * 3 : 0;
  for (std::vector<float>* values :
       {&last.a, &last.b, &movement.half_[0].weighted, &movement.half_[1].weighted}) {
    values->resize(count);
    read_floats(reader, *values);
  }
  if (!reader.ok() || !reader.rest().empty())
    return input_error("the movement of the image is cut, or too long").with_field("length");
  return movement;
}

}  // namespace candela::stats
