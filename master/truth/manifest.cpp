#include "master/truth/manifest.h"

#include <algorithm>
#include <utility>

#include "common/film/codec.h"
#include "common/film/layers.h"
#include "common/wire/canonical.h"
#include "common/wire/wire.h"

namespace candela::master {
namespace {

constexpr std::string_view kMagic = "CANMANI1";

Error unusable(std::string text) {
  return input_error("the manifest cannot be used: " + std::move(text));
}

}  // namespace

Result<std::string> encode_manifest(const JobRow& row, const std::string& bundle_bytes,
                                    const std::vector<std::uint64_t>& chain_starts) {
  v1::JobManifest m;
  if (!m.mutable_bundle()->ParseFromString(bundle_bytes)) return input_error("the bundle cannot be read");
  m.set_id(row.id);
  m.set_name(row.name);
  wire::to_proto(row.settings, *m.mutable_settings());
  wire::to_proto(row.stop, row.stop_indices, *m.mutable_stop());
  m.set_priority(row.priority);
  m.set_share(row.share);
  m.set_idempotency_token(row.idempotency_token);
  m.set_content_digest(row.content_digest);
  if (row.named_state) wire::to_proto(state_of_units(row), *m.mutable_named_state());
  if (row.pilot_outdated) m.mutable_named_state()->clear_decided();
  m.set_plan(row.plan);
  m.mutable_layers()->Assign(row.layers.begin(), row.layers.end());
  if (row.chains) {
    wire::to_proto(*row.chains, *m.mutable_chains());
    m.mutable_chain_starts()->Assign(chain_starts.begin(), chain_starts.end());
    m.set_bootstrap_sum(row.bootstrap.sum);
    m.set_bootstrap_square_sum(row.bootstrap.square_sum);
    m.mutable_bootstrap_rejected()->Assign(row.bootstrap_rejected.begin(), row.bootstrap_rejected.end());
    m.set_pilot_scale_log2(row.pilot_scale_log2);
  }
  if (row.epochs || row.development || !row.accumulators.empty())
    wire::to_proto(WorkPlan{{}, row.accumulators, {}, row.epochs, row.development}, *m.mutable_work());
  m.set_thread_seconds_per_iteration(row.thread_seconds_per_iteration);
  m.set_submitted_unix_ms(row.submitted_unix_ms);
  m.set_elapsed_seconds(row.elapsed_seconds);
  m.set_submitter(row.submitter);
  m.set_scene_path(row.scene_path);
  if (row.frame) {
    m.mutable_frame()->set_group_id(row.frame->group_id);
    m.mutable_frame()->set_group_name(row.frame->group_name);
    m.mutable_frame()->set_frame(row.frame->frame);
    m.mutable_frame()->set_frames(row.frame->frames);
  }
  std::string out(kMagic);
  out += wire::canonical(m);
  film::seal(out);
  return out;
}

Result<Manifest> parse_manifest(std::string_view bytes) {
  CANDELA_ASSIGN(const std::string_view content, film::unseal(bytes, kMagic, "the manifest"));
  v1::JobManifest m;
  if (!m.ParseFromArray(content.data(), static_cast<int>(content.size())))
    return unusable("it is of another version");
  Manifest out;
  JobRow& row = out.row;
  row.id = m.id();
  row.name = m.name();
  CANDELA_ASSIGN(const bundle::Bundle bundle, wire::from_proto(m.bundle()));
  row.bundle_sha256 = bundle.hash();
  out.bundle_bytes = wire::canonical(m.bundle());
  CANDELA_ASSIGN(row.settings, wire::from_proto(m.settings()));
  CANDELA_ASSIGN(row.stop, wire::from_proto(m.stop()));
  CANDELA_ASSIGN(row.stop_indices, wire::indices_of(m.stop()));
  row.priority = m.priority();
  row.share = m.share();
  if (!(row.share > 0)) return unusable("its share is not a positive number");
  row.idempotency_token = m.idempotency_token();
  row.content_digest = m.content_digest();
  if (!m.has_named_state()) return unusable("it is of a job without a film");
  CANDELA_ASSIGN(row.named_state, wire::from_proto(m.named_state()));
  row.decided = std::exchange(row.named_state->decided, {});
  row.pilot_outdated = !m.named_state().has_decided() && !m.has_chains();
  row.plan = m.plan();
  row.layers.assign(m.layers().begin(), m.layers().end());
  CANDELA_TRY(film::make_layout(row.settings.width, row.settings.height, row.layers));
  if (m.has_chains()) {
    CANDELA_ASSIGN(row.chains, wire::from_proto(m.chains()));
    if (row.layers.size() + 1 < chains::kImageLayers) return unusable("the film has too few layers");
    out.chain_starts.assign(m.chain_starts().begin(), m.chain_starts().end());
    row.bootstrap.samples = row.chains->bootstrap_samples;
    row.bootstrap.sum = m.bootstrap_sum();
    row.bootstrap.square_sum = m.bootstrap_square_sum();
    const auto causes = static_cast<std::size_t>(m.bootstrap_rejected_size());
    for (std::size_t i = 0; i < std::min(causes, row.bootstrap_rejected.size()); ++i)
      row.bootstrap_rejected[i] = m.bootstrap_rejected(static_cast<int>(i));
    row.pilot_scale_log2 = m.pilot_scale_log2();
  }
  CANDELA_ASSIGN(WorkPlan work, wire::from_proto(m.work()));
  work.layers = row.layers;
  CANDELA_TRY(validate(work, row.settings.width, row.settings.height));
  row.accumulators = std::move(work.accumulators);
  row.epochs = std::move(work.epochs);
  row.development = std::move(work.development);
  row.thread_seconds_per_iteration = m.thread_seconds_per_iteration();
  row.submitted_unix_ms = m.submitted_unix_ms();
  row.elapsed_seconds = m.elapsed_seconds();
  row.submitter = m.submitter();
  row.scene_path = m.scene_path();
  if (row.named_state) row.builds = {kUnknownBuild};
  if (m.has_frame())
    row.frame = FrameRow{m.frame().group_id(), m.frame().group_name(), m.frame().frame(), m.frame().frames()};
  return out;
}

}  // namespace candela::master
