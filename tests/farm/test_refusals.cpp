// Bad input of every kind gives one clear line and the right exit code; strangers do not get in.
#include <fmt/format.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <ostream>
#include <sstream>

#include "tests/farm/certificates.h"
#include "tests/farm/farm.h"
#include "tests/paths.h"

namespace candela::farm {
namespace {

std::string read_text(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

// One line on standard error with all of `words`, nothing on standard output.
void expect_refused(const CommandResult& result, int exit_code, const std::vector<std::string>& words) {
  EXPECT_EQ(result.exit_code, exit_code) << result.err;
  EXPECT_TRUE(result.out.empty()) << result.out;
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  for (const std::string& word : words)
    EXPECT_NE(result.err.find(word), std::string::npos) << word << " in: " << result.err;
  EXPECT_LT(result.seconds, 20);
}

// ---- scenes
// ---------------------------------------------------------------------------------------------------

struct BadScene {
  const char* name;
  const char* body;  // between <scene> and </scene>, from line 3 on
  std::vector<std::string> words;
};

void PrintTo(const BadScene& scene, std::ostream* out) {
  *out << scene.name;
}

class BadScenes : public testing::TestWithParam<BadScene> {};

// Claim: a malformed scene ends `render` with exit 2 and one line naming the file, the line and what is
// wrong, before anything is written.
TEST_P(BadScenes, OneClearLine) {
  Farm farm;
  const auto scene = farm.folder() / "bad.xml";
  std::ofstream(scene) << "<?xml version=\"1.0\"?>\n<scene version=\"3.0.0\">\n"
                       << GetParam().body << "\n</scene>\n";
  const auto out = farm.folder() / "bad.exr";
  const CommandResult result = farm.candela({"render", scene.string(), "-o", out.string(), "--integrator",
                                             "path", "--iterations", "1", "--size", "8x8"});
  std::vector<std::string> words = GetParam().words;
  words.push_back("bad.xml");
  expect_refused(result, 2, words);
  EXPECT_FALSE(std::filesystem::exists(out));
  EXPECT_FALSE(std::filesystem::exists(out.string() + ".candela")) << "state of a render that never was";
}

const char* const kSensor = "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>";

INSTANTIATE_TEST_SUITE_P(
    , BadScenes,
    testing::Values(
        BadScene{"UnknownPlugin", "<shape type=\"spehre\"/>", {"bad.xml:3", "spehre", "sphere"}},
        BadScene{"UnknownParameter",
                 "<shape type=\"sphere\">\n<float name=\"radios\" value=\"1\"/></shape>",
                 {"bad.xml:4", "radios", "radius"}},
        BadScene{"UnknownBsdf", "<bsdf type=\"difuse\" id=\"a\"/>", {"bad.xml:3", "difuse", "diffuse"}},
        BadScene{"NotANumber",
                 "<shape type=\"sphere\">\n\n<float name=\"radius\" value=\"big\"/></shape>",
                 {"bad.xml:5", "big"}},
        BadScene{"WrongType",
                 "<shape type=\"sphere\"><string name=\"radius\" value=\"1\"/></shape>",
                 {"bad.xml:3", "radius"}},
        BadScene{"NegativeRadius",
                 "<shape type=\"sphere\"><float name=\"radius\" value=\"-1\"/></shape>",
                 {"bad.xml:3", "radius"}},
        BadScene{"ReflectanceAboveOne",
                 "<bsdf type=\"diffuse\" id=\"a\"><rgb name=\"reflectance\" value=\"2, 0, 0\"/></bsdf>",
                 {"bad.xml:3", "reflectance"}},
        BadScene{"UnknownReference",
                 "<shape type=\"sphere\">\n<ref id=\"nowhere\"/></shape>",
                 {"bad.xml:4", "nowhere"}},
        BadScene{"UnknownDollar",
                 "<shape type=\"sphere\"><float name=\"radius\" value=\"$r\"/></shape>",
                 {"bad.xml:3", "r"}},
        BadScene{"NotClosed", "<shape type=\"sphere\">", {"bad.xml:"}},
        BadScene{"MissingMesh",
                 "<shape type=\"obj\"><string name=\"filename\" value=\"none.obj\"/></shape>",
                 {"none.obj"}},
        BadScene{"MissingTexture",
                 "<bsdf type=\"diffuse\" id=\"a\"><texture type=\"bitmap\" name=\"reflectance\">\n<string "
                 "name=\"filename\" value=\"none.png\"/></texture></bsdf>",
                 {"none.png"}},
        BadScene{"NoSensor", "<shape type=\"sphere\"/>", {"sensor"}}),
    [](const testing::TestParamInfo<BadScene>& one) { return std::string(one.param.name); });

// Claim: what is no scene at all is an error too, not a crash.
TEST(Files, ThatAreNoScenes) {
  Farm farm;
  const std::string out = (farm.folder() / "o.exr").string();
  const auto render = [&](const std::string& scene) {
    return farm.candela({"render", scene, "-o", out, "--integrator", "path", "--iterations", "1"});
  };
  expect_refused(render((farm.folder() / "absent.xml").string()), 2, {"absent.xml"});
  expect_refused(render(farm.folder().path().string()), 2, {farm.folder().path().filename().string()});
  std::ofstream(farm.folder() / "empty.xml");
  expect_refused(render((farm.folder() / "empty.xml").string()), 2, {"empty.xml"});
  std::ofstream(farm.folder() / "binary.xml") << std::string("\0\1\2\xff<scene", 10);
  expect_refused(render((farm.folder() / "binary.xml").string()), 2, {"binary.xml"});
  // A mesh of garbage, found while the scene is compiled.
  std::ofstream(farm.folder() / "bad.obj") << "v 1 2 3\nv 1 2\nf 1 2 99\n";
  std::ofstream(farm.folder() / "mesh.xml")
      << "<scene version=\"3.0.0\">" << kSensor
      << "<shape type=\"obj\"><string name=\"filename\" value=\"bad.obj\"/></shape>"
      << "<emitter type=\"constant\"/></scene>";
  // The farm in the process may log on the way; the last line is the error itself.
  const CommandResult mesh = render((farm.folder() / "mesh.xml").string());
  EXPECT_EQ(mesh.exit_code, 2) << mesh.err;
  EXPECT_NE(mesh.err.find("candela: error: bad.obj:2: "), std::string::npos) << mesh.err;
}

// ---- options
// --------------------------------------------------------------------------------------------------

struct BadOption {
  const char* name;
  std::vector<std::string> arguments;  // OUT and SCENE stand for files
  std::vector<std::string> words;
};

void PrintTo(const BadOption& option, std::ostream* out) {
  *out << option.name;
}

class BadOptions : public testing::TestWithParam<BadOption> {};

// Claim: a bad option ends the command with exit 2 and one line naming it.
TEST_P(BadOptions, OneClearLine) {
  Farm farm;
  std::vector<std::string> arguments = GetParam().arguments;
  for (std::string& word : arguments) {
    if (word == "OUT") word = (farm.folder() / "out.exr").string();
    if (word == "SCENE") word = scene_path("cornell");
  }
  expect_refused(farm.candela(arguments), 2, GetParam().words);
  EXPECT_FALSE(std::filesystem::exists(farm.folder() / "out.exr"));
}

INSTANTIATE_TEST_SUITE_P(
    , BadOptions,
    testing::Values(
        BadOption{"Unknown", {"render", "SCENE", "-o", "OUT", "--iteratoins", "4"}, {"--iteratoins"}},
        BadOption{
            "ZeroIterations", {"render", "SCENE", "-o", "OUT", "--iterations", "0"}, {"--iterations", "0"}},
        BadOption{"NegativeIterations",
                  {"render", "SCENE", "-o", "OUT", "--iterations=-5"},
                  {"--iterations", "-5"}},
        BadOption{"HugeIterations",
                  {"render", "SCENE", "-o", "OUT", "--iterations", "99999999999999999999"},
                  {"--iterations"}},
        BadOption{"WordIterations",
                  {"render", "SCENE", "-o", "OUT", "--iterations", "many"},
                  {"--iterations", "many"}},
        BadOption{
            "BadTime", {"render", "SCENE", "-o", "OUT", "--time", "10parsecs"}, {"--time", "10parsecs"}},
        BadOption{"BadUntil", {"render", "SCENE", "-o", "OUT", "--until", "rmse=1"}, {"--until"}},
        BadOption{"NanUntil", {"render", "SCENE", "-o", "OUT", "--until", "relmse=nan"}, {"--until"}},
        BadOption{"BadSize", {"render", "SCENE", "-o", "OUT", "--size", "100"}, {"--size", "100"}},
        BadOption{"HugeSize", {"render", "SCENE", "-o", "OUT", "--size", "65536x65536"}, {"--size"}},
        BadOption{"BadSeed", {"render", "SCENE", "-o", "OUT", "--seed", "-1"}, {"--seed"}},
        BadOption{
            "BadFilter", {"render", "SCENE", "-o", "OUT", "--filter", "bocks"}, {"--filter", "bocks", "box"}},
        BadOption{"BadSampler",
                  {"render", "SCENE", "-o", "OUT", "--sampler", "sobel"},
                  {"--sampler", "sobel", "sobol"}},
        BadOption{
            "BadIntegrator", {"render", "SCENE", "-o", "OUT", "--integrator", "pahts"}, {"pahts", "path"}},
        BadOption{
            "BadSetting", {"render", "SCENE", "-o", "OUT", "--set", "max_deph=3"}, {"max_deph", "max_depth"}},
        BadOption{"SettingWithoutValue",
                  {"render", "SCENE", "-o", "OUT", "--set", "max_depth"},
                  {"--set", "max_depth"}},
        BadOption{"SettingNoNumber",
                  {"render", "SCENE", "-o", "OUT", "--set", "max_depth=deep"},
                  {"max_depth", "deep"}},
        BadOption{"BadDefine", {"render", "SCENE", "-o", "OUT", "-D", "spp"}, {"spp"}},
        BadOption{"ZeroThreads", {"render", "SCENE", "-o", "OUT", "--threads", "0"}, {"--threads"}},
        BadOption{"ZeroWorkers", {"render", "SCENE", "-o", "OUT", "--workers", "0"}, {"--workers"}},
        BadOption{
            "FolderMissing", {"render", "SCENE", "-o", "/nonexistent/folder/o.exr"}, {"/nonexistent/folder"}},
        BadOption{"NotExr", {"render", "SCENE", "-o", "/tmp/o.tiff"}, {"o.tiff"}},
        BadOption{"NothingToResume", {"render", "SCENE", "-o", "OUT", "--resume"}, {"--resume"}},
        BadOption{"NoMaster", {"list"}, {"--master"}},
        BadOption{"BadMaster", {"list", "--master", "nowhere"}, {"nowhere"}},
        BadOption{"InsecureRemote", {"list", "--master", "192.0.2.1:7070"}, {"--insecure"}},
        BadOption{"NoCommand", {"rendr"}, {"rendr"}},
        BadOption{"CompareMissing",
                  {"compare", "/nonexistent/a.exr", "/nonexistent/b.exr"},
                  {"/nonexistent/a.exr"}},
        BadOption{"ConvertMissing", {"convert", "/nonexistent/a.exr", "/tmp/o.png"}, {"/nonexistent/a.exr"}}),
    [](const testing::TestParamInfo<BadOption>& one) { return std::string(one.param.name); });

// Claim: the program's exit codes and streams are those of the function behind it, in which the tests above
// run commands: 0, 1 for a job that did not get done, 2 and 3; one line of each error on standard error.
TEST(Processes, EndAsTheirCommandsDo) {
  Farm farm;
  farm.start_master();
  const std::string id = farm.submit(4);
  const CommandResult listed = farm.candela_process({"list"});
  EXPECT_EQ(listed.exit_code, 0) << listed.err;
  EXPECT_NE(listed.out.find(id.substr(0, 5)), std::string::npos);
  EXPECT_EQ(farm.candela_process({"cancel", id}).exit_code, 0);
  EXPECT_EQ(farm.candela_process({"watch", id, "--quiet"}).exit_code, 1);
  expect_refused(farm.candela_process({"show", "nojob"}), 2, {"nojob"});
  expect_refused(farm.candela_process({"lsit"}), 2, {"lsit", "list"});
  expect_refused(farm.candela_process({"list", "--master", "127.0.0.1:1", "--timeout", "1s"}), 3,
                 {"127.0.0.1:1"});
}

// Claim: a master that is not there is exit 3 (try again), within the time given.
TEST(Unreachable, IsExitThree) {
  Farm farm;
  const CommandResult result = farm.candela({"list", "--master", "127.0.0.1:1", "--timeout", "1s"});
  expect_refused(result, 3, {"127.0.0.1:1"});
}

// Claim: an unknown job is exit 2, and says which.
TEST(UnknownJob, IsNamed) {
  Farm farm;
  farm.start_master_here();
  for (const std::vector<std::string>& command :
       std::vector<std::vector<std::string>>{{"show", "nojob"},
                                             {"pause", "nojob"},
                                             {"cancel", "nojob"},
                                             {"extend", "nojob", "--iterations", "+1"},
                                             {"watch", "nojob"}})
    expect_refused(farm.candela(command), 2, {"nojob"});
}

// Claim: a master refuses bad options with exit 2 and one line, and two masters never share a store or a
// port.
TEST(MasterOptions, AreChecked) {
  Farm farm;
  farm.start_master();
  const std::string program = test::program_path("candela-master");
  const std::string other = (farm.folder() / "other").string(), same = (farm.folder() / "data").string();
  struct Case {
    std::vector<std::string> arguments;
    std::vector<std::string> words;
    int exit_code;
  };
  const std::vector<Case> cases = {
      {{"--listen", "0.0.0.0:0", "--data", other}, {"--insecure"}, 2},
      {{"--listen", "127.0.0.1:0", "--http", "0.0.0.0:0", "--data", other}, {"--http", "--insecure"}, 2},
      {{"--listen", "nonsense", "--data", other}, {"--listen"}, 2},
      {{"--listen", "127.0.0.1:70000", "--data", other}, {"--listen"}, 2},
      {{"--listen", "127.0.0.1:0", "--data", other, "--lease-time", "-1"}, {"--lease-time"}, 2},
      {{"--listen", "127.0.0.1:0", "--data", other, "--unit-time", "soon"}, {"--unit-time"}, 2},
      {{"--listen", "127.0.0.1:0", "--data", other, "--tls-cert", "/nonexistent/c.pem"}, {"--tls"}, 2},
      {{"--listen", "127.0.0.1:0", "--data", same}, {"data"}, -1},
      {{"--listen", farm.address(), "--data", other}, {farm.address()}, -1},
  };
  for (const Case& c : cases) {
    std::vector<std::string> arguments = {program};
    arguments.insert(arguments.end(), c.arguments.begin(), c.arguments.end());
    Process process(arguments, farm.folder() / "bad-master", farm.environment());
    const auto exit_code = process.wait(20);
    const std::string text = fmt::format("{}", fmt::join(c.arguments, " "));
    ASSERT_TRUE(exit_code.has_value()) << "it runs: " << text;
    EXPECT_NE(*exit_code, 0) << text;
    EXPECT_LT(*exit_code, 128) << "it crashed: " << text;
    if (c.exit_code >= 0) {
      EXPECT_EQ(*exit_code, c.exit_code) << text << ": " << process.err();
    }
    for (const std::string& word : c.words)
      EXPECT_NE(process.err().find(word), std::string::npos) << word << " in: " << process.err();
  }
}

// ---- TLS
// ------------------------------------------------------------------------------------------------------

// Claim: with mutual TLS the farm works as ever; a client or worker without a certificate, or with one of
// another authority, gets nothing; and with TLS the master may listen beyond loopback.
TEST(Tls, MutualOrNothing) {
  Farm farm;
  const Certificates certificates(farm.folder().path());
  if (!certificates.made()) GTEST_SKIP() << "openssl is not installed";
  std::vector<std::string> options = certificates.options("server");
  for (const char* word : {"--unit-time", "0.05"}) options.push_back(word);
  farm.start_master(options);
  farm.set_client_options(certificates.options("client"));
  grpc::SslCredentialsOptions ssl;
  ssl.pem_root_certs = read_text(certificates.file("ca.pem"));
  ssl.pem_private_key = read_text(certificates.file("client.key"));
  ssl.pem_cert_chain = read_text(certificates.file("client.pem"));
  farm.set_credentials(grpc::SslCredentials(ssl));

  farm.start_worker("trusted", 2, certificates.options("client"));
  Process& naked = farm.start_worker("naked", 1, {"--give-up", "2"});
  std::vector<std::string> strange = certificates.options("stranger");
  strange.insert(strange.end(), {"--give-up", "2"});
  Process& stranger = farm.start_worker("stranger", 1, strange);

  const std::string id = farm.submit(200);
  farm.wait_for(id, v1::JOB_STATE_DONE);
  expect_identical(farm.fetch(id), farm.render(200), "over TLS");
  farm.audit(id, 200);

  expect_refused(farm.candela({"list", "--timeout", "2s"}), 3, {farm.address()});
  for (const auto& [name, ca] : {std::pair{"stranger", "ca"}, {"stranger", "other-ca"}}) {
    std::vector<std::string> list = {"list", "--timeout", "2s"};
    for (const std::string& word : certificates.options(name, ca)) list.push_back(word);
    expect_refused(farm.candela(list), 3, {farm.address()});
  }
  EXPECT_NE(naked.wait(30).value_or(0), 0) << "a worker without a certificate was let in";
  EXPECT_NE(stranger.wait(30).value_or(0), 0) << "a worker with a foreign certificate was let in";
  for (const v1::WorkerStatus& worker : farm.workers()) EXPECT_EQ(worker.name(), "trusted");
}

// Claim: with TLS the master may listen on all addresses; a key that does not fit its certificate is refused
// at once.
TEST(Tls, BeyondLoopback) {
  Farm farm;
  const Certificates certificates(farm.folder().path());
  if (!certificates.made()) GTEST_SKIP() << "openssl is not installed";
  std::vector<std::string> options = certificates.options("server");
  options.insert(options.end(), {"--listen", "0.0.0.0:0"});
  farm.start_master(options);
  EXPECT_TRUE(farm.address().starts_with("0.0.0.0:")) << farm.address();

  std::vector<std::string> arguments = {test::program_path("candela-master"),
                                        "--data",
                                        (farm.folder() / "other").string(),
                                        "--listen",
                                        "127.0.0.1:0",
                                        "--tls-cert",
                                        certificates.file("server.pem"),
                                        "--tls-key",
                                        certificates.file("client.key"),
                                        "--tls-ca",
                                        certificates.file("ca.pem")};
  Process mismatched(arguments, farm.folder() / "mismatched", farm.environment());
  EXPECT_EQ(mismatched.wait(20).value_or(-1), 2) << mismatched.err();
}

}  // namespace
}  // namespace candela::farm
