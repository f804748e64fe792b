#!/bin/sh
# Claim: whatever common/base/mutex.h says is guarded by a mutex is read and written under it only, and who needs a mutex held
# is called with it held. Clang proves it for every source that takes a lock, all in one translation unit for the sake of time; a
# planted fault shows that it would tell. Usage: check_locks.sh ROOT BUILD [CCACHE], with which unchanged sources cost nothing.
set -eu
clang=$(command -v clang++ || command -v clang++-14) || { echo "skipped: there is no clang++"; exit 77; }
root=$1 build=$2 ccache=${3:-}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
check() {
  source=$1
  set -- "$clang" -std=c++20 -DFMT_SHARED -I"$root" -isystem "$build/proto" -Werror=thread-safety
  if [ -n "$ccache" ]; then  # it keeps objects, not verdicts
    "$root/deploy/ccache.sh" "$root" "$ccache" "$@" -c "$source" -o "$scratch/object.o"
  else
    "$@" -fsyntax-only "$source"
  fi
}

cat >"$scratch/fault.cpp" <<'END'
#include "common/base/mutex.h"
class Account {
 public:
  int balance() { return balance_; }

 private:
  candela::Mutex mutex_;
  int balance_ CANDELA_GUARDED_BY(mutex_) = 0;
};
int main() { return Account().balance(); }
END
if check "$scratch/fault.cpp" 2>/dev/null; then
  echo "clang does not see a planted fault" >&2
  exit 1
fi

# The list lies in the folder of the build, where another clone has it too.
cd "$root"
grep -rlE '\bLock [a-z_]+\(' --include='*.cpp' common master worker/service client | sort | sed 's/.*/#include "&"/' >"$build/locks.cpp"
check "$build/locks.cpp"
