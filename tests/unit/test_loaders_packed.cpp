// Files of a scene that are packed by gzip, as the renderer reads them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tests/unit/gzip.h"
#include "tests/unit/renderer_fixture.h"

namespace candela {
namespace {

constexpr const char* kMesh =
    "o roof\nv -1 -1 3\nv 1 -1 3\nv 1 1 4\nv -1 1 4\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
    "g left\nf 1/1 3/3 2/2\ng right\nusemtl none\nf 1/1 4/4 3/3\n";

std::string scene_of(const std::string& ending) {
  return "<scene version='3.0.0'><integrator type='path'/>"
         "<sensor type='perspective'><float name='fov' value='60'/></sensor><emitter type='constant'/>"
         "<shape type='obj'><string name='filename' value='mesh.obj" +
         ending +
         "'/><bsdf type='twosided'><bsdf type='diffuse'><texture name='reflectance' type='bitmap'>"
         "<string name='filename' value='tiles.ppm" +
         ending + "'/></texture></bsdf></bsdf></shape></scene>";
}

std::vector<std::int64_t> film_of(const std::map<std::string, std::string>& contents) {
  const test::TextFiles files(contents);
  JobSettings job;
  job.integrator = "path";
  job.width = job.height = 16;
  const auto renderer = test::make_renderer(files, job, {});
  const auto film = test::render_film(*renderer, 2);
  return {film->sums(), film->sums() + std::size_t{3} * job.width * job.height};
}

// Claim: a packed mesh and a packed texture render to the bits of the unpacked ones.
TEST(LoadersPacked, PackedFilesRenderAlike) {
  const std::string tiles = "P6\n2 2\n255\n\xff\x10\x20\x30\xff\x40\x50\x60\xff\x70\x80\x90";
  const auto plain = film_of({{"scene.xml", scene_of("")}, {"mesh.obj", kMesh}, {"tiles.ppm", tiles}});
  const auto packed = film_of({{"scene.xml", scene_of(".gz")},
                               {"mesh.obj.gz", test::gzip(kMesh)},
                               {"tiles.ppm.gz", test::gzip(tiles)}});
  EXPECT_GT(*std::max_element(plain.begin(), plain.end()), 0);
  EXPECT_EQ(plain, packed);
}

}  // namespace
}  // namespace candela
