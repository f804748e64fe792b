#!/usr/bin/env bash
# check_ccache.sh LAUNCHER: deploy/ccache.sh returns a precompiled header made from the present headers, although another
# change of the same headers was compiled before; and returns from the cache what was made before. Exit code 77: no ccache.
set -euo pipefail
launcher=$1
for program in ccache g++; do
  command -v $program >/dev/null || {
    echo "skipped: there is no $program"
    exit 77
  }
done
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
unset "${!CCACHE_@}"
export CCACHE_DIR=$work/cache CCACHE_TEMPDIR=$work/cache/tmp CCACHE_STATSLOG=$work/stats

printf '#include "generated.h"\n' >all.hxx
: >all.hxx.cxx
printf 'int main() { return kValue; }\n' >program.cpp
compile() { "$launcher" "$work" ccache g++ -fpch-preprocess -Winvalid-pch "$@"; }
# value WANTED: builds with a header of that value, as the build does after a change of a .proto file.
value() {
  printf 'enum { kValue = %d };\n' "$1" >generated.h
  compile -x c++-header -include "$work/all.hxx" -o all.hxx.gch -c all.hxx.cxx
  compile -include "$work/all.hxx" -o program.o -c program.cpp
  g++ program.o -o program
  local is=0
  ./program || is=$?
  [[ $is == "$1" ]] || {
    echo "error: a header says $1, but the program has $is: the precompiled header is of another header" >&2
    exit 1
  }
}
# From one precompiled header (1), that of a fresh clone, two different changes are made (2, 3).
for wanted in 1 2; do value "$wanted"; done
rm all.hxx.gch
for wanted in 1 3; do value "$wanted"; done
rm "$CCACHE_STATSLOG"
for wanted in 2 1 3; do value "$wanted"; done
hits=$(awk '/^direct_cache_hit$/ { n++ } END { print n + 0 }' "$CCACHE_STATSLOG")
[[ $hits == 6 ]] || {
  echo "error: of six objects that were compiled before $hits came from the cache" >&2
  exit 1
}
