// The HTTP API against its description, docs/openapi.json: both have the same paths and methods, answers have
// the fields and types that it says, and only who may gets one.
#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "common/wire/json.h"
#include "common/wire/token.h"
#include "master/http/routes.h"
#include "tests/paths.h"
#include "tests/unit/http_call.h"
#include "tests/unit/master_fixture.h"

namespace candela::master {
namespace {

using nlohmann::json;

const json& description() {
  static const json read = [] {
    std::ifstream file(test::source_path("docs/openapi.json"));
    return json::parse(file);
  }();
  return read;
}

const json& resolved(const json& node) {
  if (!node.contains("$ref")) return node;
  return description().at(json::json_pointer(node.at("$ref").get<std::string>().substr(1)));
}

bool has_type(const json& value, const std::string& type) {
  if (type == "null") return value.is_null();
  if (type == "integer") return value.is_number_integer();
  if (type == "number") return value.is_number();
  if (type == "string") return value.is_string();
  if (type == "boolean") return value.is_boolean();
  if (type == "array") return value.is_array();
  return type == "object" && value.is_object();
}

// Faults of a value by a schema of the kinds that the description uses, each with its place.
void check(const json& value, const json& unresolved, const std::string& place,
           std::vector<std::string>& out) {
  const json& schema = resolved(unresolved);
  if (schema.contains("oneOf")) {
    for (const json& one : schema.at("oneOf")) {
      std::vector<std::string> faults;
      check(value, one, place, faults);
      if (faults.empty()) return;
      if (&one == &schema.at("oneOf").back() || !value.is_null()) {
        out.insert(out.end(), faults.begin(), faults.end());
        return;
      }
    }
    return;
  }
  const json& types = schema.at("type");
  bool typed = false;
  for (const json& type : types.is_array() ? types : json::array({types}))
    typed = typed || has_type(value, type);
  if (!typed) return out.push_back(place + ": " + value.dump() + " is no " + types.dump());
  if (schema.contains("enum") &&
      std::find(schema["enum"].begin(), schema["enum"].end(), value) == schema["enum"].end())
    out.push_back(place + ": " + value.dump() + " is none of " + schema["enum"].dump());
  if (value.is_array() && schema.contains("items"))
    for (std::size_t i = 0; i < value.size(); ++i)
      check(value[i], schema["items"], place + "[" + std::to_string(i) + "]", out);
  if (value.is_array() && schema.contains("minItems") && value.size() < schema["minItems"])
    out.push_back(place + ": too short");
  if (!value.is_object()) return;
  for (const json& name : schema.at("required"))
    if (!value.contains(name)) out.push_back(place + ": lacks " + name.dump());
  const json& others = schema.at("additionalProperties");
  for (const auto& [name, field] : value.items())
    if (schema["properties"].contains(name))
      check(field, schema["properties"][name], place + "." + name, out);
    else if (others.is_object())
      check(field, others, place + "." + name, out);
    else
      out.push_back(place + "." + name + ": is not described");
}

// Claim: the description has each path and method of the server, and no other.
TEST(OpenApi, HasTheRoutesOfTheServer) {
  std::set<std::string> described, served;
  for (const auto& [path, item] : description().at("paths").items())
    for (const auto& [method, operation] : item.items())
      if (method != "parameters") {
        std::string upper = method;
        for (char& c : upper) c = static_cast<char>(std::toupper(c));
        described.insert(upper + ' ' + path);
      }
  for (const Route& route : http_routes())
    served.insert(std::string(route.method) + ' ' + std::string(route.path));
  EXPECT_EQ(described, served);
}

// Claim: a path finds its route for its method alone; a part is one step, not empty.
TEST(Routes, AreFoundByMethodAndPath) {
  EXPECT_EQ(find_route("HEAD", "/api/jobs/j1/image.exr").route->action, HttpAction::exr);
  EXPECT_EQ(find_route("GET", "/api/jobs/j1").part, "j1");
  EXPECT_EQ(find_route("POST", "/api/groups/g1/cancel").verb(), "cancel");
  EXPECT_EQ(find_route("POST", "/api/groups/g1/cancel").part, "g1");
  for (const auto& [method, path] :
       {std::pair("DELETE", "/api/jobs/j1"), {"GET", "/api/login"}, {"PUT", "/api/jobs"}}) {
    EXPECT_EQ(find_route(method, path).route, nullptr) << path;
    EXPECT_TRUE(find_route(method, path).other_method) << path;
  }
  for (const char* path : {"/api/jobs/", "/api/jobs//pause", "/api/jobs/a/b/pause", "/api/jobs/a/pause/",
                           "/api", "/api/x", "/api/jobs/pause", "/"}) {
    const RouteMatch found = find_route("POST", path);
    EXPECT_EQ(found.route, nullptr) << path;
  }
}

class HttpApi : public MasterTest {
 protected:
  static constexpr const char* kPageToken = "0123456789abcdef-page";
  void SetUp() override {
    std::ofstream(folder.path() / "page-token") << kPageToken << '\n';
    std::filesystem::permissions(folder.path() / "page-token", std::filesystem::perms::owner_read);
    http_listen = "127.0.0.1:0";
    page_token_file = (folder.path() / "page-token").string();
    MasterTest::SetUp();
    read_token = *wire::read_token_file(folder.path() / "token");
  }

