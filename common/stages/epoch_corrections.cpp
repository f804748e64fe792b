#include "common/stages/epoch_corrections.h"

#include <bit>
#include <cstring>

#include "common/stages/pixel_sums.h"

namespace candela::epoch_corrections {

static_assert(std::endian::native == std::endian::little, "a memo has doubles as they are in memory");
static_assert(kPixelBytes == 2 * mis::kColors * sizeof(double));

void add(const mis::Allocation& allocation, const HalfSums& before, const HalfSums& epoch,
         HalfColors& corrections) {
  mis::Sums all = before[0];
  all.add(before[1]);
  const mis::Slopes slopes = mis::ridge_slopes(allocation, all, pixel_sums::kMatrixScale);
  for (std::size_t half = 0; half < 2; ++half) {
    const mis::Color more = mis::correction(allocation, epoch[half], slopes);
    for (std::size_t k = 0; k < mis::kColors; ++k) corrections[half][k] += more[k];
  }
}

HalfColors read(std::string_view memo, std::size_t pixel) {
  HalfColors out;
  std::memcpy(out.data(), memo.data() + pixel * kPixelBytes, kPixelBytes);
  return out;
}

void write(std::string& memo, std::size_t pixel, const HalfColors& corrections) {
  std::memcpy(memo.data() + pixel * kPixelBytes, corrections.data(), kPixelBytes);
}

}  // namespace candela::epoch_corrections
