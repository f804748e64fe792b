// The options of a master.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

namespace candela::master {

class Scheduler;

// Sees the scheduler after each call of it, under its lock.
using SchedulerObserver = std::function<void(const Scheduler&)>;

struct MasterOptions {
  std::filesystem::path data_dir;
  std::string listen = "127.0.0.1:7070";  // HOST:PORT, port 0 picks one; empty: in-process only
  std::string http_listen;                // HOST:PORT of page, health and metrics; empty: none
  std::string page_token_file;            // its text allows the page to change jobs; empty: read-only
  std::string tls_cert, tls_key, tls_ca;  // PEM files; all three or none (mutual TLS)
  std::string notify;                     // URL that notices are sent to; empty: none are
  std::string notify_secret_file;         // its text signs notices; empty: a file in the data folder
  bool insecure = false;                  // allow a non-loopback address without TLS
  // Without TLS: write the token where programs of this user look for it.
  bool publish_token = false;
  double checkpoint_seconds = 10;  // at most this long between a merge and the checkpoint that has it
  double lease_seconds = 30;       // without heartbeat
  double unit_seconds = 4;         // what units are sized to
  double stuck_seconds = 600;      // without progress, before a worker loses a unit
  // Share of units that a second worker renders too, beside the first units of each worker; 0: none. The
  // program's default is 0.01.
  double audit_share = 0;
  std::uint64_t merge_queue_bytes = 512ULL << 20;
  unsigned merge_threads = 1;
  int bulk_niceness = 0;  // of the threads that merge, write checkpoints and make images (bulk_threads.h)
  // Maximum for films, statistics, chains, checkpoints and images of all jobs; 0: 3/4 of the memory.
  std::uint64_t memory_bytes = 0;
  std::uint64_t statistics_bytes = 0;  // of those the statistics of all jobs; 0: a third of memory_bytes
  double keep_finished_seconds = 0;    // a job that ended longer ago is removed; 0: none is
  double blob_grace_seconds = 3600;    // before a blob that no job refers to is collected
  bool image_on_checkpoint = true;     // also write jobs/ID/image.exr now and then (SIGHUP: at once)
  SchedulerObserver observer = {};     // for tests; empty: nobody looks
};

}  // namespace candela::master
