#!/usr/bin/env bash
# Makes the error-over-time report of docs/benchmarks.md: all integrators on scenes of this repository, whose references it
# renders first (half an hour of CPU time, once), and, where a folder S has scenes/NAME/scene.xml and references/NAME.exr, on
# four of Bitterli's. Goes on where it was stopped.
#   tests/bench/error_over_time.sh BUILD/bin OUT [S]       (SECONDS_A_RUN=8 SEEDS=4 INTEGRATORS="path bdpt ..." to change)
set -euo pipefail
bin=${1:?usage: error_over_time.sh BUILD/bin OUT [S]}
out=${2:?usage: error_over_time.sh BUILD/bin OUT [S]}
shared=${3:-}
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
seconds=${SECONDS_A_RUN:-8}
seeds=${SEEDS:-4}
integrators=${INTEGRATORS:-path light bdpt ppm bpm vcm mcppm pssmlt mmlt}
# The report comes last, hours later: what it needs is asked for now.
"$root/tests/bench/report.py" --help >/dev/null
[[ -x $bin/candela-bench ]] || { echo "error_over_time.sh: error: $bin/candela-bench is missing: build it first" >&2; exit 2; }
mkdir -p "$out"
out=$(cd "$out" && pwd)
list=$out/list.toml

printf 'time = %s\nseeds = %s\nout = "results"\n' "$seconds" "$seeds" >"$list.part"
add_scene() { printf '\n[[scene]]\nname = "%s"\nfile = "%s"\nreference = "%s"\n' "$1" "$2" "$3" >>"$list.part"; }

# Two unbiased integrators that differ in kind; the iterations make the reference's own error a tenth of what is measured or less.
own_scene() { # NAME FILE SIZE ITERATIONS
  [[ -f $out/$1.exr ]] ||
    "$bin/candela-bench" reference --scene "$root/$2" --size "$3" --integrators bdpt,path --iterations "$4" --threads "$(nproc)" --out "$out/$1.exr"
  add_scene "$1" "$root/$2" "$out/$1.exr"
}
own_scene cornell deploy/scenes/cornell/scene.xml 128x128 8192
own_scene studio deploy/scenes/studio/scene.xml 240x135 4096
own_scene furnace deploy/scenes/furnace/scene.xml 128x128 4096
own_scene lamp-over-plane deploy/scenes/lamp-over-plane/scene.xml 192x128 4096
if [[ -n $shared ]]; then
  shared=$(cd "$shared" && pwd)
  for name in cornell-box veach-mis veach-bidir veach-ajar; do
    add_scene "$name" "$shared/scenes/$name/scene.xml" "$shared/references/$name.exr"
  done
fi
for name in $integrators; do printf '\n[[run]]\nintegrator = "%s"\n' "$name" >>"$list.part"; done
mv "$list.part" "$list"

"$bin/candela-bench" run "$list"
"$root/tests/bench/report.py" "$out/results" --baseline path --peers "$root/tests/bench/peers.csv" --out "$out/report.html"
"$root/tests/bench/report.py" "$out/results" --baseline path --peers "$root/tests/bench/peers.csv" --figures relmse_trimmed --out "$out/trimmed.html" --markdown "$out/error-over-time.md"
echo "$out/report.html"
