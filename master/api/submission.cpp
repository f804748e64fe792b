#include "master/api/submission.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "common/base/hash.h"
#include "common/base/text.h"
#include "common/wire/canonical.h"
#include "common/wire/wire.h"

namespace candela::master {
namespace {

// The group's id follows from the submitter, who is not known here.
Result<void> read_frame(const v1::SubmitRequest& r, JobRow& row) {
  constexpr int kMaxDepends = 100;
  if (r.depends_size() > kMaxDepends)
    return input_error(fmt::format("more than {} jobs", kMaxDepends)).with_field("depends");
  row.depends = {r.depends().begin(), r.depends().end()};
  std::sort(row.depends.begin(), row.depends.end());
  row.depends.erase(std::unique(row.depends.begin(), row.depends.end()), row.depends.end());
  if (!r.has_frame()) return {};
  const v1::Frame& frame = r.frame();
  for (const auto& [text, field] : {std::pair{&frame.group_name(), "frame.group_name"},
                                    std::pair{&frame.group_token(), "frame.group_token"}})
    if (text->empty() || text->size() > Limits::max_name_bytes)
      return input_error(fmt::format("must have 1 to {} bytes", Limits::max_name_bytes)).with_field(field);
  row.frame = FrameRow{"", frame.group_name(), frame.frame(), frame.frames()};
  return {};
}

Result<JobRow> job_of(const v1::SubmitRequest& r) {
  JobRow row;
  if (r.name().size() > Limits::max_name_bytes)
    return input_error(fmt::format("longer than {} bytes", Limits::max_name_bytes)).with_field("name");
  if (r.idempotency_token().size() > Limits::max_name_bytes)
    return input_error(fmt::format("longer than {} bytes", Limits::max_name_bytes))
        .with_field("idempotency_token");
  if (r.submitter().size() > Limits::max_name_bytes)
    return input_error(fmt::format("longer than {} bytes", Limits::max_name_bytes)).with_field("submitter");
  if (!std::isfinite(r.share()) || r.share() < 0 || (r.share() > 0 && r.share() < 1e-6) || r.share() > 1e6)
    return input_error("must be 0 (for 1), or 1e-6 to 1e6").with_field("share");
  if (r.priority() < -1000000 || r.priority() > 1000000)
    return input_error("must be -1000000 to 1000000").with_field("priority");
  CANDELA_ASSIGN(row.settings, wire::from_proto(r.settings()));
  CANDELA_ASSIGN(row.stop, wire::from_proto(r.stop()));
  CANDELA_ASSIGN(row.stop_indices, wire::indices_of(r.stop()));
  if (r.scene_path().size() > Limits::max_path_bytes)
    return input_error(fmt::format("longer than {} bytes", Limits::max_path_bytes)).with_field("scene_path");
  if (escape_unprintable(r.scene_path()) != r.scene_path())
    return input_error("holds a character that cannot be shown").with_field("scene_path");
  row.scene_path = r.scene_path();
  CANDELA_TRY(read_frame(r, row));
  row.name = r.name();
  row.priority = r.priority();
  row.share = r.share() > 0 ? r.share() : 1;
  row.idempotency_token = r.idempotency_token();
  v1::SubmitRequest content = r;
  content.clear_idempotency_token();
  content.clear_submitter();
  content.clear_scene_path();
  if (content.has_frame()) content.mutable_frame()->clear_frames();  // a group may grow
  row.content_digest = sha256_hex(wire::canonical(content));
  return row;
}

}  // namespace

Result<SubmittedJob> submit_job(Farm& farm, const v1::SubmitRequest& request,
                                const std::string& certificate) {
  CANDELA_ASSIGN(JobRow row, job_of(request));
  row.submitter = certificate.empty() ? request.submitter() : certificate;
  if (row.frame) row.frame->group_id = Farm::group_id_of(row.submitter, request.frame().group_token());
  std::string group_id = row.frame ? row.frame->group_id : "";
  // Its plan may need more; the pilot tells.
  CANDELA_TRY(check_memory(need_of(row), row.settings, farm.memory_limit()));
  CANDELA_ASSIGN(const bundle::Bundle bundle, wire::from_proto(request.bundle()));
  for (const bundle::File& file : bundle.files) {
    farm.blobs().use(file.sha256);  // before it is looked for: from then on it stays
    auto size = farm.blobs().size(file.sha256);
    if (size && *size != file.size_bytes) {  // the submission's mistake, or damage that nobody has met yet
      CANDELA_ASSIGN(const bool whole, farm.blobs().check(file.sha256));
      if (!whole) size.reset();
    }
    if (!size)
      return refused_error(fmt::format("the farm lacks '{}' ({})", file.path, file.sha256))
          .with_field("bundle.files")
          .with_mend("upload it first");
    if (*size != file.size_bytes)
      return input_error(fmt::format("'{}' has {} bytes, not {}", file.path, *size, file.size_bytes))
          .with_field("bundle.files");
  }
  row.bundle_sha256 = bundle.hash();
  CANDELA_ASSIGN(Farm::Submitted submitted, farm.submit(std::move(row), wire::canonical(request.bundle())));
  return SubmittedJob{std::move(submitted.job_id), submitted.existed, std::move(group_id)};
}

}  // namespace candela::master
