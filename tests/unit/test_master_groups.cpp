// Groups of frames, and jobs that wait for others.
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "tests/unit/master_fixture.h"
#include "tests/unit/scheduler_fixture.h"

namespace candela::master {
namespace {

class SchedulerGroups : public SchedulerFixture {
 protected:
  void submit(const std::string& id, std::optional<int> frame = {}, std::vector<std::string> depends = {},
              std::uint64_t iterations = 8) {
    JobRow j = row(id, iterations);
    j.submitted_unix_ms = ++submitted;
    if (frame) j.frame = FrameRow{"g", "shot", *frame, 3};
    j.depends = std::move(depends);
    s->submit(std::move(j), now());
  }
  // Renders a unit; the id of its job, empty: there was none.
  std::string step(double seconds = 1) {
    const auto l = lease("w");
    if (!l) return {};
    clock += seconds;
    if (unit_of(*l).kind == Unit::Kind::pilot) {
      EXPECT_TRUE(s->complete_pilot("w", l->row.token, {NamedState{10}, "plan", 1}, now()));
      return l->row.job_id;
    }
    EXPECT_EQ(deliver(*l, unit_of(*l), {}, seconds), Delivery::ok);
    if (s->job(l->row.job_id)->finishing) s->finish(l->row.job_id, now());
    return l->row.job_id;
  }
  JobState state(const std::string& id) { return s->job(id)->row.state; }

