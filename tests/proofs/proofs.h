// Same bits, same verdict. A test of images has fixed seeds and its films are exact, so a test whose films
// did not change comes to the verdict that it came to before. A program of such tests runs them twice:
//
//   probe  in a process of its own: each test's body runs, but every render gives one batch of what was asked
//          for, and its integers are hashed. What the test says of those values is nonsense and is thrown
//          away.
//   full   as GoogleTest runs it. A test whose digests stand in tests/proofs/proved.txt is left out: it
//   passed.
//
// Only suites that a file opts in by FilmsDecide are treated so: those whose every expectation is a function
// of films that the harness rendered, of constants in the test's file, and of what is noted here.
//
// A test may consist of parts (Part), each with a line of its own: a new integrator does not have those
// that were there before compared again.
//
// A digest covers the test's source file, the sources of the arithmetic (judge_sources), every film of
// the probe with its scene and settings (those that are not at their defaults: a new setting changes no
// digest), and what the harness notes beside (tolerances, references). tests/nightly/prove writes a line only
// if the full form rendered nothing but scenes and settings that the probe has rendered too.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>

namespace candela::proofs {

// Opts suites, or tests of a suite ("Suite.Test"), of the file in: const proofs::FilmsDecide
// kFilms({"Integrators"}). Names are those of TEST, TEST_F or TEST_P, without the prefix of an instantiation
// and without parameters.
class FilmsDecide {
 public:
  explicit FilmsDecide(std::initializer_list<std::string_view> names);
};

// True in the process of the probe: a render gives one batch, a comparison compares nothing.
bool probing();
// `what` was rendered for the test that runs. In the probe `integers` (int64 sums of the film) are hashed.
void film(const std::string& what, std::span<const std::int64_t> integers);
// A value that the verdict depends on beside films.
void fact(std::string_view name, std::string_view value);
void fact(std::string_view name, std::span<const float> values);
void fact(std::string_view name, std::span<const double> values);

// A piece of the test that runs, from here to the end of the block: what is rendered and noted meanwhile
// belongs to it alone, what is rendered and noted outside of parts to every part. A body whose `proved()` is
// true is to be left out; a test of which all parts are proved is not run. Parts of a test differ in name and
// do not overlap. The verdict on a part is a function of its films and of those outside of parts, so a render
// that two parts share is to be made outside.
class Part {
 public:
  explicit Part(std::string_view name);
  ~Part();
  Part(const Part&) = delete;
  Part& operator=(const Part&) = delete;
  bool proved() const { return proved_; }

 private:
  bool proved_ = false;
};

// `key` in the test that runs: what a probe keeps in order not to render it again is kept for one test. The
// digest of a test is then the same in the program of all tests and alone.
std::string in_this_test(std::string_view key);

// Number of iterations at each end of `iterations` that the probe renders, so that one batch of `batches`
// costs about a sixteenth of all; the two do not overlap, and are everything if there are 16 batches.
struct Ends {
  std::uint64_t first = 0, last = 0;
};
Ends probe_ends(std::uint64_t iterations, std::size_t batches);

// Runs the program's tests as above. The environment's CANDELA_PROOFS: unset, the committed table is used;
// `off`, all run in full; `table=FILE`, another table; `record=FILE`, what is not proved runs in full, and
// lines for those that passed are added to FILE; `record-all=FILE`, so with all. Recording wants the commit
// in CANDELA_COMMIT; CANDELA_PROOFS_KNOWN is another table that it goes by.
int run_tests();

}  // namespace candela::proofs
