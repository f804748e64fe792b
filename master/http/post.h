// One HTTP POST. libcurl makes it, in the module candela-notices.so (common/base/module.h): loading libcurl
// takes longer than most commands run, and few masters need it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "common/base/result.h"

namespace candela::master {

struct PostRequest {
  std::string url, body;
  std::vector<std::string> fields;  // "Name: value"
  double timeout_seconds = 10;      // until the whole answer is there
  std::function<bool()> give_up;    // asked now and then; true: the call ends at once
};

struct PostAnswer {
  int code = 0;       // of the answer; 0: none came
  std::string error;  // why none came
};

class Poster {
 public:
  virtual ~Poster() = default;
  struct Target {
    std::string error;      // why nothing can be sent there; empty: it can
    bool in_clear = false;  // plain HTTP to another machine
  };
  virtual Target check(const std::string& url) const = 0;
  // Follows no redirection. Any thread.
  virtual PostAnswer post(const PostRequest& request) const = 0;
};

// Fails where the module is missing.
Result<const Poster*> load_poster();

}  // namespace candela::master
