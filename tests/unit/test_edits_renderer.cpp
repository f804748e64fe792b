// Renderers of jobs with edits: what is refused, what stays to the last bit, and that nothing breaks.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <ctime>
#include <fstream>
#include <sstream>

#include "common/edits/edits.h"
#include "tests/long_form.h"
#include "tests/paths.h"
#include "tests/unit/renderer_fixture.h"
#include "worker/scene/edits/edit_request.h"

namespace candela::render {
namespace {

const std::string kBox = R"(<integrator type="path"><integer name="max_depth" value="5"/></integrator>
  <sensor type="perspective"><transform name="to_world"><lookat origin="0, 0, 3" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
  <shape type="cube" id="walls"><transform name="to_world"><scale value="4"/></transform>
    <bsdf type="twosided"><bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf></bsdf></shape>
  <shape type="sphere" id="ball"><point name="center" x="0.5" y="0" z="0"/><float name="radius" value="0.6"/><bsdf type="dielectric"/></shape>
  <shape type="sphere" id="other"><point name="center" x="-1.5" y="0" z="0"/><float name="radius" value="0.6"/><bsdf type="plastic"/></shape>
  <emitter type="point" id="bulb"><point name="position" x="0" y="2" z="1"/></emitter>)";

test::TextFiles files_of(const std::string& body) {
  return test::TextFiles({{"scene.xml", "<scene version=\"3.0.0\">" + body + "</scene>"}});
}
JobSettings job_of(const std::string& integrator, const std::string& edits) {
  JobSettings job;
  job.integrator = integrator;
  job.width = 8;
  job.height = 6;
  job.edits = edits;
  return job;
}
std::string one(const std::string& members) {
  return R"({"regions": {"r": {"sphere": [0.2, -3, 0, 2]}}, "edits": [{"name": "a", )" + members + "}]}";
}

std::string error_of(const std::string& body, const std::string& integrator, const std::string& edits,
                     const SettingsMap& chosen = {{"max_depth", "5"}}) {
  const test::TextFiles files = files_of(body);
  try {
    static_cast<void>(test::make_renderer(files, job_of(integrator, edits), chosen));
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "none";
}

std::vector<std::int64_t> film_of(const std::string& integrator, const std::string& edits) {
  const test::TextFiles files = files_of(kBox);
  const auto renderer = test::make_renderer(files, job_of(integrator, edits), {{"max_depth", "5"}});
  const auto film = test::render_film(*renderer, 2);
  return {film->sums(), film->sums() + 8 * 6 * 3};
}

// Claim: a job whose edits change nothing has the bits of one without edits; one whose edit acts has others.
TEST(EditRenderers, KeepBitsOfWhatChangesNothing) {
  for (const char* integrator : {"path", "bdpt", "vcm"}) {
    const auto plain = film_of(integrator, "");
    const std::string selects = R"("direction": "light", "select": "LX*X", )";
    EXPECT_EQ(film_of(integrator, one(selects + R"("move": {"from": [1, 1, 1], "to": [1, 1, 1]})")), plain);
    EXPECT_EQ(film_of(integrator, one(selects + R"("scale": 1)")), plain);
    EXPECT_NE(film_of(integrator, one(selects + R"("scale": 0.5)")), plain);
    EXPECT_NE(film_of(integrator, one(selects + R"("rotate": {"axis": [0, 1, 0], "degrees": 30})")), plain);
  }
}

// Claim: each refusal is an error that names the edit, the surface or the integrator.
TEST(EditRenderers, RefuseByName) {
  const std::string acts = R"(, "rotate": {"axis": [0, 1, 0], "degrees": 30})";
  const auto light = [&](const std::string& select) {
    return one(R"("direction": "light", "select": ")" + select + '"' + acts);
  };
  EXPECT_EQ(error_of(kBox, "path", light("LX*X")), "none");
  const std::string veil =
      R"(<shape type="rectangle" id="veil"><bsdf type="mask"><float name="opacity" value="0.5"/><bsdf type="diffuse"/></bsdf></shape>)";
  EXPECT_NE(error_of(kBox + veil, "path", light("LX*X")).find("'veil', which lets light pass straight"),
            std::string::npos);
  EXPECT_EQ(error_of(kBox + veil, "path", light("LX*X{ball}")), "none");
  const std::string border = R"(<shape type="sphere"><bsdf type="null"/></shape>)";
  EXPECT_EQ(error_of(kBox + border, "path", light("LX*X")), "none") << "a null surface is no vertex";
  EXPECT_NE(error_of(kBox, "path", light("LX*S{bull}")).find("edit 'a', column 4"), std::string::npos);
  EXPECT_EQ(error_of(kBox, "vcm", light("LX+S")), "none");
  EXPECT_EQ(error_of(kBox, "path", light("LX+S")), "none");
  EXPECT_NE(error_of(kBox, "light", light("LDS")).find("tell D from G at the surface 'walls'"),
            std::string::npos)
      << error_of(kBox, "light", light("LDS"));
  EXPECT_NE(error_of(kBox + veil, "path", light("LXX")).find("'veil', which lets light pass straight"),
            std::string::npos);
  const std::string sky = R"(<emitter type="constant" id="sky"/>)";
  EXPECT_NE(error_of(kBox + sky, "path", light("L")).find("the lamp 'sky', whose light comes from outside"),
            std::string::npos)
      << error_of(kBox + sky, "path", light("L"));
  EXPECT_EQ(error_of(kBox + sky, "path", light("L{bulb}")), "none");
  EXPECT_EQ(error_of(kBox, "path", light("LX*")), "none");
  const std::string fog =
      R"(<shape type="sphere"><bsdf type="null"/><medium name="interior" type="homogeneous" id="fog"/></shape>)";
  EXPECT_EQ(error_of(kBox + fog, "path", light("L[XV]*V{fog}")), "none");
  const auto first = [&](const std::string& select) {
    return one(R"("direction": "light", "source": "r", "hit": true, "select": ")" + select + '"' + acts);
  };
  EXPECT_EQ(error_of(kBox, "path", first("LX*X")), "none");
  EXPECT_EQ(error_of(kBox, "path", first("LXX")), "none");
  EXPECT_NE(error_of(kBox + fog, "path", first("LX*X{ball}")).find("the scene has media"), std::string::npos);
  EXPECT_NE(error_of(kBox + veil, "path", first("LX*X{ball}"))
                .find("edit 'a' asks what light meets first, and the surface 'veil' lets light pass"),
            std::string::npos)
      << error_of(kBox + veil, "path", first("LX*X{ball}"));
  for (const char* integrator : {"upbp", "optimis", "appm", "cppm", "fppm", "vcmplus"})
    EXPECT_NE(error_of(kBox, integrator, light("LX*X"), {}).find(integrator), std::string::npos);
  std::string many = R"({"edits": [)";
  for (int i = 0; i < 5; ++i)
    many += std::string(i > 0 ? "," : "") + R"({"name": "n)" + std::to_string(i) +
            R"(", "direction": "light", "select": "LX*X")" + acts + "}";
  EXPECT_NE(error_of(kBox, "path", many + "]}").find("more than 4 edits"), std::string::npos);
}

