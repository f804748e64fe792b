// Bundles: gathered from disk, named by content, and checked when they come from elsewhere.
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <cstdlib>
#include <fstream>

#include "common/base/hash.h"
#include "common/bundle/gather.h"
#include "common/job/job.h"
#include "tests/temporary_folder.h"

namespace candela::bundle {
namespace {

namespace fs = std::filesystem;

class Folder : public test::TemporaryFolder {
 public:
  void write(const std::string& name, const std::string& text) const {
    fs::create_directories((path() / name).parent_path());
    std::ofstream(path() / name, std::ios::binary) << text;
  }
};

std::string scene_with(const std::string& filename) {
  return fmt::format(
      "<scene version='3.0.0'>\n<default name='n' value='1'/>\n<shape type='obj'><string name='filename' "
      "value='{}'/>"
      "</shape><shape type='sphere'><float name='radius' value='$n'/></shape></scene>",
      filename);
}

// Claim: a bundle holds exactly the files the scene needs, under keys relative to the scene, with their
// hashes, and its name depends on them and the parameters but not on where the scene lies.
TEST(BundleGather, HoldsWhatTheSceneNeeds) {
  const Folder here;
  const Folder there;
  for (const Folder* folder : {&here, &there}) {
    folder->write("job/scene.xml", scene_with("./models/../../shared/a.obj"));
    folder->write("shared/a.obj", "v 1 2 3\n");
    folder->write("job/unused.obj", "v 0 0 0\n");
  }
  const auto first = gather(here.path() / "job/scene.xml", {});
  ASSERT_TRUE(first.ok()) << first.error().to_string();
  const Bundle& bundle = first->bundle;
  EXPECT_EQ(bundle.main_path, "scene.xml");
  ASSERT_EQ(bundle.files.size(), 2U);
  EXPECT_EQ(bundle.files[0].path, "../shared/a.obj");
  EXPECT_EQ(bundle.files[0].sha256, sha256_hex("v 1 2 3\n"));
  EXPECT_EQ(bundle.files[0].size_bytes, 8U);
  EXPECT_EQ(bundle.files[1].path, "scene.xml");
  ASSERT_NE(bundle.find("scene.xml"), nullptr);
  EXPECT_EQ(bundle.find("unused.obj"), nullptr);
  EXPECT_TRUE(fs::equivalent(first->real_paths.at("../shared/a.obj"), here.path() / "shared/a.obj"));

  const auto elsewhere = gather(there.path() / "job/scene.xml", {});
  ASSERT_TRUE(elsewhere.ok());
  EXPECT_EQ(elsewhere->bundle.hash(), bundle.hash());
  const auto parameter = gather(there.path() / "job/scene.xml", {{"n", "2"}});
  ASSERT_TRUE(parameter.ok());
  EXPECT_NE(parameter->bundle.hash(), bundle.hash());
  there.write("shared/a.obj", "v 1 2 4\n");
  const auto changed = gather(there.path() / "job/scene.xml", {});
  ASSERT_TRUE(changed.ok());
  EXPECT_NE(changed->bundle.hash(), bundle.hash());
}

// Claim: absolute names stay absolute keys, and one file may have two keys.
TEST(BundleGather, AbsoluteAndDoubleKeys) {
  const Folder folder;
  const std::string absolute = (folder.path() / "a.obj").string();
  folder.write("a.obj", "v 1 2 3\n");
  folder.write(
      "scene.xml",
      fmt::format("<scene version='3.0.0'><shape type='obj'><string name='filename' value='{}'/></shape>"
                  "<shape type='obj'><string name='filename' value='a.obj'/></shape></scene>",
                  absolute));
  const auto gathered = gather(folder.path() / "scene.xml", {});
  ASSERT_TRUE(gathered.ok()) << gathered.error().to_string();
  ASSERT_EQ(gathered->bundle.files.size(), 3U);
  EXPECT_EQ(gathered->bundle.files[0].path, absolute);
  EXPECT_EQ(gathered->bundle.files[0].sha256, gathered->bundle.find("a.obj")->sha256);
}

// Claim: the name is the SHA-256 of the text that the header documents.
TEST(BundleGather, HashIsOfTheDocumentedText) {
  const std::string sha = sha256_hex("x");
  const Bundle bundle{"s.xml", {{"s.xml", sha, 1}}, {{"n", "1\n2"}}};
  const std::string text =
      fmt::format("candela bundle 1\n5:s.xml\n1 parameters\n1:n\n3:1\n2\n1 files\n5:s.xml\n{} 1\n", sha);
  EXPECT_EQ(bundle.hash(), sha256_hex(text));
}

// Claim: what is wrong on disk is said by the name it has on disk, and nothing waits.
TEST(BundleGather, ErrorsNameTheFileOnDisk) {
  const Folder folder;
  const std::string scene = (folder.path() / "scene.xml").string();
  const auto message = [&](const fs::path& path) {
    const auto result = gather(path, {});
    return result.ok() ? std::string("ok") : result.error().to_string();
  };
  EXPECT_EQ(message(scene), scene + ": cannot open: No such file or directory");
  EXPECT_EQ(message(folder.path()), folder.path().string() + ": not a regular file");
  EXPECT_EQ(message(folder.path() / ""),
            folder.path().string() + "/: not a scene file (name the scene's XML file)");
  folder.write("scene.xml", scene_with("none.obj"));
  EXPECT_EQ(message(scene), scene + ":3: file 'none.obj': cannot open: No such file or directory");
  folder.write("scene.xml", scene_with("sub"));
  fs::create_directories(folder.path() / "sub");
  EXPECT_EQ(message(scene), scene + ":3: file 'sub': not a regular file");
  folder.write("scene.xml", scene_with("pipe.obj"));
  ASSERT_EQ(::mkfifo((folder.path() / "pipe.obj").c_str(), 0600), 0);
  EXPECT_EQ(message(scene), scene + ":3: file 'pipe.obj': not a regular file");
  folder.write("scene.xml", "");
  EXPECT_EQ(message(scene), scene + ":1: not well-formed XML: no document element found");
}

// Claim: keys are names of files and nothing that could be anything else.
TEST(BundleGather, Keys) {
  for (const std::string key :
       {"a", "a/b.obj", "../a", "../../a b.obj", "/abs/a", "\xC3\xA9.obj", "...", "-"})
    EXPECT_TRUE(is_valid_key(key)) << key;
  for (const std::string key : {"", ".", "..", "a/", "a//b", "./a", "a/../b", "a/..", "/", "//a", "/../a",
                                "a\nb", "a\x7F", "\xFF", "\xC0\xAF", "\xED\xA0\x80"})
    EXPECT_FALSE(is_valid_key(key)) << key;
  EXPECT_FALSE(is_valid_key(std::string_view("a\0b", 3)));
  EXPECT_TRUE(is_valid_key(std::string(Limits::max_path_bytes, 'a')));
  EXPECT_FALSE(is_valid_key(std::string(Limits::max_path_bytes + 1, 'a')));
}

// Claim: a bundle from the wire is refused for each thing that can be wrong with it, by field.
TEST(BundleGather, ValidateRefuses) {
  const std::string sha(64, 'a');
  const Bundle good{"s.xml", {{"a.obj", sha, 5}, {"s.xml", sha, 5}}, {{"n", "1"}}};
  ASSERT_TRUE(validate(good).ok());
  const auto refused = [&](auto change) {
    Bundle bad = good;
    change(bad);
    const auto result = validate(bad);
    return result.ok() ? std::string("ok") : result.error().to_string();
  };
  EXPECT_EQ(refused([](Bundle& b) { b.files.clear(); }), "files: the bundle has no files");
  EXPECT_EQ(refused([](Bundle& b) { b.main_path = std::string("t.xml"); }),
            "main_path: 't.xml' is not one of the bundle's files");
  EXPECT_EQ(refused([](Bundle& b) { b.files[0].path = std::string("x/../a"); }),
            "files.path: 'x/../a' is not a file's name");
  EXPECT_EQ(refused([](Bundle& b) { b.files[0].path = std::string("z"); }),
            "files.path: 's.xml' is out of order or there twice");
  EXPECT_EQ(refused([](Bundle& b) { b.files[0].path = std::string("s.xml"); }),
            "files.path: 's.xml' is out of order or there twice");
  EXPECT_EQ(refused([](Bundle& b) { b.files[1].sha256[3] = 'A'; }),
            "files.sha256: the hash of 's.xml' is not 64 lower-case hex digits");
  EXPECT_EQ(refused([](Bundle& b) { b.files[1].sha256.pop_back(); }),
            "files.sha256: the hash of 's.xml' is not 64 lower-case hex digits");
  EXPECT_EQ(refused([](Bundle& b) { b.files[0].size_bytes = Limits::max_blob_bytes + 1; }),
            "files.size_bytes: 'a.obj' has 68719476737 bytes, more than the limit of 68719476736");
  EXPECT_EQ(refused([](Bundle& b) { b.parameters[""] = std::string("1"); }),
            "parameters: '' is not a parameter's name");
  EXPECT_EQ(refused([](Bundle& b) { b.parameters["a\n"] = std::string("1"); }),
            "parameters: 'a?' is not a parameter's name");
  EXPECT_EQ(refused([](Bundle& b) { b.parameters["a"] = std::string("\xFF"); }),
            "parameters: the value of 'a' is not text in UTF-8");
  EXPECT_EQ(refused([](Bundle& b) { b.parameters["a"] = std::string(5000, 'x'); }),
            "parameters: the value of 'a' has 5000 bytes, more than the limit of 4096");
  EXPECT_EQ(refused([](Bundle& b) {
              for (int i = 0; i < 300; ++i) b.parameters[fmt::format("p{}", i)] = std::string("1");
            }),
            "parameters: 301 parameters, more than the limit of 256");
  EXPECT_EQ(refused([&](Bundle& b) {
              b.files.clear();
              for (int i = 0; i < 17; ++i)
                b.files.push_back({fmt::format("f{}", 100 + i), sha, Limits::max_blob_bytes});
              b.files.push_back({"s.xml", sha, 1});
            }),
            "files.size_bytes: 1168231104513 bytes in all, more than the limit of 1099511627776");
}

// Claim: the hash of a file that frames share is taken once, and anew when the file has changed, also if its
// size has not.
TEST(FileHashes, AreTakenOnceForAFile) {
  const Folder folder;
  folder.write("mesh.ply", "abc");
  const fs::path file = folder.path() / "mesh.ply";
  FileHashes hashes;
  EXPECT_EQ(hashes.sha256(file, "abc"), sha256_hex("abc"));
  EXPECT_EQ(hashes.sha256(file, "xyz"), sha256_hex("abc"))
      << "the file has not changed: nobody reads its bytes";
  folder.write("mesh.ply", "xyz");
  fs::last_write_time(file, fs::last_write_time(file) + std::chrono::seconds(2));
  EXPECT_EQ(hashes.sha256(file, "xyz"), sha256_hex("xyz"));
  folder.write("mesh.ply", "longer");
  EXPECT_FALSE(hashes.known(file)) << "it has changed since";
  EXPECT_EQ(hashes.sha256(file, "longer"), sha256_hex("longer"));
  EXPECT_EQ(hashes.known(file), (std::pair<std::string, std::uint64_t>(sha256_hex("longer"), 6)));
}

// Claim: files that a scene only names or begins, as it does meshes, have the hash of all their bytes, and a
// second scene that shares them does not take it again.
TEST(FileHashes, OfFilesThatAreOnlyNamed) {
  const Folder folder;
  std::string mesh = "ply\nformat binary_little_endian 1.0\nend_header\n" + std::string(300000, 'x');
  folder.write("a.ply", mesh);
  folder.write("s.pbrt", "WorldBegin\nShape \"plymesh\" \"string filename\" \"a.ply\"\n");
  folder.write(
      "s.xml",
      "<scene version='3.0.0'><shape type='ply'><string name='filename' value='a.ply'/></shape></scene>");
  FileHashes hashes;
  for (const char* scene : {"s.xml", "s.pbrt"}) {
    for (FileHashes* shared : {static_cast<FileHashes*>(nullptr), &hashes, &hashes}) {
      const auto gathered = gather(folder.path() / scene, {}, {}, 0, shared);
      ASSERT_TRUE(gathered.ok()) << gathered.error().to_string();
      const File* file = gathered->bundle.find("a.ply");
      ASSERT_NE(file, nullptr);
      EXPECT_EQ(file->sha256, sha256_hex(mesh));
      EXPECT_EQ(file->size_bytes, mesh.size());
    }
  }
  EXPECT_TRUE(hashes.known(folder.path() / "a.ply"));
}

}  // namespace
}  // namespace candela::bundle
