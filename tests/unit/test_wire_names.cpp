// Names of enumerators, by which logs, JSON, metrics and command lines know them.
#include <gtest/gtest.h>

#include "common/base/work_monitor.h"
#include "common/film/counts.h"
#include "common/wire/roles.h"
#include "common/wire/wire.h"

namespace candela::wire {
namespace {

// Claim: each value has the name that scripts know it by; a name that is swapped with another is found.
TEST(WireNames, BelongToTheirValues) {
  using film::RejectCause;
  EXPECT_EQ(film::name(RejectCause::not_a_number), "nan");
  EXPECT_EQ(film::name(RejectCause::infinite), "infinite");
  EXPECT_EQ(film::name(RejectCause::negative), "negative");
  EXPECT_EQ(film::name(RejectCause::saturated), "saturated");
  EXPECT_EQ(film::name(RejectCause::statistics), "statistics");
  EXPECT_EQ(name(Role::worker), "worker");
  EXPECT_EQ(name(Role::submit), "submit");
  EXPECT_EQ(name(Role::operate), "operate");
  EXPECT_EQ(name(Role::read), "read");
  EXPECT_EQ(name(v1::JOB_STATE_QUEUED), "queued");
  EXPECT_EQ(name(v1::JOB_STATE_RUNNING), "running");
  EXPECT_EQ(name(v1::JOB_STATE_PAUSED), "paused");
  EXPECT_EQ(name(v1::JOB_STATE_DONE), "done");
  EXPECT_EQ(name(v1::JOB_STATE_FAILED), "failed");
  EXPECT_EQ(name(v1::JOB_STATE_CANCELLED), "cancelled");
  EXPECT_EQ(name(static_cast<v1::JobState>(99)), "unknown");
  EXPECT_EQ(doing(WorkPhase::waiting), "waiting");
  EXPECT_EQ(doing(WorkPhase::fetching), "fetching files");
  EXPECT_EQ(doing(WorkPhase::reading), "reading the scene");
  EXPECT_EQ(doing(WorkPhase::building), "building the scene");
  EXPECT_EQ(doing(WorkPhase::piloting), "measuring the scene in a pilot");
  EXPECT_EQ(doing(WorkPhase::rendering), "rendering");
  EXPECT_EQ(doing(WorkPhase::pushing), "delivering");
}

}  // namespace
}  // namespace candela::wire
