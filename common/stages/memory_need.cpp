#include "common/stages/memory_need.h"

#include <fmt/format.h>

#include "common/film/layout.h"
#include "common/film/tile_sums.h"
#include "common/stages/decision.h"

namespace candela {
namespace {

constexpr std::uint64_t kBlock = 16;         // of the allocator, for each block of memory
constexpr std::uint64_t kRecordBytes = 160;  // of a chain's record and the pointers to it, without its state

}  // namespace

MemoryNeed memory_need(const WorkPlan& plan, std::uint32_t width, std::uint32_t height,
                       std::uint64_t record_bytes) {
  const film::Layout layout{width, height, 1 + static_cast<std::uint32_t>(plan.layers.size())};
  const std::uint64_t pixels = layout.pixel_count();
  MemoryNeed need;
  need.film = 2 * (pixels * layout.layers * film::kChannels * sizeof(std::int64_t) +
                   layout.tile_count() * (sizeof(film::TileSums::Tile) + kBlock));
  need.statistics = statistics_bytes(plan, width, height);
  if (plan.chains)
    need.chains = plan.chains->bootstrap_samples * sizeof(float) +
                  plan.chains->chains * (kRecordBytes + record_bytes + sizeof(std::uint64_t));
  // The bytes of a checkpoint are made in room for the sums as they are, within which they are compressed.
  const std::uint64_t checkpoint = 2 * need.film + need.statistics + need.chains;
  // The developed image and what is sent of it, floats.
  const std::uint64_t image = need.film + pixels * film::kChannels * sizeof(float) * (2 + 2 * layout.layers);
  need.working = std::max(checkpoint, image);
  return need;
}

Result<void> check_memory(const MemoryNeed& need, const JobSettings& settings, std::uint64_t limit_bytes) {
  if (need.all() <= limit_bytes) return {};
  std::string parts = memory_text(need.film) + " for its film";
  if (need.statistics > 0) parts += ", " + memory_text(need.statistics) + " for statistics";
  if (need.chains > 0) parts += ", " + memory_text(need.chains) + " for chains";
  return input_error(fmt::format("a job of '{}' at {} x {} pixels takes {} of the master's memory ({}, {} to "
                                 "write checkpoints and images), which has {} for jobs",
                                 settings.integrator, settings.width, settings.height,
                                 memory_text(need.all()), parts, memory_text(need.working),
                                 memory_text(limit_bytes)))
      .with_mend("render a smaller image or fewer layers, or start the master with a larger --memory");
}

std::string memory_text(std::uint64_t bytes) {
  if (bytes >= 10'000'000'000) return fmt::format("{:.1f} GB", static_cast<double>(bytes) * 1e-9);
  return fmt::format("{} MB", (bytes + 999'999) / 1'000'000);
}

}  // namespace candela
