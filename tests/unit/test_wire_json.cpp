// Messages as JSON: what the page reads is what scripts read.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "common/wire/json.h"

namespace candela::wire {
namespace {

v1::JobStatus full_job() {
  v1::JobStatus s;
  s.set_id("j1");
  s.set_name("a scene");
  s.set_state(v1::JOB_STATE_RUNNING);
  s.set_iterations(54);
  s.set_relmse_estimate(1.25e-3);
  s.set_relmse_upper(std::nan(""));
  s.set_eta_seconds(std::numeric_limits<double>::infinity());
  s.mutable_settings()->set_integrator("vcm");
  s.mutable_settings()->set_width(8);
  s.mutable_settings()->set_height(4);
  s.mutable_settings()->set_seed(std::numeric_limits<std::uint64_t>::max());
  (*s.mutable_settings()->mutable_integrator_settings())["radius"] = "0.5";
  s.mutable_stop()->set_time_seconds(60);
  s.set_plan("use  media: there are some\nnote media: thick\n");
  s.add_layers("direct");
  v1::Figure& figure = *s.mutable_epochs()->add_figures();
  figure.set_name("pixels shrunk");
  figure.set_value(12);
  s.mutable_chains()->mutable_plan()->set_chains(10);
  s.mutable_chains()->add_groups()->set_longest_stay(4);
  v1::Taint& taint = *s.add_taints();
  taint.set_worker("w1");
  taint.set_units(3);
  return s;
}

v1::WorkerStatus full_worker() {
  v1::WorkerStatus w;
  w.set_id("w1");
  w.set_host("here");
  w.set_threads(4);
  w.set_resident_bytes(5);
  w.add_jobs("j1");
  v1::FailureCount& failure = *w.add_failures();
  failure.set_cause(v1::FAILURE_CAUSE_PLACE);
  failure.set_count(2);
  return w;
}

// Claim: the page's JSON of a job and of a worker is that of `--json`: the same names, types and values.
TEST(PageJson, IsThatOfScripts) {
  EXPECT_EQ(nlohmann::json::parse(page_json(full_job())), nlohmann::json::parse(job_json(full_job())));
  EXPECT_EQ(nlohmann::json::parse(page_json(full_worker())),
            nlohmann::json::parse(worker_json(full_worker())));
  EXPECT_EQ(page_json(full_job()).find('\n'), std::string::npos);  // an event of a stream is one line
}

// Claim: a browser gets no text that acts on what is around it, in values and in names: one printable line
// each, but for the lines of a plan; no "<" that could end a script; broken UTF-8 is no error.
TEST(PageJson, HasPrintableTexts) {
  v1::JobStatus s = full_job();
  s.set_name("</script>\u202eevil\nb\xff");
  s.set_plan("one\ntwo\x1b[2J\n");
  (*s.mutable_settings()->mutable_integrator_settings())["a\u202eb"] = "\t";
  const std::string text = page_json(s);
  EXPECT_EQ(text.find('<'), std::string::npos);
  EXPECT_EQ(text.find("\u202e"), std::string::npos);
  const auto json = nlohmann::json::parse(text);
  EXPECT_EQ(json.at("name"), "</script>\\u202eevil\\nb\\xff");
  EXPECT_EQ(json.at("plan"), "one\ntwo\\x1b[2J\n");
  EXPECT_EQ(json.at("settings").at("integrator_settings").at("a\\u202eb"), "\\t");
}

// Claim: mutations within iterations are told without b and groups, which only jobs of chains have.
TEST(Json, MutationsWithinIterationsHaveNoB) {
  v1::JobStatus s;
  v1::MutationStatus& mutation = *s.mutable_chains()->add_groups()->add_by_mutation();
  mutation.set_name("lens");
  mutation.set_proposed(7);
  const auto chains = nlohmann::json::parse(job_json(s)).at("chains");
  EXPECT_TRUE(chains.at("b").is_null());
  EXPECT_TRUE(chains.at("b_standard_error").is_null());
  EXPECT_TRUE(chains.at("groups").empty());
  EXPECT_EQ(chains.at("by_mutation").at("lens").at("proposed"), 7);
  EXPECT_EQ(nlohmann::json::parse(job_json(full_job())).at("chains").at("groups").size(), 1U);
}

// Claim: the iterations that a job ends with are told, whether its stop rule has their number or their
// indices; null: it has neither.
TEST(Json, TellsTheIterationsAsked) {
  v1::JobStatus s;
  const auto asked = [&] { return nlohmann::json::parse(job_json(s)).at("iterations_asked"); };
  EXPECT_TRUE(asked().is_null());
  s.mutable_stop()->set_iterations(128);
  EXPECT_EQ(asked(), 128);
  s.mutable_stop()->clear_iterations();
  for (auto* indices : {s.mutable_stop()->add_indices_a(), s.mutable_stop()->add_indices_b()}) {
    indices->set_begin(8);
    indices->set_end(24);
  }
  EXPECT_EQ(asked(), 32);
}

}  // namespace
}  // namespace candela::wire
