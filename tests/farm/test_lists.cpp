// Lists in pages and priorities, by the command.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/farm/farm.h"

namespace candela::farm {
namespace {

std::vector<std::string> ids_of(const CommandResult& list) {
  std::vector<std::string> ids;
  const auto json = nlohmann::json::parse(list.out);
  for (const auto& job : json.at("jobs")) ids.push_back(job.at("id"));
  return ids;
}

// Claim: `list` shows the newest jobs, says how to get the older ones, and goes on there; states are chosen
// by name. `priority` sets what `list` shows, and negative values need no trick. Mistakes are one line.
TEST(Lists, PagesStatesAndPriority) {
  Farm farm;
  farm.start_master_here();
  std::vector<std::string> ids;
  for (int i = 0; i < 3; ++i) ids.push_back(farm.submit(4));
  const CommandResult newest = farm.candela({"list", "--limit", "2"});
  EXPECT_EQ(newest.exit_code, 0) << newest.err;
  const auto shown = [&](int i) { return newest.out.find("\n" + ids[i].substr(0, 5)); };
  EXPECT_EQ(shown(0), std::string::npos) << newest.out;
  ASSERT_NE(shown(2), std::string::npos) << newest.out;
  EXPECT_LT(shown(1), shown(2)) << "the newest is the last";
  EXPECT_NE(newest.err.find("2 of 3 jobs"), std::string::npos) << newest.err;
  const CommandResult page = farm.candela({"list", "--limit", "2", "--json"});
  const auto json = nlohmann::json::parse(page.out);
  EXPECT_EQ(json.at("total"), 3);
  EXPECT_NE(newest.err.find("--after " + json.at("next").get<std::string>()), std::string::npos);
  EXPECT_EQ(ids_of(farm.candela({"list", "--after", json.at("next"), "--json"})),
            std::vector<std::string>{ids[0]});
  EXPECT_EQ(ids_of(farm.candela({"list", "--json"})), ids);

  EXPECT_EQ(farm.candela({"cancel", ids[1]}).exit_code, 0);
  EXPECT_EQ(ids_of(farm.candela({"list", "--state", "cancelled,done", "--json"})),
            std::vector<std::string>{ids[1]});
  const CommandResult set = farm.candela({"priority", ids[0].substr(0, 6), "-5"});
  EXPECT_EQ(set.exit_code, 0) << set.err;
  EXPECT_EQ(set.err, "job " + ids[0] + " has priority -5\n");
  EXPECT_EQ(farm.job(ids[0]).priority(), -5);

  for (const std::vector<std::string>& wrong :
       std::vector<std::vector<std::string>>{{"list", "--state", "runing"},
                                             {"list", "--limit", "0"},
                                             {"list", "--after", "x"},
                                             {"priority", ids[0], "high"},
                                             {"priority", ids[0], "2000000"},
                                             {"priority", "jno", "1"},
                                             {"priority", ids[1], "1"}}) {
    const CommandResult result = farm.candela(wrong);
    EXPECT_NE(result.exit_code, 0) << wrong[0] << ' ' << wrong.back();
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  }
}

}  // namespace
}  // namespace candela::farm
