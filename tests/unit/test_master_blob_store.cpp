// Blobs on the master's disk: read and checked against their names, set aside where they do not match.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <vector>

#include "master/store/blob_store.h"
#include "tests/temporary_folder.h"
#include "tests/unit/flip_a_bit.h"

namespace candela::master {
namespace {

namespace fs = std::filesystem;
using test::flip_a_bit;

class BlobStoreTest : public testing::Test {
 protected:
  void put(const std::string& bytes) {
    auto upload = store_->begin(sha256_hex(bytes), bytes.size());
    ASSERT_TRUE(upload.ok());
    ASSERT_TRUE((*upload)->append(bytes).ok());
    ASSERT_TRUE((*upload)->finish().ok());
  }
  // The bytes that come, in pieces of seven; and whether they came to their end.
  std::pair<std::string, bool> read(const std::string& hash) {
    auto reader = store_->read(hash);
    EXPECT_TRUE(reader.ok() && *reader);
    std::string all, piece;
    do {
      if (auto more = (*reader)->next(7, piece); !more.ok()) {
        EXPECT_EQ(more.error().kind, ErrorKind::failed) << more.error().to_string();
        return {all, false};
      }
      all += piece;
    } while (!piece.empty());
    return {all, true};
  }
  std::size_t damaged_count() const {
    std::error_code code;
    const fs::directory_iterator files(folder_.path() / "damaged", code);
    return code ? 0 : static_cast<std::size_t>(std::distance(files, fs::directory_iterator()));
  }

  test::TemporaryFolder folder_;
  std::unique_ptr<BlobStore> store_ = std::move(*BlobStore::open(folder_.path()));
};

// Claim: whole blobs are read and checked as what they are, the empty one and one of whole pieces included.
TEST_F(BlobStoreTest, WholeBlobsAreWhole) {
  for (const std::size_t size : {0U, 1U, 7U, 14U, 1000U}) {
    const std::string bytes(size, 'b');
    put(bytes);
    EXPECT_EQ(read(sha256_hex(bytes)), (std::pair<std::string, bool>{bytes, true})) << size;
    EXPECT_TRUE(*store_->check(sha256_hex(bytes))) << size;
  }
  EXPECT_EQ(damaged_count(), 0U);
}

// Claim: a file of this disk becomes a blob if it is what its hash says, and else leaves nothing; taken again
// it costs no reading.
TEST_F(BlobStoreTest, TakesFilesOfThisDisk) {
  const std::string bytes(600000, 't'), hash = sha256_hex(bytes);
  const fs::path file = folder_.path() / "mesh.ply";
  for (const std::string& wrong : {std::string(600000, 'u'), std::string(599999, 't'), bytes + "t"}) {
    std::ofstream(file, std::ios::binary) << wrong;
    const auto taken = store_->take(hash, bytes.size(), file);
    ASSERT_FALSE(taken.ok());
    EXPECT_EQ(taken.error().kind, ErrorKind::failed);
    EXPECT_FALSE(store_->size(hash));
    EXPECT_TRUE(fs::is_empty(folder_.path() / "tmp"));
  }
  std::ofstream(file, std::ios::binary) << bytes;
  ASSERT_TRUE(store_->take(hash, bytes.size(), file).ok());
  EXPECT_TRUE(*store_->check(hash));
  fs::remove(file);
  EXPECT_TRUE(store_->take(hash, bytes.size(), file).ok());
}

// Claim: a changed, shortened or lengthened blob is never given to its end; it is set aside, not removed, and
// missing from then on, until it is uploaded again.
TEST_F(BlobStoreTest, DamagedBlobsAreSetAside) {
  const std::string bytes(1000, 'a'), hash = sha256_hex(bytes);
  const std::vector<std::function<void(const fs::path&)>> damages = {
      [](const fs::path& p) { flip_a_bit(p, 0); }, [](const fs::path& p) { flip_a_bit(p, 999); },
      [](const fs::path& p) { fs::resize_file(p, 999); }, [](const fs::path& p) { fs::resize_file(p, 0); },
      [](const fs::path& p) { fs::resize_file(p, 1001); }};
  std::size_t count = 0;
  for (const bool by_check : {false, true})
    for (const auto& damage : damages) {
      put(bytes);
      damage(store_->path(hash));
      if (by_check)
        EXPECT_FALSE(*store_->check(hash));
      else
        EXPECT_FALSE(read(hash).second);
      EXPECT_FALSE(store_->size(hash));
      EXPECT_FALSE(*store_->read(hash));
      EXPECT_FALSE(*store_->check(hash)) << "missing";
      EXPECT_EQ(damaged_count(), ++count) << "none is lost";
    }
  put(bytes);
  EXPECT_TRUE(*store_->check(hash));
  EXPECT_EQ((*BlobStore::open(folder_.path()))->size(hash), 1000U) << "the next start";
  EXPECT_EQ(damaged_count(), count);
}

// Claim: who reads a damaged file to its end after the blob was uploaded again does not take the new one
// away.
TEST_F(BlobStoreTest, ANewCopyIsNotSetAsideForTheOldOne) {
  const std::string bytes(100, 'a'), hash = sha256_hex(bytes);
  put(bytes);
  flip_a_bit(store_->path(hash), 50);
  auto slow = *store_->read(hash);
  std::string piece;
  ASSERT_TRUE(slow->next(10, piece).ok());
  put(bytes);
  Result<void> more;
  while ((more = slow->next(10, piece)).ok() && !piece.empty()) {
  }
  EXPECT_FALSE(more.ok());
  EXPECT_TRUE(*store_->check(hash));
}

}  // namespace
}  // namespace candela::master
