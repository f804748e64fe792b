// Loading a large mesh against the bare Embree build on it: a bumpy square of N x N quadrangles is written as
// PLY (binary) and OBJ to a folder and loaded as a scene, in turn with a bare build over the same arrays of
// vertices and indices. Wall clock, each in a process of its own, so that peak memory is its own.
//
//   bench_load FOLDER [TRIANGLES [THREADS [ROUNDS]]]      default 10 million triangles, 2 threads, 3 rounds
#include <embree3/rtcore.h>
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <vector>

#include "common/base/files.h"
#include "common/bundle/gather.h"
#include "tests/bench/count_argument.h"
#include "worker/loaders/mesh.h"
#include "worker/scene/scene.h"

namespace {

using namespace candela;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

struct Figures {
  double seconds[2] = {};  // the first part, the rest
  double megabytes = 0;    // peak resident
};

// `body` in a child process, what it measured through a pipe.
Figures apart(const std::function<Figures()>& body) {
  int ends[2];
  if (pipe(ends) != 0) std::abort();
  const pid_t child = fork();
  if (child == 0) {
    Figures figures = body();
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    figures.megabytes = static_cast<double>(usage.ru_maxrss) / 1024;
    const auto written = write(ends[1], &figures, sizeof figures);
    std::_Exit(written == static_cast<ssize_t>(sizeof figures) ? 0 : 1);
  }
  close(ends[1]);
  Figures figures;
  const auto got = read(ends[0], &figures, sizeof figures);
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
  if (got != static_cast<ssize_t>(sizeof figures) || status != 0) {
    std::fprintf(stderr, "bench_load: a run failed\n");
    std::exit(1);
  }
  return figures;
}

loaders::Mesh bumpy(std::uint32_t side) {
  loaders::Mesh mesh;
  for (std::uint32_t y = 0; y <= side; ++y)
    for (std::uint32_t x = 0; x <= side; ++x) {
      const double u = static_cast<double>(x) / side, v = static_cast<double>(y) / side;
      mesh.positions.push_back(
          {static_cast<float>(u), static_cast<float>(v),
           static_cast<float>(0.05 * std::sin(40 * u) * std::cos(31 * v) + 1e-3 * std::sin(900 * u * v))});
    }
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const std::uint32_t a = y * (side + 1) + x, b = a + side + 1;
      mesh.triangles.push_back({a, a + 1, b + 1});
      mesh.triangles.push_back({a, b + 1, b});
    }
  return mesh;
}

void write_ply(const std::filesystem::path& path, const loaders::Mesh& mesh) {
  std::ofstream out(path, std::ios::binary);
  out << "ply\nformat binary_little_endian 1.0\nelement vertex " << mesh.positions.size()
      << "\nproperty float x\nproperty float y\nproperty float z\nelement face " << mesh.triangles.size()
      << "\nproperty list uchar int vertex_indices\nend_header\n";
  out.write(reinterpret_cast<const char*>(mesh.positions.data()),
            static_cast<std::streamsize>(mesh.positions.size() * sizeof(Vec3)));
  for (const auto& t : mesh.triangles) {
    char row[13] = {3};
    std::memcpy(row + 1, t.data(), 12);
    out.write(row, sizeof row);
  }
}

void write_obj(const std::filesystem::path& path, const loaders::Mesh& mesh) {
  std::ofstream out(path, std::ios::binary);
  std::string text;
  const auto flush = [&](bool all) {
    if (all || text.size() > 1u << 20) {
      out << text;
      text.clear();
    }
  };
  for (const Vec3 p : mesh.positions) {
    text += fmt::format("v {:.6f} {:.6f} {:.6f}\n", p.x, p.y, p.z);
    flush(false);
  }
  for (const auto& t : mesh.triangles) {
    text += fmt::format("f {} {} {}\n", t[0] + 1, t[1] + 1, t[2] + 1);
    flush(false);
  }
  flush(true);
}