// Claim: the plan says what each edit selects.
TEST(EditRenderers, PlanTheirEdits) {
  const test::TextFiles files = files_of(kBox);
  const auto renderer = test::make_renderer(
      files,
      job_of(
          "bdpt",
          one(R"("direction": "light", "select": "LX*S{ball}", "source": "r", "move": {"to": [1, -3, 0]})")),
      {});
  const auto plan = renderer->plan_text();
  ASSERT_TRUE(plan.ok());
  EXPECT_NE(plan->find("edit 'a': light after LX*S{ball}, 1 of 3 shapes, towards r, moved"),
            std::string::npos)
      << *plan;
  const auto by_path = test::make_renderer(
      files, job_of("path", one(R"("direction": "light", "select": "LX+S{ball}", "scale": 0.5)")), {});
  EXPECT_NE(
      by_path->plan_text()->find("edit 'a': light after LX+S{ball}, by the path: at most 1 of 3 shapes"),
      std::string::npos)
      << *by_path->plan_text();
}

// Claim: the plan says which lamps and media an edit selects, and that it asks for first surfaces.
TEST(EditRenderers, PlanLampsAndMedia) {
  const std::string fog =
      R"(<shape type="sphere"><bsdf type="null"/><medium name="interior" type="homogeneous" id="fog"/></shape>)";
  const auto plan_of = [](const std::string& body, const std::string& members) {
    const test::TextFiles files = files_of(body);
    return *test::make_renderer(files, job_of("bdpt", one(members)), {{"max_depth", "4"}})->plan_text();
  };
  const std::string of_lamps =
      plan_of(kBox, R"("direction": "light", "select": "L", "source": "r", "hit": true, "scale": 0.5)");
  EXPECT_NE(of_lamps.find("edit 'a': light after L, 0 of 3 shapes, 1 of 1 lamps, to first surfaces in r, "
                          "times 0.5"),
            std::string::npos)
      << of_lamps;
  const std::string of_media =
      plan_of(kBox + fog, R"("direction": "eye", "select": "V{fog}[XV]*E", "scale": 0.5)");
  EXPECT_NE(of_media.find("edit 'a': gathered at V{fog}[XV]*E, 0 of 4 shapes, 1 of 1 media"),
            std::string::npos)
      << of_media;
  const std::string by_path = plan_of(kBox + fog, R"("direction": "light", "select": "LV", "scale": 0.5)");
  EXPECT_NE(by_path.find("by the path: at most 0 of 4 shapes, 1 of 1 media"), std::string::npos) << by_path;
}

