// Fetching images: whole, and from the byte on that a broken transfer had.
#include "master/merge/recent_images.h"
#include "tests/unit/master_fixture.h"

namespace candela::master {
namespace {

// Claim: images are kept up to a size and a time, the last asked for longest.
TEST(RecentImages, AreFewAndShort) {
  RecentImages images(1000, 60);
  const EncodedImagePtr a = images.keep(std::string(400, 'a'), 0), b = images.keep(std::string(400, 'b'), 1);
  EXPECT_EQ(images.keep(std::string(400, 'a'), 2), a) << "the same bytes are one image";
  const EncodedImagePtr c = images.keep(std::string(400, 'c'), 3);
  EXPECT_EQ(images.find(b->sha256, 4), nullptr);
  EXPECT_EQ(images.find(a->sha256, 5), a);
  EXPECT_EQ(images.bytes(), 800U);
  EXPECT_EQ(images.find(images.keep(std::string(1001, 'd'), 6)->sha256, 6), nullptr) << "larger than all";
  images.expire(64);
  EXPECT_EQ(images.find(c->sha256, 64), nullptr);
  EXPECT_EQ(images.find(a->sha256, 64), a);
  images.expire(200);
  EXPECT_EQ(images.bytes(), 0U);
}

struct Fetched {
  std::string sha256, bytes;
  std::uint64_t offset = 0, total = 0;
};
Fetched fetch_from(v1::FarmService::Stub& farm, const std::string& id, const std::string& sha256,
                   std::uint64_t offset) {
  v1::FetchImageRequest request;
  request.set_job_id(id);
  request.set_sha256(sha256);
  request.set_offset(offset);
  grpc::ClientContext context;
  const auto reader = farm.FetchImage(&context, request);
  Fetched all;
  v1::FetchImageChunk chunk;
  while (reader->Read(&chunk)) {
    if (all.sha256.empty()) {
      all.sha256 = chunk.sha256();
      all.offset = chunk.offset();
    }
    all.total = chunk.total_bytes();
    all.bytes += chunk.data();
  }
  EXPECT_TRUE(reader->Finish().ok());
  return all;
}

// Claim: an image is fetched from any byte on, the same file although the job has gone on; a master that has
// the file no more says so by another hash, or makes it again.
TEST_F(MasterTest, AnImageIsFetchedFromAnyByteOn) {
  TestWorker w(channel);
  ASSERT_TRUE(w.enrol().ok());
  const std::string id = submit(100);
  ASSERT_TRUE(w.step());
  ASSERT_TRUE(w.step());
  const Fetched whole = fetch_from(*farm, id, "", 0);
  EXPECT_EQ(whole.sha256, sha256_hex(whole.bytes));
  EXPECT_EQ(whole.total, whole.bytes.size());
  ASSERT_TRUE(w.step());  // the job goes on
  for (const std::uint64_t offset : {std::uint64_t{0}, std::uint64_t{1000}, whole.total}) {
    const Fetched rest = fetch_from(*farm, id, whole.sha256, offset);
    EXPECT_EQ(rest.sha256, whole.sha256);
    EXPECT_EQ(rest.offset, offset);
    EXPECT_EQ(rest.total, whole.total);
    EXPECT_EQ(rest.bytes, whole.bytes.substr(offset));
  }
  const Fetched other = fetch_from(*farm, id, std::string(64, '0'), 1000);
  EXPECT_NE(other.sha256, whole.sha256);
  EXPECT_EQ(other.offset, 0U);
  EXPECT_EQ(other.sha256, sha256_hex(other.bytes));
  while (w.step()) {
  }
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  const Fetched last = fetch_from(*farm, id, "", 0);
  farm.reset();
  restart();  // which forgets what was sent
  const Fetched rest = fetch_from(*farm, id, last.sha256, 1000);
  EXPECT_EQ(rest.sha256, last.sha256) << "a job that has ended gives the same file again";
  EXPECT_EQ(rest.bytes, last.bytes.substr(1000));
}

}  // namespace
}  // namespace candela::master
