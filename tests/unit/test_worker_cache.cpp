// The blob cache: verification, eviction, sharing, failures.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>
#include <vector>

#include "common/base/hash.h"
#include "common/rng/stream.h"
#include "tests/temporary_folder.h"
#include "worker/service/blob_cache.h"
#include "worker/service/scene_store.h"

namespace candela::worker {
namespace {

namespace fs = std::filesystem;

class BlobCacheTest : public testing::Test {
 protected:
  std::unique_ptr<BlobCache> open(std::uint64_t limit_bytes) {
    return *BlobCache::open(folder_, limit_bytes);
  }

  // Serves `content` in small pieces and counts.
  BlobCache::Fetch serve(const std::string& content) {
    return [this, content](const std::string&, std::uint64_t, const BlobCache::Sink& sink) -> Result<void> {
      ++fetches_;
      for (std::size_t at = 0; at < content.size(); at += 7) CANDELA_TRY(sink(content.substr(at, 7)));
      return {};
    };
  }
  Result<BlobCache::Mapped> get(BlobCache& cache, const std::string& content) {
    return cache.map(sha256_hex(content), content.size(), serve(content));
  }
  // Makes a file look unused for so many seconds.
  static void age(const fs::path& path, int seconds) {
    fs::last_write_time(path, fs::file_time_type::clock::now() - std::chrono::seconds(seconds));
  }
  std::size_t partial_count() const {
    return static_cast<std::size_t>(
        std::distance(fs::directory_iterator(folder_ / "partial"), fs::directory_iterator()));
  }