Figures load_scene(const std::filesystem::path& folder, const std::string& scene_file,
                   const std::string& mesh_file, unsigned threads) {
  Figures figures;
  {
    // The reading alone, for its share; its memory is given back, but its pages may be warm: files are cached
    // in all runs anyway.
    const auto begin = Clock::now();
    auto mapped = MappedFile::open(folder / mesh_file);
    if (!mapped.ok()) std::_Exit(1);
    tbb::task_arena arena(static_cast<int>(threads));
    arena.execute([&] {
      const auto mesh = mesh_file.ends_with(".ply") ? loaders::load_ply((*mapped)->bytes(), mesh_file)
                                                    : loaders::load_obj((*mapped)->bytes(), mesh_file, true);
      if (!mesh.ok()) std::_Exit(1);
    });
    figures.seconds[0] = seconds_since(begin);
  }
  const bundle::DiskSource files(folder);
  const auto description = description::parse_scene(files, scene_file, {});
  if (!description.ok()) std::_Exit(1);
  scene::Scene::Options options;
  options.build_threads = threads;
  const auto begin = Clock::now();
  const auto scene = scene::Scene::build(*description, files, options);
  figures.seconds[1] = seconds_since(begin);
  if (!scene.ok()) std::_Exit(1);
  return figures;
}

Figures bare_embree(std::uint32_t side, unsigned threads) {
  loaders::Mesh mesh = bumpy(side);
  mesh.positions.emplace_back();
  Figures figures;
  const auto begin = Clock::now();
  RTCDevice device = rtcNewDevice(fmt::format("isa=avx2,threads={}", threads).c_str());
  RTCScene scene = rtcNewScene(device);
  rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_MEDIUM);
  rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh.positions.data(), 0,
                             sizeof(Vec3), mesh.positions.size() - 1);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh.triangles.data(), 0,
                             12, mesh.triangles.size());
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(scene);
  figures.seconds[1] = seconds_since(begin);
  return figures;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: bench_load FOLDER [TRIANGLES [THREADS [ROUNDS]]]\n");
    return 2;
  }
  const std::filesystem::path folder(argv[1]);
  const auto triangles =
      static_cast<double>(bench::count_argument("TRIANGLES", argc, argv, 2, 10'000'000, 1e9));
  const auto threads = static_cast<unsigned>(bench::count_argument("THREADS", argc, argv, 3, 2, 1024));
  const auto rounds = static_cast<int>(bench::count_argument("ROUNDS", argc, argv, 4, 3, 1000));
  const auto side = static_cast<std::uint32_t>(std::max(1.0, std::sqrt(triangles / 2)));
  apart([&] {
    const loaders::Mesh mesh = bumpy(side);
    write_ply(folder / "bench.ply", mesh);
    write_obj(folder / "bench.obj", mesh);
    return Figures{};
  });
  struct Kind {
    const char* name;
    const char* mesh;
    const char* flat;
  };
  const std::vector<Kind> kinds = {{"ply, flat", "bench.ply", "true"},
                                   {"ply, smooth", "bench.ply", "false"},
                                   {"obj, flat", "bench.obj", "true"},
                                   {"obj, smooth", "bench.obj", "false"}};
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    std::ofstream(folder / fmt::format("bench{}.xml", i)) << fmt::format(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"/><shape type=\"{}\"><string "
        "name=\"filename\" value=\"{}\"/><boolean name=\"face_normals\" value=\"{}\"/></shape></scene>",
        std::string(kinds[i].mesh).substr(6), kinds[i].mesh, kinds[i].flat);
  }
  std::printf("%.2f million triangles, %u threads; seconds and MB at peak\n", 2e-6 * side * side, threads);
  for (int round = 0; round < rounds; ++round) {
    const Figures bare = apart([&] { return bare_embree(side, threads); });
    std::printf("%-12s                 build %6.2f          %6.0f MB\n", "bare Embree", bare.seconds[1],
                bare.megabytes);
    for (std::size_t i = 0; i < kinds.size(); ++i) {
      const Figures f =
          apart([&] { return load_scene(folder, fmt::format("bench{}.xml", i), kinds[i].mesh, threads); });
      std::printf("%-12s reading %6.2f  whole %6.2f  %4.2f x  %6.0f MB\n", kinds[i].name, f.seconds[0],
                  f.seconds[1], f.seconds[1] / bare.seconds[1], f.megabytes);
    }
  }
  return 0;
}