  std::int64_t submitted = 0;
};

// Claim: a group has one share: beside one other job its three frames get about half of the time together,
// one after the other in the order of their numbers.
TEST_F(SchedulerGroups, ShareTimeAsOneJob) {
  worker("w");
  submit("f3", 3, {}, 400);
  submit("f1", 1, {}, 400);
  submit("f2", 2, {}, 400);
  submit("other", {}, {}, 4000);
  std::map<std::string, int> steps;
  for (int i = 0; i < 60; ++i) ++steps[step(4)];
  EXPECT_NEAR(steps["other"], 30, 3);
  EXPECT_NEAR(steps["f1"], 30, 3) << "the first frame goes first";
  EXPECT_EQ(steps.count("f3") + steps.count("f2"), 0U);
}

// Claim: a job that depends on others starts when all of them are done, and not before.
TEST_F(SchedulerGroups, DependentsStartWhenAllIsDone) {
  worker("w");
  submit("a");
  submit("f1", 1);
  submit("f2", 2);
  submit("comp", {}, {"a", "g"});
  EXPECT_NE(s->message_of(*s->job("comp"), now()).find("waits for a, g (shot)"), std::string::npos)
      << s->message_of(*s->job("comp"), now());
  std::vector<std::string> order;
  for (int i = 0; i < 100 && state("comp") != JobState::done; ++i) {
    order.push_back(step());
    s->tick(now());
  }
  EXPECT_EQ(state("comp"), JobState::done);
  const auto first = std::find(order.begin(), order.end(), "comp");
  ASSERT_NE(first, order.end());
  for (const char* before : {"a", "f1", "f2"})
    EXPECT_EQ(std::find(first, order.end(), before), order.end()) << before;
}

// Claim: a job fails with the reason when what it depends on fails or is cancelled; a group is judged when
// all its frames have ended. Resumed, it waits again, once what failed goes on.
TEST_F(SchedulerGroups, DependentsFailWithTheReason) {
  worker("w");
  submit("a");
  submit("b", {}, {"a"});
  submit("c", {}, {"b"});
  submit("f1", 1);
  submit("f2", 2);
  submit("comp", {}, {"g"});
  s->fail_job("a", "a texture is missing", now());
  s->fail_job("f1", "light is missing", now());
  for (int i = 0; i < 3; ++i) s->tick(now());
  EXPECT_EQ(state("b"), JobState::failed);
  EXPECT_NE(s->job("b")->row.message.find("a texture is missing"), std::string::npos)
      << s->job("b")->row.message;
  EXPECT_EQ(state("c"), JobState::failed) << "and so on down the line";
  EXPECT_EQ(state("comp"), JobState::queued) << "a frame goes on";
  ASSERT_TRUE(s->cancel("f2", now()).ok());
  s->tick(now());
  EXPECT_EQ(state("comp"), JobState::failed);
  EXPECT_NE(s->job("comp")->row.message.find("2 of the 2 frames"), std::string::npos)
      << s->job("comp")->row.message;
  EXPECT_FALSE(s->check_dependency("a").ok());
  EXPECT_FALSE(s->check_dependency("nothing").ok());
  EXPECT_FALSE(s->resume("b", now()).ok()) << "a is still failed";
  ASSERT_TRUE(s->resume("a", now()).ok());
  ASSERT_TRUE(s->resume("b", now()).ok());
  s->tick(now());
  EXPECT_EQ(state("b"), JobState::queued);
  std::vector<std::string> order;
  for (int i = 0; i < 100 && state("b") != JobState::done; ++i) {
    order.push_back(step());
    s->tick(now());
  }
  EXPECT_EQ(order.front(), "a") << "b waits for it";
  EXPECT_EQ(state("b"), JobState::done);
}

// Claim: the short id of a job is the shortest beginning, of five characters or more, that no other has.
TEST_F(SchedulerGroups, ShortIds) {
  submit("jabcdefghij");
  submit("jabcdezzzzz");
  submit("jzyxwvutsrq");
  EXPECT_EQ(s->short_id("jzyxwvutsrq"), "jzyxw");
  EXPECT_EQ(s->short_id("jabcdefghij"), "jabcdef");
  EXPECT_EQ(s->short_id("jabcdezzzzz"), "jabcdez");
}

class Groups : public MasterTest {
 protected:
  v1::SubmitRequest frame(int number, const std::string& token = "token") {
    v1::SubmitRequest request = submission(4);
    request.set_name("shot." + std::to_string(number));
    request.set_submitter("ann@desk");
    request.set_idempotency_token(token + "/" + std::to_string(number));
    request.mutable_frame()->set_group_name("shot");
    request.mutable_frame()->set_group_token(token);
    request.mutable_frame()->set_frame(number);
    request.mutable_frame()->set_frames(3);
    return request;
  }
  v1::SubmitResponse send(const v1::SubmitRequest& request) {
    v1::SubmitResponse response;
    grpc::ClientContext context;
    const grpc::Status status = farm->Submit(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response;
  }
  v1::GroupStatus group(const std::string& id) {
    v1::GetGroupRequest request;
    request.set_group_id(id);
    v1::GroupStatus out;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->GetGroup(&context, request, &out).ok());
    return out;
  }
  grpc::Status steer(const v1::SteerGroupRequest& request, v1::GroupStatus& out) {
    grpc::ClientContext context;
    return farm->SteerGroup(&context, request, &out);
  }
  v1::GroupStatus steer(const std::string& id, v1::SteerGroupRequest::Action action,
                        std::int32_t priority = 0) {
    v1::SteerGroupRequest request;
    request.set_group_id(id);
    request.set_action(action);
    request.set_priority(priority);
    v1::GroupStatus out;
    const grpc::Status status = steer(request, out);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return out;
  }
  v1::ListJobsResponse list(const v1::ListJobsRequest& request) {
    v1::ListJobsResponse out;
    grpc::ClientContext context;
    EXPECT_TRUE(farm->ListJobs(&context, request, &out).ok());
    return out;
  }
};

// Claim: a group is one row of a folded list and survives a restart with its frames, its priority and what
// its jobs wait for; a frame that is submitted again is the first one; a late frame takes the group's
// priority.
TEST_F(Groups, AreListedSteeredAndKept) {
  ASSERT_TRUE(upload(kScene, sha256_hex(kScene), kScene.size()).ok());
  std::string id;
  for (const int number : {1, 2}) id = send(frame(number)).group_id();
  const std::string first = send(frame(1)).job_id();
  EXPECT_TRUE(send(frame(1)).existed());
  std::this_thread::sleep_for(std::chrono::milliseconds(5));  // lists are ordered by milliseconds
  v1::SubmitRequest after = submission(4);
  after.set_name("comp");
  after.set_submitter("bob@desk");
  after.add_depends(id);
  const std::string comp = send(after).job_id();
  EXPECT_EQ(steer(id, v1::SteerGroupRequest::ACTION_PRIORITY, 7).priority(), 7);
  EXPECT_EQ(steer(id, v1::SteerGroupRequest::ACTION_PAUSE).state(), v1::JOB_STATE_PAUSED);
  restart();
  EXPECT_EQ(group(id).state(), v1::JOB_STATE_PAUSED);
  EXPECT_EQ(group(id).frames(), 2U);
  EXPECT_EQ(group(id).frames_submitted(), 3U);
  EXPECT_EQ(show(first).frame().group_id(), id);
  EXPECT_EQ(show(comp).depends(0), id);
  EXPECT_EQ(show(send(frame(3)).job_id()).priority(), 7);

  v1::ListJobsRequest request;
  EXPECT_EQ(list(request).jobs_size(), 4);
  request.set_fold(true);
  EXPECT_EQ(list(request).jobs_size(), 1);
  EXPECT_EQ(list(request).groups_size(), 1);
  request.set_name("sh*");
  EXPECT_EQ(list(request).total(), 1U);
  request.clear_name();
  request.set_submitter("bob@elsewhere");
  ASSERT_EQ(list(request).total(), 1U) << "what follows the @ does not count";
  EXPECT_EQ(list(request).jobs(0).name(), "comp");
  request.Clear();
  request.set_group_id(id);
  EXPECT_EQ(list(request).total(), 3U);
  // Page by page, in one order.
  request.Clear();
  request.set_fold(true);
  request.set_page_size(1);
  std::vector<std::string> ids;
  do {
    const v1::ListJobsResponse page = list(request);
    for (const auto& job : page.jobs()) ids.push_back(job.id());
    for (const auto& one : page.groups()) ids.push_back(one.id());
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  EXPECT_EQ(ids, (std::vector<std::string>{comp, id})) << "the newest first";
}

// Claim: all frames of a group render, its dependent starts then, and an extension adds to all of them once,
// however often it is sent.
TEST_F(Groups, RenderExtendAndLetDependentsStart) {
  ASSERT_TRUE(upload(kScene, sha256_hex(kScene), kScene.size()).ok());
  std::string id;
  std::vector<std::string> jobs;
  for (const int number : {1, 2, 3}) {
    const v1::SubmitResponse response = send(frame(number));
    id = response.group_id();
    jobs.push_back(response.job_id());
  }
  v1::SubmitRequest after = submission(4);
  after.add_depends(id);
  const std::string comp = send(after).job_id();
  TestWorker worker(channel);
  ASSERT_TRUE(worker.enrol().ok());
  const auto render = [&](const std::string& last) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (show(last).state() != v1::JOB_STATE_DONE && std::chrono::steady_clock::now() < end)
      if (!worker.step()) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    EXPECT_EQ(show(last).state(), v1::JOB_STATE_DONE) << show(last).message();
  };
  render(comp);
  EXPECT_EQ(group(id).state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(group(id).fraction_done(), 1);
  v1::SteerGroupRequest extend;
  extend.set_group_id(id);
  extend.set_action(v1::SteerGroupRequest::ACTION_EXTEND);
  extend.mutable_extend()->set_add_iterations(2);
  extend.mutable_extend()->set_idempotency_token("once");
  v1::GroupStatus out;
  for (int call = 0; call < 2; ++call) {
    const grpc::Status status = steer(extend, out);
    ASSERT_TRUE(status.ok()) << status.error_message();
  }
  for (const std::string& job : jobs) {
    EXPECT_EQ(show(job).stop().iterations(), 6U);
    render(job);
    audit(job, 6);
  }
  extend.set_action(v1::SteerGroupRequest::ACTION_PAUSE);
  EXPECT_EQ(steer(extend, out).error_code(), grpc::StatusCode::FAILED_PRECONDITION) << "all have ended";
}

// Claim: a job cannot be submitted to wait for what is not there or has failed.
TEST_F(Groups, BadDependenciesAreRefused) {
  ASSERT_TRUE(upload(kScene, sha256_hex(kScene), kScene.size()).ok());
  v1::SubmitRequest request = submission(4);
  request.add_depends("jnothing");
  const auto refused = [&] {
    v1::SubmitResponse response;
    grpc::ClientContext context;
    return farm->Submit(&context, request, &response).error_code();
  };
  EXPECT_EQ(refused(), grpc::StatusCode::INVALID_ARGUMENT);
  const std::string id = send(submission(4)).job_id();
  v1::JobRequest cancel;
  cancel.set_job_id(id);
  v1::JobStatus status;
  grpc::ClientContext context;
  ASSERT_TRUE(farm->CancelJob(&context, cancel, &status).ok());
  request.set_depends(0, id);
  EXPECT_EQ(refused(), grpc::StatusCode::FAILED_PRECONDITION);
}

}  // namespace
}  // namespace candela::master