  test::TemporaryFolder temporary_;
  fs::path folder_ = temporary_.path();
  std::atomic<int> fetches_{0};
};

// Claim: a blob is fetched once, also by the next process that shares the folder.
TEST_F(BlobCacheTest, FetchedOnce) {
  const std::string content(1000, 'a');
  {
    auto cache = open(1 << 20);
    EXPECT_EQ(get(*cache, content)->bytes, content);
    EXPECT_EQ(get(*cache, content)->bytes, content);
  }
  auto later = open(1 << 20);
  EXPECT_EQ(get(*later, content)->bytes, content);
  EXPECT_EQ(fetches_, 1);
  const auto empty = get(*later, "");
  ASSERT_TRUE(empty.ok());
  EXPECT_TRUE(empty->bytes.empty());
}

// Claim: a bundle's file that is opened twice is read once, and a third time anew; what is released is read
// anew.
TEST_F(BlobCacheTest, ABundleKeepsAFileForTheNextOpen) {
  auto cache = open(1 << 20);
  const std::string content(1000, 'a');
  bundle::Bundle bundle;
  bundle.files.push_back({"mesh.ply", sha256_hex(content), content.size()});
  const BlobCache::Fetch fetch = serve(content);
  BundleSource source(bundle, *cache, fetch);
  const fs::path path = cache->path_of(sha256_hex(content));
  EXPECT_EQ(source.open("mesh.ply")->view, content);
  fs::remove(path);
  EXPECT_EQ(source.open("mesh.ply")->view, content);
  EXPECT_EQ(fetches_, 1);
  EXPECT_EQ(source.open("mesh.ply")->view, content);
  EXPECT_EQ(fetches_, 2);
  fs::remove(path);
  source.release();
  EXPECT_EQ(source.open("mesh.ply")->view, content);
  EXPECT_EQ(fetches_, 3);
  EXPECT_FALSE(source.open("other.ply").ok());
}

// Claim: a bundle's file that is only asked for is not read then, and not kept when it is opened; one that is
// begun or searched for materials is.
TEST_F(BlobCacheTest, ABundleKeepsWhatIsOpenedAgain) {
  const std::string content(1000, 'a');
  for (const auto& [key, begun, fetches] :
       {std::tuple("a.ply", false, 2), std::tuple("a.ply", true, 1), std::tuple("a.obj", false, 1)}) {
    auto cache = open(1 << 20);
    const fs::path path = cache->path_of(sha256_hex(content));
    fs::remove(path);
    bundle::Bundle bundle;
    bundle.files.push_back({key, sha256_hex(content), content.size()});
    const BlobCache::Fetch fetch = serve(content);
    BundleSource source(bundle, *cache, fetch);
    const int before = fetches_;
    EXPECT_TRUE(source.find(key).ok());
    EXPECT_FALSE(source.find("other").ok());
    EXPECT_EQ(fetches_, before);
    EXPECT_EQ((begun ? source.start(key, 10) : source.open(key))->view.substr(0, 10), content.substr(0, 10));
    fs::remove(path);
    EXPECT_EQ(source.open(key)->view, content);
    EXPECT_EQ(fetches_, before + fetches) << key;
  }
}

// Claim: bytes that do not have the name's hash, or another length, are refused and leave nothing behind.
TEST_F(BlobCacheTest, WrongBytesAreRefused) {
  auto cache = open(1 << 20);
  const std::string wanted = "the right bytes";
  for (const std::string& sent :
       {std::string("the wrong bytes"), std::string("short"), std::string("far too many bytes")}) {
    const auto result = cache->map(sha256_hex(wanted), wanted.size(), serve(sent));
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().kind, ErrorKind::failed);
    EXPECT_FALSE(fs::exists(cache->path_of(sha256_hex(wanted))));
    EXPECT_EQ(partial_count(), 0U);
  }
  EXPECT_EQ(get(*cache, wanted)->bytes, wanted);
}

// Claim: a file damaged on disk, cut or changed, is noticed at its first use in a process, and fetched again.
TEST_F(BlobCacheTest, DamagedFilesAreFetchedAgain) {
  const std::string content = "0123456789";
  for (const std::string& damage : {std::string("012345678"), std::string("0123456780"), std::string()}) {
    fs::path path;
    {
      auto cache = open(1 << 20);
      ASSERT_TRUE(get(*cache, content).ok());
      path = cache->path_of(sha256_hex(content));
    }
    std::ofstream(path, std::ios::trunc) << damage;
    const int before = fetches_;
    auto cache = open(1 << 20);
    EXPECT_EQ(get(*cache, content)->bytes, content);
    EXPECT_EQ(fetches_, before + 1);
  }
}

// Claim: a file changed in place while its process runs, of the same inode and size, is noticed at its next
// use: at once, and when the change comes long after the check.
TEST_F(BlobCacheTest, AFileChangedInPlaceIsFetchedAgain) {
  auto cache = open(1 << 20);
  const std::string content = "0123456789";
  const fs::path path = cache->path_of(sha256_hex(content));
  const auto change = [&] {
    std::fstream(path, std::ios::in | std::ios::out | std::ios::binary).seekp(4).put('x').flush();
  };
  ASSERT_TRUE(get(*cache, content).ok());
  change();
  EXPECT_EQ(get(*cache, content)->bytes, content);
  EXPECT_EQ(fetches_, 2);
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  EXPECT_EQ(get(*cache, content)->bytes, content);
  EXPECT_EQ(get(*cache, content)->bytes, content);
  EXPECT_EQ(fetches_, 2) << "a whole file is not fetched again";
  const auto written = fs::last_write_time(path);
  change();
  fs::last_write_time(path, written);  // as a tool that restores times would leave it
  EXPECT_EQ(get(*cache, content)->bytes, content);
  EXPECT_EQ(fetches_, 3);
}

// Claim: a cache folder that somebody removes while its worker runs is made again, whole or in part.
TEST_F(BlobCacheTest, ARemovedFolderIsMadeAgain) {
  auto cache = open(1 << 20);
  const std::string content(1000, 'a');
  for (const fs::path& removed : {folder_, folder_ / "partial", folder_ / "blobs"}) {
    ASSERT_TRUE(get(*cache, content).ok());
    fs::remove_all(removed);
    const int before = fetches_;
    EXPECT_EQ(get(*cache, std::string(1000, 'b'))->bytes, std::string(1000, 'b')) << removed;
    fs::remove_all(removed);
    const auto again = get(*cache, content);
    ASSERT_TRUE(again.ok()) << again.error().to_string();
    EXPECT_EQ(again->bytes, content);
    EXPECT_GT(fetches_, before);
    fs::remove_all(folder_ / "blobs");
  }
}

// Claim: the folder may even go in the middle of a download: what came is fetched again, and nobody fails.
TEST_F(BlobCacheTest, AFolderRemovedDuringADownload) {
  auto cache = open(1 << 20);
  const std::string content = "0123456789";
  int calls = 0;
  const auto fetch = [&](const std::string&, std::uint64_t, const BlobCache::Sink& sink) -> Result<void> {
    CANDELA_TRY(sink(content.substr(0, 5)));
    if (++calls == 1) fs::remove_all(folder_);
    return sink(content.substr(5));
  };
  const auto mapped = cache->map(sha256_hex(content), content.size(), fetch);
  ASSERT_TRUE(mapped.ok()) << mapped.error().to_string();
  EXPECT_EQ(mapped->bytes, content);
  EXPECT_EQ(calls, 2);
}

// Claim: the least recently used blobs go first, and what is mapped or pinned never goes.
TEST_F(BlobCacheTest, EvictsTheOldestButNothingInUse) {
  auto cache = open(1000);
  const std::string a(300, 'a'), b(300, 'b'), c(300, 'c'), d(300, 'd');
  const auto held = get(*cache, a);
  ASSERT_TRUE(get(*cache, b).ok());
  ASSERT_TRUE(get(*cache, c).ok());
  age(cache->path_of(sha256_hex(a)), 300);
  age(cache->path_of(sha256_hex(b)), 100);
  age(cache->path_of(sha256_hex(c)), 200);
  ASSERT_TRUE(get(*cache, d).ok());
  EXPECT_TRUE(fs::exists(cache->path_of(sha256_hex(a)))) << "mapped";
  EXPECT_TRUE(fs::exists(cache->path_of(sha256_hex(b)))) << "used later than c";
  EXPECT_FALSE(fs::exists(cache->path_of(sha256_hex(c))));
  EXPECT_TRUE(fs::exists(cache->path_of(sha256_hex(d))));
  EXPECT_EQ(held->bytes, a);
}

// Claim: where everything is in use, or one blob is larger than the limit, the error says so and names the
// mend.
TEST_F(BlobCacheTest, NoRoomIsAnError) {
  auto cache = open(1000);
  auto first = get(*cache, std::string(600, 'a'));
  ASSERT_TRUE(first.ok());
  const auto second = get(*cache, std::string(600, 'b'));
  ASSERT_FALSE(second.ok());
  EXPECT_EQ(second.error().kind, ErrorKind::resource);
  EXPECT_NE(second.error().mend.find("--cache-size"), std::string::npos);
  EXPECT_EQ(get(*cache, std::string(1001, 'c')).error().kind, ErrorKind::resource);
  EXPECT_EQ(fetches_, 1) << "nothing is downloaded for which there is no room";
  first = failed_error("let go");
  EXPECT_TRUE(get(*cache, std::string(600, 'b')).ok());
}

// Claim: a fetch that fails leaves nothing, and its own error comes through.
TEST_F(BlobCacheTest, FetchErrorsComeThrough) {
  auto cache = open(1 << 20);
  const auto result = cache->map(sha256_hex("x"), 1, [](const auto&, auto, const auto& sink) -> Result<void> {
    CANDELA_TRY(sink("x"));
    return unreachable_error("the line is dead");
  });
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().message, "the line is dead");
  EXPECT_EQ(partial_count(), 0U);
}