// Claim: an edit acts at the same place of the file wherever the scene is: a scene far from the origin, whose
// vertices are moved, has the image of the same scene at the origin.
TEST(EditRenderers, ActFarFromTheOrigin) {
  const auto mean_of = [&](double far) {
    const auto at = [&](double x) { return std::to_string(x + far); };
    const test::TextFiles files = files_of(
        R"(<integrator type="path"><integer name="max_depth" value="3"/></integrator>
        <sensor type="perspective"><transform name="to_world"><lookat origin=")" +
        at(0) + R"(, 3, 3" target=")" + at(0) +
        R"(, 0, 0" up="0, 1, 0"/></transform></sensor>
        <shape type="rectangle" id="floor"><transform name="to_world"><rotate x="1" angle="-90"/><scale value="3"/><translate x=")" +
        at(0) + R"("/></transform></shape>
        <shape type="rectangle" id="panel"><transform name="to_world"><translate z="-1" y="1" x=")" +
        at(0) + R"("/></transform></shape>
        <emitter type="point"><point name="position" x=")" +
        at(1) + R"(" y="2" z="1"/><rgb name="intensity" value="10"/></emitter>)");
    const std::string edits = R"({"regions": {"r": {"sphere": [)" + at(0.3) +
                              R"(, 0, 0, 1]}}, "edits": [{"name": "a",
        "direction": "light", "select": "LX*X{panel}", "source": "r", "move": {"to": [)" +
                              at(-0.8) + R"(, 0, 0.5], "normal": [0, 1, 0]}}]})";
    const auto renderer = test::make_renderer(files, job_of("path", edits), {{"max_depth", "3"}});
    const auto film = test::render_film(*renderer, 64);
    std::vector<double> rows(6);
    for (std::size_t i = 0; i < 8 * 6 * 3; ++i)
      rows[i / 24] += std::ldexp(static_cast<double>(film->sums()[i]), -test::kFilmScaleLog2) / (24 * 64);
    return rows;
  };
  const auto near = mean_of(0), far = mean_of(1048576);
  for (std::size_t row = 0; row < near.size(); ++row)
    EXPECT_NEAR(far[row], near[row], 0.02 * near[row] + 1e-4) << row;
}

// Claim: an edit does not know how large the scene is: with all lengths times a power of two, from 1e-4 to
// 1e6, each row of the image stays what it is.
TEST(EditRenderers, ScaleWithTheScene) {
  const auto rows_of = [&](const std::string& integrator, const std::string& move, double s) {
    const auto n = [&](double x) { return fmt::format("{}", x * s); };
    const auto at = [&](double x, double y, double z) { return n(x) + ", " + n(y) + ", " + n(z); };
    const auto panel = [&](const std::string& id, const std::string& turn, double size, double y, double z) {
      return R"(<shape type="rectangle" id=")" + id + R"("><transform name="to_world">)" + turn +
             R"(<scale value=")" + n(size) + R"("/><translate y=")" + n(y) + R"(" z=")" + n(z) +
             R"("/></transform><bsdf type="roughplastic"><float name="alpha" value="0.3"/></bsdf></shape>)";
    };
    const test::TextFiles files = files_of(
        R"(<integrator type="path"><integer name="max_depth" value="4"/></integrator>
        <sensor type="perspective"><float name="near_clip" value=")" +
        n(0.01) + R"("/><float name="far_clip" value=")" + n(100) +
        R"("/><transform name="to_world"><lookat origin=")" + at(0, 3, 3) +
        R"(" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>)" +
        panel("floor", R"(<rotate x="1" angle="-90"/>)", 3, 0, 0) + panel("panel", "", 1, 1, -1) +
        R"(<emitter type="point"><point name="position" value=")" + at(1, 2, 1) +
        R"("/><rgb name="intensity" value=")" + fmt::format("{}", 10 * s * s) + R"("/></emitter>)");
    const std::string edits =
        R"({"regions": {"r": {"sphere": [)" + at(0.3, 0, 0) + ", " + n(1) +
        R"(]}}, "edits": [{"name": "a", "direction": "light", "select": "LX*X{panel}", "source": "r", "move": {"to": [)" +
        at(-0.8, 0, 0.5) + "]" + move + "}}]}";
    const auto renderer = test::make_renderer(files, job_of(integrator, edits), {{"max_depth", "4"}});
    const auto film = test::render_film(*renderer, 32);
    std::vector<double> rows(6);
    for (std::size_t i = 0; i < 8 * 6 * 3; ++i)
      rows[i / 24] += std::ldexp(static_cast<double>(film->sums()[i]), -test::kFilmScaleLog2) / (24 * 32);
    return rows;
  };
  for (const char* integrator : {"path", "light", "bdpt"})
    for (const char* move : {R"(, "normal": [0, 1, 0])", R"(, "stretch": [1.4, 0.8, 1])"}) {
      const auto usual = rows_of(integrator, move, 1);
      for (const double scale : {0x1p-13, 0x1p20}) {
        const auto scaled = rows_of(integrator, move, scale);
        for (std::size_t row = 0; row < usual.size(); ++row)
          EXPECT_NEAR(scaled[row], usual[row], 2e-3 * usual[row] + 1e-6)
              << integrator << " times " << scale << " row " << row;
      }
      EXPECT_GT(usual[3], 1e-3);
    }
}

