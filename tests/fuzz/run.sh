#!/usr/bin/env bash
# Builds every fuzz target and runs each for the given time: tests/fuzz/run.sh [--build FOLDER] [--only NAME] [SECONDS]
#
# An input that crashes, takes more than 5 seconds or 2 GB is a failure; it is left in FOLDER/crashes. The corpus stays in
# FOLDER/corpus, so that the next run goes on where this one ended. Files of ../shared/scenes join the seeds where there are some.
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
root="$(cd "$here/../.." && pwd)"
build="$root/build-fuzz"
only=""
seconds=60
while [[ $# -gt 0 ]]; do
  case "$1" in
    --build) build="$2"; shift 2 ;;
    --only) only="$2"; shift 2 ;;
    [0-9]*) seconds="$1"; shift ;;
    *) echo "usage: tests/fuzz/run.sh [--build FOLDER] [--only NAME] [SECONDS]" >&2; exit 2 ;;
  esac
done

if [[ -n "$only" && ! -f "$here/targets/fuzz_$only.cpp" ]]; then
  echo "tests/fuzz/run.sh: --only $only: no such target; there are" \
       "$(basename -as .cpp "$here"/targets/fuzz_*.cpp | sed 's/^fuzz_//' | paste -sd ' ')" >&2
  exit 2
fi

clang=""
for candidate in "${CANDELA_CLANG:-}" clang++-14 clang++; do
  [[ -n "$candidate" ]] && command -v "$candidate" >/dev/null && { clang="$candidate"; break; }
done
# In the words that deploy/check reads of skipped tests and their reasons.
skip() {
  printf 'tests/fuzz/run.sh: Skipped\n%s\n[  SKIPPED ] fuzz_readers (0 ms)\n' "$1"
  exit 77
}
[[ -n "$clang" ]] || skip "there is no clang++ (Debian: clang-14)"
if ! echo 'extern "C" int LLVMFuzzerTestOneInput(const unsigned char*, unsigned long) { return 0; }' |
     "$clang" -fsanitize=fuzzer,address -x c++ - -o /dev/null 2>/dev/null; then
  skip "$clang has no libFuzzer runtime (Debian: libclang-rt-14-dev)"
fi

mkdir -p "$build"
cmake -G Ninja -S "$here/targets" -B "$build" -DCMAKE_CXX_COMPILER="$clang" -DCMAKE_BUILD_TYPE=None >"$build/configure.log" 2>&1 ||
  { cat "$build/configure.log"; exit 1; }
cmake --build "$build" >"$build/build.log" 2>&1 || { cat "$build/build.log"; exit 1; }

# Real files of at most 200 kB, by what the target reads.
copy_shared() {
  local target="$1" into="$2" pattern
  local scenes="${CANDELA_SHARED_SCENES:-$root/../shared/scenes}"
  [[ -d "$scenes" ]] || return 0
  case "$target" in
    scene) pattern='*.xml' ;;
    pbrt) pattern='*.pbrt' ;;
    obj) pattern='*.obj' ;;
    ply) pattern='*.ply' ;;
    serialized) pattern='*.serialized' ;;
    volume) pattern='*.vol' ;;
    image) pattern='*.[pjhet][npdxg][gri]' ;;
    *) return 0 ;;
  esac
  find -L "$scenes" -iname "$pattern" -size -200k -type f | sort | head -20 | while read -r file; do
    cp "$file" "$into/shared-$(basename "$file")"
  done
}

failed=0
for program in "$build"/bin/fuzz_*; do
  name="$(basename "$program")"
  name="${name#fuzz_}"
  [[ -z "$only" || "$only" == "$name" ]] || continue
  corpus="$build/corpus/$name"
  crashes="$build/crashes/$name"
  mkdir -p "$corpus" "$crashes" "$build/shared/$name" "$build/scratch"
  copy_shared "$name" "$build/shared/$name"
  options=(-max_total_time="$seconds" -timeout=5 -rss_limit_mb=2048 -max_len=65536 -artifact_prefix="$crashes/" -print_final_stats=1)
  [[ -f "$here/$name.dict" ]] && options+=(-dict="$here/$name.dict")
  seeds=("$build/shared/$name")
  [[ -d "$here/seeds/$name" ]] && seeds+=("$here/seeds/$name")
  log="$build/$name.log"
  # The seeds first, each once: a broken one fails whatever the time.
  if TMPDIR="$build/scratch" LSAN_OPTIONS="suppressions=$here/leaks.supp:print_suppressions=0" UBSAN_OPTIONS=print_stacktrace=1 \
     "$program" "${options[@]}" "$corpus" "${seeds[@]}" >"$log" 2>&1; then
    echo "fuzz: $name: $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") inputs," \
         "$(grep -ao 'cov: [0-9]*' "$log" | tail -1), no failure in $seconds s"
  else
    failed=1
    echo "fuzz: $name FAILED; inputs in $crashes:"
    grep -aE 'ERROR|SUMMARY|runtime error|Test unit written|^    #[0-9] ' "$log" | head -30
  fi
done
exit "$failed"
