// The program candela-master: one master process, from its command line to its exit code.
#pragma once

#include "master/options.h"

namespace candela::master {

// To be called from main() alone: blocks signals in the calling thread.
int run_master(int argc, char** argv, const SchedulerObserver& observer = {});

}  // namespace candela::master