// Claim: two caches over one folder (two workers of a host) may fetch, use and evict at once: every mapping
// has the right bytes, and nobody fails.
TEST_F(BlobCacheTest, TwoWorkersShareAFolder) {
  std::vector<std::string> contents;
  for (int i = 0; i < 12; ++i) contents.emplace_back(100, static_cast<char>('a' + i));
  std::atomic<int> wrong{0};
  const auto work = [&](unsigned seed) {
    auto cache = open(500);
    rng::Stream stream(seed);
    for (int i = 0; i < 150; ++i) {
      const std::string& content = contents[stream.next_u32() % contents.size()];
      const auto mapped = get(*cache, content);
      if (!mapped || mapped->bytes != content) ++wrong;
    }
  };
  std::thread one(work, 1), two(work, 2);
  one.join();
  two.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(partial_count(), 0U);
}

// Claim: a file beside the cache takes the place of a download, and is told from one that is not the blob.
TEST_F(BlobCacheTest, AFileBesideIsReadInPlace) {
  const std::string content = "0123456789";
  const fs::path beside = folder_ / "beside";
  const auto cache = *BlobCache::open(folder_ / "cache", 1 << 20, [&](const std::string&) { return beside; });
  const fs::path cached = cache->path_of(sha256_hex(content));
  for (const std::string& wrong : {std::string("012345678x"), std::string("012")}) {
    std::ofstream(beside, std::ios::trunc) << wrong;
    const int before = fetches_;
    EXPECT_EQ(get(*cache, content)->bytes, content);
    EXPECT_EQ(fetches_, before + 1);
    EXPECT_TRUE(fs::exists(beside)) << "it is not this cache's";
    fs::remove(cached);
  }
  fs::remove(beside);
  EXPECT_EQ(get(*cache, content)->bytes, content) << "no file is there";
  fs::remove(cached);
  std::ofstream(beside) << content;
  const int before = fetches_;
  ASSERT_TRUE(cache->ensure(sha256_hex(content), content.size(), serve(content)).ok());
  EXPECT_EQ(get(*cache, content)->bytes, content);
  EXPECT_EQ(fetches_, before);
  EXPECT_FALSE(fs::exists(cached));
}

// Claim: a blob that is on disk is not read before it is mapped, and a damaged one is noticed then.
TEST_F(BlobCacheTest, EnsuredBlobsAreCheckedWhenMapped) {
  auto cache = open(1 << 20);
  const std::string content = "0123456789";
  const auto held = cache->ensure(sha256_hex(content), content.size(), serve(content));
  ASSERT_TRUE(held.ok());
  std::ofstream(cache->path_of(sha256_hex(content)), std::ios::trunc) << "012345678x";
  ASSERT_TRUE(cache->ensure(sha256_hex(content), content.size(), serve(content)).ok());
  EXPECT_EQ(fetches_, 1);
  EXPECT_EQ(get(*cache, content)->bytes, content);
  EXPECT_EQ(fetches_, 2);
}

// Claim: a folder that cannot be made is an error naming it.
TEST_F(BlobCacheTest, UnusableFolder) {
  std::ofstream(folder_ / "file") << "x";
  const auto cache = BlobCache::open(folder_ / "file" / "cache", 1000);
  ASSERT_FALSE(cache.ok());
  EXPECT_NE(cache.error().to_string().find("file"), std::string::npos);
}

}  // namespace
}  // namespace candela::worker