// Claim: an edit of one lobe changes what that lobe scatters, and nothing else: halving one and halving the
// other take away half of the image between them.
TEST(EditRenderers, ChangeTheLobesThatTheySelect) {
  const test::TextFiles files =
      files_of(R"(<integrator type="path"><integer name="max_depth" value="2"/></integrator>
    <sensor type="perspective"><transform name="to_world"><lookat origin="0, 0, 3" target="0, 0, 0" up="0, 1, 0"/></transform></sensor>
    <shape type="rectangle" id="panel"><transform name="to_world"><scale value="3"/></transform>
      <bsdf type="roughplastic"><float name="alpha" value="0.2"/></bsdf></shape>
    <emitter type="point"><point name="position" x="0" y="0.5" z="2"/></emitter>)");
  const auto sum_of = [&](const std::string& select) {
    const std::string edits =
        select.empty() ? "" : one(R"("direction": "light", "scale": 0.5, "select": ")" + select + '"');
    const auto renderer = test::make_renderer(files, job_of("path", edits), {{"max_depth", "2"}});
    const auto film = test::render_film(*renderer, 16);
    double sum = 0;
    for (std::size_t i = 0; i < 8 * 6 * 3; ++i) sum += static_cast<double>(film->sums()[i]);
    return sum;
  };
  const double whole = sum_of(""), diffuse = sum_of("LX*D{panel}"), glossy = sum_of("LX*G{panel}");
  EXPECT_LT(diffuse, 0.95 * whole);
  EXPECT_LT(glossy, 0.95 * whole);
  EXPECT_NEAR(diffuse + glossy, 1.5 * whole, 1e-3 * whole);
}

