#!/usr/bin/env bash
# Fleets as real processes on loopback: one one-thread worker, one two-thread worker, two one-thread workers; seconds from
# submission to the final checkpoint of the same job, in turn, and medians. Needs an otherwise idle machine of two
# processors.
#
#   tests/bench/scaling.sh [BUILD_BIN] [SCENE] [SIZE] [ITERATIONS] [ROUNDS] [OPTIONS OF submit ...]
#   tests/bench/scaling.sh build/bin deploy/scenes/studio/scene.xml 480x270 8 3 --integrator mmlt
set -euo pipefail
shopt -s inherit_errexit  # a run is timed in $(...)
here=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
bin=${1:-$here/build/bin}
scene=${2:-$here/deploy/scenes/studio/scene.xml}
size=${3:-480x270}
iterations=${4:-192}
rounds=${5:-3}
options=("${@:6}")

for program in candela candela-master candela-worker; do
  [[ -x $bin/$program ]] || { echo "scaling.sh: error: $bin/$program is missing: build it, or name its folder" >&2; exit 2; }
done
work=$(mktemp -d)
pids=()
stop_all() {
  for pid in "${pids[@]:-}"; do [[ -n $pid ]] && kill "$pid" 2>/dev/null || :; done
  wait 2>/dev/null || :
  pids=()
}
trap 'stop_all; rm -rf "$work"' EXIT

# run NAME THREADS WORKERS: prints seconds
run() {
  local name=$1 threads=$2 workers=$3 data="$work/$1"
  rm -rf "$data" && mkdir -p "$data"
  "$bin/candela-master" --listen 127.0.0.1:0 --data "$data/master" --log-level error >"$data/ready" &
  pids+=($!)
  local address=
  for _ in $(seq 100); do
    address=$(sed -n 's/^listening on //p' "$data/ready")
    [[ -n $address ]] && break
    sleep 0.05
  done
  export CANDELA_MASTER=$address
  for i in $(seq "$workers"); do
    "$bin/candela-worker" --master "$address" --cache "$data/cache$i" --threads "$threads" --log-level error &
    pids+=($!)
  done
  for _ in $(seq 300); do
    [[ $("$bin/candela" workers --json | grep -c '"id"') == "$workers" ]] && break
    sleep 0.1
  done
  [[ $("$bin/candela" workers --json | grep -c '"id"') == "$workers" ]] || { stop_all; echo "scaling.sh: error: the workers do not come" >&2; exit 1; }
  local begin end
  begin=$(date +%s.%N)
  "$bin/candela" submit "$scene" --size "$size" --iterations "$iterations" --seed 1 --wait "${options[@]}" >"$data/submitted" 2>&1 || { cat "$data/submitted" >&2; stop_all; exit 1; }
  end=$(date +%s.%N)
  stop_all
  echo "$end - $begin" | bc
}

for round in $(seq "$rounds"); do
  a=$(run "one-$round" 1 1)
  b=$(run "wide-$round" 2 1)
  c=$(run "two-$round" 1 2)
  printf 'round %d: one one-thread worker %.2f s, one two-thread worker %.2f s, two one-thread workers %.2f s\n' \
    "$round" "$a" "$b" "$c"
  echo "$a" >>"$work/a" && echo "$b" >>"$work/b" && echo "$c" >>"$work/c"
done
median() { sort -n "$1" | awk '{v[NR]=$1} END {print v[int((NR+1)/2)]}'; }
a=$(median "$work/a") b=$(median "$work/b") c=$(median "$work/c")
printf 'medians: %.2f, %.2f and %.2f s\n' "$a" "$b" "$c"
printf 'two one-thread workers do %.3f of the work of one two-thread worker\n' "$(echo "scale=4; $b / $c" | bc)"
printf 'two one-thread workers against one: parallel efficiency %.3f\n' "$(echo "scale=4; $a / (2 * $c)" | bc)"
