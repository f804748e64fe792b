// Submissions by HTTP: scene files one by one, then the job.

#include <new>
#include <utility>

#include "common/base/hash.h"
#include "common/wire/json.h"
#include "master/api/messages.h"
#include "master/api/submission.h"
#include "master/farm.h"
#include "master/http/live_page.h"
#include "master/http/page_json.h"

namespace candela::master {
namespace {

constexpr std::size_t kMaxSubmissionBytes = 4 << 20;
constexpr long kMaxUploads = 4;  // at a time

HttpAnswer blob_answer(int code, const std::string& sha256, std::uint64_t bytes) {
  return {.code = code,
          .type = "application/json",
          .body = JsonObject().add("sha256", sha256).count("size_bytes", bytes).text() + "\n"};
}

}  // namespace

HttpAnswer error_of(const Error& error) {
  const bool bad =
      error.kind == ErrorKind::input || error.kind == ErrorKind::usage || error.kind == ErrorKind::failed;
  return error_answer(bad ? 400 : error.kind == ErrorKind::refused ? 409 : 503, error.to_string());
}

std::optional<HttpAnswer> BlobUpload::add(std::string_view data) {
  if (auto added = upload_->append(data); !added.ok()) return error_of(added.error());
  left_ -= data.size();
  return std::nullopt;
}

std::size_t LivePage::body_limit(const HttpRequest& head) const {
  const RouteMatch match = find_route(head.method, head.path);
  if (match.route == nullptr || match.route->action != HttpAction::submit) return 0;
  return refusal(head) || may_not_change(head) ? 0 : kMaxSubmissionBytes;
}

std::optional<HttpAnswer> LivePage::begin_upload(const HttpRequest& request,
                                                 std::unique_ptr<BlobUpload>& upload) {
  if (auto refused = refusal(request)) return refused;
  const RouteMatch match = find_route(request.method, request.path);
  if (!request.path.starts_with("/api/") || (match.route == nullptr && match.other_method))
    return error_answer(405, "only GET and HEAD");
  if (auto refused = may_not_change(request)) return refused;
  if (match.route == nullptr)
    return error_answer(404, "there is no such address: docs/openapi.json has them");
  if (request.field("content-length").empty() || !request.field("transfer-encoding").empty())
    return error_answer(411, "say Content-Length");
  const std::string& sha256 = match.part;
  if (!is_sha256_hex(sha256)) return error_answer(400, "a blob is named by 64 lower-case hex digits");
  if (farm_.stopping()) return error_answer(503, "the master is stopping");
  if (uploads_.use_count() > kMaxUploads)
    return error_answer(503, "files are being uploaded by others: send it again in a moment");
  farm_.blobs().use(sha256);
  if (farm_.blobs().size(sha256) == request.body_bytes) return blob_answer(200, sha256, request.body_bytes);
  auto begun = farm_.blobs().begin(sha256, request.body_bytes);
  if (!begun.ok()) return error_of(begun.error());
  upload = std::make_unique<BlobUpload>(std::move(*begun), sha256, request.body_bytes, uploads_);
  return std::nullopt;
}

void LivePage::finish_upload(std::unique_ptr<BlobUpload> upload, std::uint64_t connection) {
  const std::shared_ptr<BlobUpload> whole = std::move(upload);
  {
    const Lock lock(mutex_);
    saves_.push_back([this, connection, whole] {
      HttpAnswer made;
      try {
        made = finished(*whole);
      } catch (const std::bad_alloc&) {
        made = error_answer(503, "the master is out of memory: send it again in a moment");
      }
      out_.answer(connection, std::move(made));
    });
  }
  save_wake_.notify_all();
}

HttpAnswer LivePage::finished(BlobUpload& upload) {
  if (auto stored = upload.upload_->finish(); !stored.ok()) return error_of(stored.error());
  farm_.counters().upload_bytes += upload.bytes_;
  farm_.blob_found(upload.sha256_);
  return blob_answer(201, upload.sha256_, upload.bytes_);
}

HttpAnswer LivePage::submit(const std::string& json) {
  if (farm_.stopping()) return error_answer(503, "the master is stopping");
  const auto request = wire::parse_submission(json);
  if (!request.ok()) return error_of(request.error());
  const auto submitted = submit_job(farm_, *request, "");
  if (!submitted.ok()) return error_of(submitted.error());
  const std::string& group = submitted->group_id;
  return {.code = submitted->existed ? 200 : 201,
          .type = "application/json",
          .body = JsonObject()
                      .add("id", submitted->job_id)
                      .flag("existed", submitted->existed)
                      .json("group_id", group.empty() ? "null" : json_string(group))
                      .text() +
                  "\n"};
}

HttpAnswer LivePage::list_groups() {
  std::vector<std::string> ids = farm_.with_scheduler([](Scheduler& s) {
    std::vector<std::string> out;
    for (const auto& [id, group] : s.groups()) out.push_back(id);
    return out;
  });
  std::vector<std::string> groups;
  for (const std::string& id : ids)
    if (const auto status = farm_.group_status(id)) groups.push_back(wire::page_json(to_message(*status)));
  return {.type = "application/json", .body = "{\"groups\":" + json_array(groups) + "}\n"};
}

}  // namespace candela::master