// Claim: the edits of docs/inspect.md are read, and select surfaces of their scenes.
TEST(EditRenderers, HaveTheExamples) {
  for (const auto& [scene, edits] : {std::pair<std::string, std::string>{"studio", "edits/caustic.json"},
                                     {"studio", "edits/reflection.json"},
                                     {"studio", "edits/bounce.json"},
                                     {"studio", "edits/turned.json"},
                                     {"cornell", "edits.json"},
                                     {"window", "edits.json"}}) {
    const auto folder = test::source_path("deploy/scenes") / scene;
    const auto text_of = [](const std::filesystem::path& path) {
      std::ifstream file(path);
      std::stringstream text;
      text << file.rdbuf();
      return text.str();
    };
    std::map<std::string, std::string> contents{{"scene.xml", text_of(folder / "scene.xml")}};
    if (scene == "studio") contents["knot.obj"] = text_of(folder / "knot.obj");
    const test::TextFiles files(contents);
    const auto renderer =
        test::make_renderer(files, job_of("bdpt", text_of(folder / edits)), {{"max_depth", "6"}});
    const auto plan = renderer->plan_text();
    ASSERT_TRUE(plan.ok());
    EXPECT_NE(plan->find("edit '"), std::string::npos) << edits;
    EXPECT_EQ(plan->find(" 0 of "), std::string::npos) << edits << "\n" << *plan;
    const std::string doc = text_of(test::source_path("docs/inspect.md"));
    EXPECT_NE(doc.find(edits), std::string::npos);
  }
}

