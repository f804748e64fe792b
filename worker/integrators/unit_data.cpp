#include "worker/integrators/unit_data.h"

namespace candela::integrators {

std::string encode_delta(const film::DeltaInfo& info, const UnitOutput& output) {
  film::DeltaWriter writer(info);
  if (output.film != nullptr) writer.film(*output.film);
  for (const auto& sums : output.accumulators) {
    const bool per_epoch = sums->spec().per == film::AccumulatorSpec::Per::epoch;
    writer.accumulator(*sums, per_epoch ? output.epoch : 0);
  }
  for (const auto& sums : output.aovs) writer.accumulator(*sums, 0);
  if (info.unit.kind == Unit::Kind::segments)
    writer.records(chains::encode(std::span<const chains::ChainRecord>(output.records)));
  if (info.unit.kind == Unit::Kind::bootstrap) writer.table(output.table);
  writer.counts(output.sample_counts());
  return writer.finish();
}

}  // namespace candela::integrators
