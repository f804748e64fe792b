// See master_link.h.
#include "worker/service/master_link.h"

#include <algorithm>

#include "common/wire/stall_guard.h"

namespace candela::worker {

Backoff::Backoff(Milliseconds first, Milliseconds longest, std::uint64_t seed)
    : first_(first), longest_(longest), current_(first), stream_(seed) {}

Milliseconds Backoff::next() {
  const auto full = static_cast<double>(current_.count());
  current_ = std::min(current_ * 2, longest_);
  return Milliseconds(
      std::max<std::int64_t>(1, static_cast<std::int64_t>(full * (0.5 + 0.5 * stream_.next_double()))));
}

bool is_unreachable(const grpc::Status& status) {
  return status.error_code() == grpc::StatusCode::UNAVAILABLE ||
         status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED;
}

MasterLink::MasterLink(std::shared_ptr<grpc::Channel> channel)
    : channel_(std::move(channel)), stub_(v1::WorkerService::NewStub(channel_)) {}

MasterLink::Call::Call(MasterLink& link, Lane lane, std::optional<Milliseconds> deadline)
    : link_(link), lane_(static_cast<std::size_t>(lane)) {
  if (deadline) context_.set_deadline(std::chrono::system_clock::now() + *deadline);
  const Lock lock(link_.mutex_);
  open_ = !link_.lanes_[lane_].closed;
  if (open_) link_.lanes_[lane_].calls.insert(&context_);
}

MasterLink::Call::~Call() {
  const Lock lock(link_.mutex_);
  link_.lanes_[lane_].calls.erase(&context_);
}

void MasterLink::close(Lane lane) {
  const Lock lock(mutex_);
  LaneState& state = lanes_[static_cast<std::size_t>(lane)];
  state.closed = true;
  for (grpc::ClientContext* context : state.calls) context->TryCancel();
}

void MasterLink::interrupt(Lane lane) {
  const Lock lock(mutex_);
  for (grpc::ClientContext* context : lanes_[static_cast<std::size_t>(lane)].calls) context->TryCancel();
}

grpc::Status MasterLink::fetch_blob(const v1::FetchBlobRequest& request, const Sink& sink,
                                    Result<void>& sink_error) {
  Call call(*this, Lane::fetch, std::nullopt);
  if (!call.open()) return cancelled();
  wire::StallGuard guard(call.context(), wire::kStall);
  const auto reader = stub_->FetchBlob(&call.context(), request);
  v1::FetchBlobChunk chunk;
  sink_error = {};
  while (reader->Read(&chunk)) {
    sink_error = sink(chunk.data());
    if (!sink_error) {
      call.context().TryCancel();
      break;
    }
    guard.allow(wire::kStall);
  }
  return guard.judge(reader->Finish());
}

grpc::Status MasterLink::push_delta(const v1::DeltaHeader& header, std::string_view bytes,
                                    std::size_t chunk_bytes, v1::PushDeltaResponse& response,
                                    std::atomic<std::uint64_t>& steps) {
  Call call(*this, Lane::push, std::nullopt);
  if (!call.open()) return cancelled();
  wire::StallGuard guard(call.context(), wire::kStall);
  const auto writer = stub_->PushDelta(&call.context(), &response);
  // The header goes alone: the master soon cuts off who has not said who it is, and a slow link is full of
  // data. The bytes follow when the master has a place for them; where it has none, they would only fill the
  // link.
  v1::DeltaChunk chunk;
  *chunk.mutable_header() = header;
  bool going = writer->Write(chunk);
  if (going) writer->WaitForInitialMetadata();
  chunk.clear_header();
  chunk_bytes = std::min(chunk_bytes, wire::kStreamBytes);
  for (std::size_t at = 0; going && at < bytes.size(); at += chunk_bytes) {
    const std::string_view part = bytes.substr(at, chunk_bytes);
    chunk.set_data(part.data(), part.size());
    going = writer->Write(chunk);  // false: the master has answered already, Finish() says what
    if (going) steps.fetch_add(1, std::memory_order_relaxed);
    guard.allow(wire::kStall);
  }
  if (going) writer->WritesDone();
  guard.allow(wire::answer_limit(bytes.size()));
  return guard.judge(writer->Finish());
}

}  // namespace candela::worker