// Claim: random edits, of surfaces, lamps and media, from both ends, by first surfaces, with layers and
// without, are refused with a message, or rendered without a sample that is not finite and without a stall.
TEST(EditRenderers, SurviveRandomEdits) {
  rng::Stream stream(rng::key(77));
  const auto number = [&](double low, double high) {
    return fmt::format("{}", low + (high - low) * stream.next_double());
  };
  const auto point = [&](double size) {
    return '[' + number(-size, size) + ", " + number(-size, size) + ", " + number(-size, size) + ']';
  };
  const auto any = [&](std::initializer_list<const char*> of) {
    return std::string(of.begin()[stream.next_u32() % of.size()]);
  };
  const std::string fog =
      R"(<shape type="cube"><transform name="to_world"><scale value="1.5"/></transform><bsdf type="null"/>
        <medium name="interior" type="homogeneous" id="fog"><rgb name="sigma_t" value="0.7"/>
        <phase type="hg"><float name="g" value="0.6"/></phase></medium></shape>
      <shape type="rectangle" id="panel"><transform name="to_world"><scale value="0.5"/><translate z="-3"/></transform>
        <emitter type="area"/></shape>
      <emitter type="spot" id="spot"/>)";
  const test::TextFiles clear = files_of(kBox), with_fog = files_of(kBox + fog);
  int rendered = 0, refused = 0, by_path = 0, lamps = 0, media = 0, hits = 0, layered = 0, chains = 0;
  for (int i = 0; i < (test::long_form() ? 1000 : 44); ++i) {
    const std::clock_t begin = std::clock();
    const bool foggy = stream.next_u32() % 2 == 0;
    std::string list;
    for (std::uint32_t n = 1 + stream.next_u32() % 3, k = 0; k < n; ++k) {
      const bool light = stream.next_u32() % 2 == 0;
      std::string token = any({"X", "S", "D", "G", "[DG]", "SR", "ST", "X{ball}", "X{walls}", "S{other}",
                               "X@r ", "V", "V{fog}", "V@r ", "[XV]", "DX"});
      if (!foggy && token.starts_with('V') && stream.next_u32() % 4 != 0) token = "D";
      // Selections by the path.
      const std::string between = any({"", "", "", "X", "S", "X{walls}", "X{ball}X", "X@s ", "XX*S"});
      list += std::string(k > 0 ? "," : "") + R"({"name": "n)" + std::to_string(k) + R"(", "direction": ")" +
              (light ? "light" : "eye") + R"(", "select": ")" +
              (light ? "LX*" + between + token : token + between + "X*E") + '"';
      const bool lamp = light && stream.next_u32() % 4 == 0;
      if (lamp) {
        list.erase(list.rfind(R"("LX*)"));
        list += any({R"("L")", R"("L{bulb}")", R"("L{spot}|L{panel}")", R"("LX*")", R"("L{sky}")"});
      }
      if (stream.next_u32() % 2 == 0) {
        list += R"(, "source": ")" + any({"r", "s"}) + '"';
        if (stream.next_u32() % (foggy ? 8 : 2) == 0) list += R"(, "hit": true)";
      }
      switch (stream.next_u32() % 4) {
        case 0:
          list += R"(, "rotate": {"axis": )" + point(1) + R"(, "degrees": )" + number(-360, 360) + '}';
          break;
        case 1:
          list += R"(, "move": {"from": )" + point(5) + R"(, "to": )" + point(5) + '}';
          break;
        case 2:
          list += R"(, "move": {"from": )" + point(5) + R"(, "to": )" + point(5) + R"(, "normal": )" +
                  point(1) + R"(, "stretch": )" + point(stream.next_u32() % 4 == 0 ? 1000 : 2) + '}';
          break;
        default:
          list += R"(, "scale": )" + number(-0.1, 2) + R"(, "tint": [1, 0, )" + number(0, 3) + ']';
      }
      list += '}';
    }
    const std::string text = R"({"regions": {"r": {"sphere": [0, -3, 0, )" + number(0.01, 4) +
                             R"(]}, "s": {"box": [-4, -4, -4, 0, 0, )" + number(-3, 4) +
                             R"(]}}, "edits": [)" + list + "]}";
    const std::string integrator =
        any({"path", "light", "path", "light", "bdpt", "vcm", "bpm", "ppm", "pssmlt", "mmlt"});
    const test::TextFiles& files = foggy ? with_fog : clear;
    JobSettings job = job_of(integrator, text);
    job.width = job.height = 5;
    const std::uint32_t layers = stream.next_u32() % 4;
    if (layers == 0) job.layers = "light-groups";
    if (layers == 1) job.layers = "layer a=L[DGSV]*D[SG]+E; layer b=L[DGSV]*X{ball}[DGSV]*E";
    std::unique_ptr<Renderer> renderer;
    try {
      renderer = test::make_renderer(files, job, {{"max_depth", "6"}});
    } catch (const std::runtime_error& error) {
      EXPECT_GT(std::string(error.what()).size(), 10u);
      ++refused;
      continue;
    }
    film::SampleCounts sample_counts;
    if (integrator.ends_with("mlt")) {
      const NamedState state = test::state_at(*renderer, test::kFilmScaleLog2);
      UnitOutput bootstrap;
      ASSERT_TRUE(renderer->run({Unit::Kind::bootstrap, 0, 0, 64}, {state, {}, {}}, bootstrap, {1}).ok());
      for (const float value : bootstrap.table) EXPECT_TRUE(std::isfinite(value)) << integrator << text;
      sample_counts = bootstrap.counts;
      ++chains;
    } else {
      sample_counts = test::render_film(*renderer, 1)->sample_counts();
    }
    for (const std::uint64_t count : sample_counts.rejected) EXPECT_EQ(count, 0u) << integrator << text;
    EXPECT_LT(std::clock() - begin, 20 * CLOCKS_PER_SEC) << integrator << text;
    ++rendered;
    layered += job.layers.empty() ? 0 : 1;
    const std::string plan = *renderer->plan_text();
    for (const auto& [words, count] : {std::pair("by the path", &by_path),
                                       {" lamps", &lamps},
                                       {" media", &media},
                                       {"first surfaces", &hits}})
      *count += plan.find(words) != std::string::npos ? 1 : 0;
  }
  for (const int count : {by_path, lamps, media, layered}) EXPECT_GT(count, test::long_form() ? 50 : 1);
  for (const int count : {hits, chains}) EXPECT_GT(count, test::long_form() ? 20 : 0);
  EXPECT_GT(rendered, test::long_form() ? 400 : 15);
  EXPECT_GT(refused, test::long_form() ? 100 : 5);
}

}  // namespace
}  // namespace candela::render
