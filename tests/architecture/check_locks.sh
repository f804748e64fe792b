#!/bin/sh
# Claim: whatever common/base/mutex.h says is guarded by a mutex is read and written under it only, and who needs a mutex held
# is called with it held. Clang proves it for every source that takes a lock, all in one translation unit for the sake of time; a
# planted fault shows that it would tell. Usage: check_locks.sh ROOT GENERATED
set -eu
clang=$(command -v clang++ || command -v clang++-14) || { echo "skipped: there is no clang++"; exit 77; }
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
check() {
  "$clang" -std=c++20 -DFMT_SHARED -I"$1" -isystem "$2" -fsyntax-only -Werror=thread-safety "$3"
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
if check "$1" "$2" "$scratch/fault.cpp" 2>/dev/null; then
  echo "clang does not see a planted fault" >&2
  exit 1
fi

cd "$1"
grep -rlE '\bLock [a-z_]+\(' --include='*.cpp' common master worker/service client | sed 's/.*/#include "&"/' >"$scratch/locks.cpp"
check "$1" "$2" "$scratch/locks.cpp"