  struct Answer {
    int code = 0;
    std::string type, body;
    json parsed() const { return json::parse(body); }
  };
  // `token`: empty: none.
  Answer ask(const std::string& method, const std::string& path, const std::string& token,
             const std::string& body = "", const std::string& more = "") {
    std::string text = method + ' ' + path + " HTTP/1.1\r\nHost: localhost\r\n" + more;
    if (!token.empty()) text += "Authorization: Bearer " + token + "\r\n";
    if (method != "GET" && more.find("Content-Length") == std::string::npos)
      text += "Content-Length: " + std::to_string(body.size()) + "\r\n";
    text += "\r\n" + body;
    const std::string all = test::http_call(master->http_port(), text);
    Answer out;
    const std::size_t head = all.find("\r\n\r\n");
    if (head == std::string::npos) return out;
    out.code = std::stoi(all.substr(9, 3));
    const std::size_t type = all.find("Content-Type: ");
    out.type = all.substr(type + 14, all.find_first_of(";\r", type) - type - 14);
    out.body = all.substr(head + 4);
    return out;
  }
  // The answer is one that the description has, with the fields and types that it says.
  Answer described(const std::string& method, const std::string& path, const std::string& where,
                   const std::string& token, const std::string& body = "") {
    const Answer answer = ask(method, where, token, body);
    std::string lower = method;
    for (char& c : lower) c = static_cast<char>(std::tolower(c));
    const json& responses = description()["paths"][path][lower]["responses"];
    const std::string code = std::to_string(answer.code);
    if (!responses.contains(code)) {
      ADD_FAILURE() << method << ' ' << where << " is answered " << code
                    << ", which is not described: " << answer.body;
      return answer;
    }
    const json& response = resolved(responses[code]);
    if (!response.contains("content")) return answer;
    if (!response["content"].contains(answer.type)) {
      ADD_FAILURE() << method << ' ' << where << " is of type " << answer.type;
      return answer;
    }
    if (answer.type != "application/json") return answer;
    std::vector<std::string> faults;
    check(answer.parsed(), response["content"][answer.type]["schema"], where, faults);
    for (const std::string& fault : faults) ADD_FAILURE() << fault;
    return answer;
  }
  void render_all() {
    TestWorker worker(channel);
    ASSERT_TRUE(worker.enrol().ok());
    while (worker.step()) {
    }
  }
  std::string read_token;
};

// Claim: each address answers as the description says, for jobs with and without work, for workers and
// groups: all fields are described, all described fields are there, and their types are as described.
TEST_F(HttpApi, AnswersAsDescribed) {
  const std::string done = submit(4);
  render_all();
  ASSERT_EQ(wait_end(done).state(), v1::JOB_STATE_DONE);
  v1::SubmitRequest frame = submission(1000);
  frame.mutable_settings()->mutable_crop()->set_whole_width(kWidth);
  frame.mutable_settings()->mutable_crop()->set_whole_height(kHeight);
  frame.mutable_frame()->set_group_name("shot");
  frame.mutable_frame()->set_group_token("t");
  frame.mutable_frame()->set_frame(7);
  frame.mutable_frame()->set_frames(2);
  const std::string queued = test::submit(*farm, kScene, frame), group = show(queued).frame().group_id();
  const auto workers = described("GET", "/api/workers", "/api/workers", read_token).parsed().at("workers");
  ASSERT_EQ(workers.size(), 1U);
  const std::string worker = workers[0].at("id");
  const std::string blob = sha256_hex(kScene);
  std::size_t asked = 0;
  for (const auto& [path, item] : description()["paths"].items()) {
    if (!item.contains("get")) continue;
    std::vector<std::string> parts{""};
    if (path.find("/jobs/{id}") != std::string::npos) parts = {done, queued, "jnone"};
    if (path.find("/groups/{id}") != std::string::npos) parts = {group, "gnone"};
    if (path.find("/workers/{id}") != std::string::npos) parts = {worker, "wnone"};
    if (path.find("{sha256}") != std::string::npos) parts = {blob, std::string(64, '0'), "x"};
    for (const std::string& part : parts) {
      const std::string where = std::regex_replace(path, std::regex("\\{[a-z0-9]+\\}"), part);
      described("GET", path, where, read_token);
      if (!path.starts_with("/api/")) continue;
      ++asked;
      EXPECT_EQ(ask("GET", where, "").code, 401) << where;
      EXPECT_EQ(ask("GET", where, "no token of this farm").code, 401) << where;
    }
  }
  EXPECT_GT(asked, 30U);
  EXPECT_EQ(
      described("GET", "/api/jobs", "/api/jobs?order=wall&offset=1", read_token).parsed().at("jobs").size(),
      1U);
  described("GET", "/api/jobs", "/api/jobs?offset=x", read_token);
  described("GET", "/api/jobs/{id}/image.png", "/api/jobs/" + done + "/image.png?exposure=loud", read_token);
  for (const char* query : {"percentiles=9,1", "percentiles=1", "percentiles=a,b", "log=2", "map=pink",
                            "pixels=1,1,0,0", "pixels=1,2,3", "pixels=-1,0,0,0", "kind=none", "kind=layer",
                            "kind=layer&layer=a/b", "kind=layer&layer=error"}) {
    const std::string where = "/api/jobs/" + done + "/colors?" + query;
    EXPECT_EQ(described("GET", "/api/jobs/{id}/colors", where, read_token).code, 400) << query;
  }
  EXPECT_EQ(described("GET", "/api/jobs/{id}/tile", "/api/jobs/" + done + "/tile?level=0&x=0&y=0&form=gif",
                      read_token)
                .code,
            400);
  EXPECT_EQ(
      described("GET", "/api/stream", "/api/stream?job=" + done + "&kind=layer&layer=a%2fb", read_token).code,
      400);
  const std::string exr =
      described("GET", "/api/jobs/{id}/image.exr", "/api/jobs/" + done + "/image.exr", read_token).body;
  EXPECT_EQ(exr, fetch(done)) << "the download is the image that the command fetches";
  EXPECT_TRUE(described("GET", "/api/jobs/{id}/image.png", "/api/jobs/" + done + "/image.png", read_token)
                  .body.starts_with("\x89PNG"));
  EXPECT_EQ(described("GET", "/api/jobs/{id}", "/api/jobs/" + queued, read_token)
                .parsed()
                .at("settings")
                .at("crop")
                .at("whole_width"),
            kWidth);
  // A group's object is that of the command.
  EXPECT_EQ(described("GET", "/api/groups/{id}", "/api/groups/" + group, read_token)
                .parsed()
                .at("states")
                .at("queued"),
            1);
}

// Claim: what changes something needs the page token, whatever the address; with it each does what its name
// says, and answers as described.
TEST_F(HttpApi, ChangesNeedThePageToken) {
  const std::string job = submit(1000);
  v1::SubmitRequest frame = submission(1000);
  frame.mutable_frame()->set_group_name("shot");
  frame.mutable_frame()->set_group_token("t");
  const std::string group = show(test::submit(*farm, kScene, frame)).frame().group_id();
  TestWorker idle(channel);
  ASSERT_TRUE(idle.enrol().ok());
  const std::string worker = ask("GET", "/api/workers", read_token).parsed()["workers"][0]["id"];
  for (const auto& [path, item] : description()["paths"].items())
    for (const char* method : {"POST", "PUT"}) {
      std::string lower = method;
      for (char& c : lower) c = static_cast<char>(std::tolower(c));
      if (!item.contains(lower) || path == "/api/login") continue;
      const std::string where =
          std::regex_replace(path, std::regex("\\{[a-z0-9]+\\}"),
                             path.find("/jobs/") != std::string::npos ? job : std::string(64, 'a'));
      EXPECT_EQ(described(method, path, where, "").code, 401) << where;
      EXPECT_EQ(described(method, path, where, read_token).code, 403) << where;
    }
  EXPECT_EQ(show(job).state(), v1::JOB_STATE_QUEUED);
  const auto steer = [&](const std::string& what, const std::string& id, const std::string& verb,
                         const std::string& form = "") {
    return described("POST", "/api/" + what + "/{id}/" + verb, "/api/" + what + "/" + id + "/" + verb,
                     kPageToken, form);
  };
  for (const auto& [what, id] : {std::pair<std::string, std::string>("jobs", job), {"groups", group}}) {
    EXPECT_EQ(steer(what, id, "pause").parsed().at("state"), "paused") << what;
    EXPECT_EQ(steer(what, id, "resume").parsed().at("state"), "queued") << what;
    EXPECT_EQ(steer(what, id, "priority", "priority=-7").parsed().at("priority"), -7) << what;
    EXPECT_EQ(steer(what, id, "priority", "priority=high").code, 400) << what;
    EXPECT_EQ(steer(what, id, "extend", "iterations=5").code, 200) << what;
    EXPECT_EQ(steer(what, id, "extend", "iterations=-1").code, 400) << what;
    EXPECT_EQ(steer(what, id, "cancel").parsed().at("state"), "cancelled") << what;
    EXPECT_EQ(steer(what, id, "pause").code, 409) << what;
    EXPECT_EQ(steer(what, "none", "pause").code, 404) << what;
  }
  EXPECT_EQ(show(job).stop().iterations(), 1005U);
  EXPECT_EQ(
      described("POST", "/api/workers/{id}/drain", "/api/workers/" + worker + "/drain", kPageToken).code,
      200);
  EXPECT_EQ(described("POST", "/api/check", "/api/check", kPageToken).code, 200);
  EXPECT_EQ(described("POST", "/api/login", "/api/login", read_token).code, 200);
  EXPECT_EQ(ask("POST", "/api/jobs/" + job, kPageToken).code, 405);
  EXPECT_EQ(ask("POST", "/api/none", kPageToken).code, 404);
}

// Claim: a job that comes by HTTP, its file first, is the job that the command submits, and its image the
// same; a second submission with its token is the first job. What is wrong is told, and makes no job.
TEST_F(HttpApi, JobsComeByUpload) {
  const std::string scene = kScene + std::string(3 << 20, ' '), sha256 = sha256_hex(scene);
  const auto put = [&](const std::string& name, const std::string& body) {
    return described("PUT", "/api/blobs/{sha256}", "/api/blobs/" + name, kPageToken, body);
  };
  v1::SubmitRequest request = submission(4);
  v1::BundleFile& file = *request.mutable_bundle()->mutable_files(0);
  file.set_sha256(sha256);
  file.set_size_bytes(scene.size());
  request.set_share(2);
  request.set_idempotency_token("once");
  request.mutable_settings()->set_seed(0xfedcba9876543210ULL);
  const std::string text = wire::submission_json(request);
  std::vector<std::string> faults;
  check(json::parse(text), description()["components"]["schemas"]["Submission"], "submission", faults);
  for (const std::string& fault : faults) ADD_FAILURE() << fault;
  const auto post = [&](const std::string& body) {
    return described("POST", "/api/jobs", "/api/jobs", kPageToken, body);
  };
  EXPECT_EQ(post(text).code, 409) << "the file is not there yet";
  EXPECT_EQ(put(std::string(64, '0'), scene).code, 400) << "the bytes are others";
  EXPECT_EQ(ask("PUT", "/api/blobs/../token", kPageToken, scene).code, 404);
  EXPECT_EQ(put("%2e%2e", scene).code, 400);
  EXPECT_EQ(ask("PUT", "/api/blobs/" + sha256, kPageToken, "", "Content-Length: 99999999999999\r\n").code,
            400);
  EXPECT_EQ(ask("PUT", "/api/blobs/" + sha256, kPageToken, "", "Transfer-Encoding: chunked\r\n").code, 411);
  EXPECT_EQ(described("GET", "/api/blobs/{sha256}", "/api/blobs/" + sha256, read_token).code, 404);
  EXPECT_EQ(put(sha256, scene).code, 201);
  EXPECT_EQ(put(sha256, scene).code, 200);
  EXPECT_EQ(
      described("GET", "/api/blobs/{sha256}", "/api/blobs/" + sha256, read_token).parsed().at("size_bytes"),
      scene.size());
  for (const std::string& bad : {std::string(), std::string("{"), std::string("[]"),
                                 std::string("{\"nmae\": \"x\"}"), std::string("{\"settings\": 3}"),
                                 std::string("\xff\xfe"), std::string(100000, '['), std::string("{}")})
    EXPECT_EQ(post(bad).code, 400) << bad.substr(0, 40);
  EXPECT_EQ(ask("POST", "/api/jobs", kPageToken, std::string((4 << 20) + 1, ' ')).code, 413);
  EXPECT_EQ(ask("POST", "/api/jobs", read_token, std::string(5000, ' ')).code, 413)
      << "who may not submit sends little";
  const Answer made = post(text);
  ASSERT_EQ(made.code, 201) << made.body;
  const std::string id = made.parsed().at("id");
  EXPECT_EQ(post(text).code, 200);
  EXPECT_EQ(post(text).parsed().at("id"), id);
  json other = json::parse(text);
  other["priority"] = 4;
  EXPECT_EQ(post(other.dump()).code, 409) << "the token is another job's";
  EXPECT_EQ(show(id).share(), 2);
  EXPECT_EQ(show(id).settings().seed(), 0xfedcba9876543210ULL);
  EXPECT_EQ(show(id).settings().SerializeAsString().size(), request.settings().SerializeAsString().size());
  render_all();
  EXPECT_EQ(wait_end(id).state(), v1::JOB_STATE_DONE);
  audit(id, 4);
}

}  // namespace
}  // namespace candela::master
