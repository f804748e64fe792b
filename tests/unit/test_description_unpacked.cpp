// Files as readers open them: unpacked, and not more often than needed.
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <string>

#include "common/description/unpacked_files.h"

namespace candela::description {
namespace {

// Counts how often each file is opened.
class CountingSource final : public FileSource {
 public:
  Result<Bytes> open(const std::string& key) const override {
    if (key.starts_with("none")) return input_error("no such file").at(key, 0);
    const auto text = std::make_shared<const std::string>("text of " + key);
    ++opened_[key];
    last_ = text;
    return Bytes{text, *text};
  }
  int opened(const std::string& key) const { return opened_[key]; }
  bool last_is_held() const { return !last_.expired(); }

 private:
  mutable std::map<std::string, int> opened_;
  mutable std::weak_ptr<const std::string> last_;
};

// Claim: a pbrt file that its shapes open in turn is read once, until another one is opened; a mesh is read
// as often as it is opened, and nobody holds it afterwards. What fails is not kept.
TEST(UnpackedFiles, KeepTheLastText) {
  const CountingSource source;
  const UnpackedFiles files(source);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(files.open("a.pbrt")->view, "text of a.pbrt");
  EXPECT_EQ(source.opened("a.pbrt"), 1);
  EXPECT_EQ(files.open("b.pbrt")->view, "text of b.pbrt");
  EXPECT_EQ(files.open("a.pbrt")->view, "text of a.pbrt");
  EXPECT_EQ(source.opened("a.pbrt"), 2);
  EXPECT_FALSE(files.open("none.pbrt").ok());
  EXPECT_FALSE(files.open("none.pbrt").ok());
  for (int i = 0; i < 2; ++i) EXPECT_EQ(files.open("m.ply")->view, "text of m.ply");
  EXPECT_EQ(source.opened("m.ply"), 2);
  EXPECT_FALSE(source.last_is_held());
}

}  // namespace
}  // namespace candela::description
