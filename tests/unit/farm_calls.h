// Calls of the client's side of the protocol in tests of a master: call by call, with a word where one
// fails.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <string>

#include "candela/v1/client.grpc.pb.h"
#include "common/base/hash.h"
#include "common/wire/wire.h"

namespace candela::test {

using FarmStub = v1::FarmService::Stub;

inline grpc::Status upload(FarmStub& farm, const std::string& bytes, const std::string& hash,
                           std::uint64_t size) {
  grpc::ClientContext context;
  v1::UploadBlobResponse response;
  auto stream = farm.UploadBlob(&context, &response);
  v1::UploadBlobRequest chunk;
  chunk.set_sha256(hash);
  chunk.set_size_bytes(size);
  chunk.set_data(bytes);
  stream->Write(chunk);
  stream->WritesDone();
  return stream->Finish();
}

// For a bundle that is one file.
inline v1::SubmitRequest submission(const std::string& scene, const JobSettings& settings,
                                    std::uint64_t iterations) {
  v1::SubmitRequest request;
  request.set_name("test");
  request.mutable_bundle()->set_main_path("scene.xml");
  v1::BundleFile& file = *request.mutable_bundle()->add_files();
  file.set_path("scene.xml");
  file.set_sha256(sha256_hex(scene));
  file.set_size_bytes(scene.size());
  wire::to_proto(settings, *request.mutable_settings());
  request.mutable_stop()->set_iterations(iterations);
  return request;
}

// Uploads and submits; the job's id.
inline std::string submit(FarmStub& farm, const std::string& scene, const v1::SubmitRequest& request) {
  EXPECT_TRUE(upload(farm, scene, sha256_hex(scene), scene.size()).ok());
  v1::SubmitResponse response;
  grpc::ClientContext context;
  const grpc::Status status = farm.Submit(&context, request, &response);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return response.job_id();
}

inline v1::JobStatus show(FarmStub& farm, const std::string& id) {
  v1::GetJobRequest request;
  request.set_job_id(id);
  v1::JobStatus out;
  grpc::ClientContext context;
  EXPECT_TRUE(farm.GetJob(&context, request, &out).ok());
  return out;
}

inline v1::GetLedgerResponse ledger(FarmStub& farm, const std::string& id) {
  v1::GetLedgerRequest request;
  request.set_job_id(id);
  v1::GetLedgerResponse out;
  grpc::ClientContext context;
  EXPECT_TRUE(farm.GetLedger(&context, request, &out).ok());
  return out;
}

// The image's file.
inline std::string fetch(FarmStub& farm, const v1::FetchImageRequest& request) {
  grpc::ClientContext context;
  auto stream = farm.FetchImage(&context, request);
  v1::FetchImageChunk chunk;
  std::string bytes;
  while (stream->Read(&chunk)) bytes += chunk.data();
  const grpc::Status status = stream->Finish();
  EXPECT_TRUE(status.ok()) << status.error_message();
  return bytes;
}

}  // namespace candela::test
