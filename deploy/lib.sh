# shellcheck shell=bash
# Shared by deploy/quickstart and deploy/check. To be sourced by bash, from the top of the checkout.

say() { printf '==> %s\n' "$*"; }
fail() {
  printf 'error: %s\n' "$*" >&2
  exit 1
}

installed() { [[ $(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null) == installed ]]; }

# Installs those packages of the given lists that are missing. Asks nobody and, where all are there, needs no network.
# "a|b": either will do, and a is installed where there is neither.
install_packages() {
  local missing=() package alternative
  while read -r package; do
    [[ -z $package || $package == \#* ]] && continue
    for alternative in ${package//|/ }; do
      installed "$alternative" && continue 2
    done
    missing+=("${package%%|*}")
  done < <(cat "$@")
  if ((${#missing[@]} == 0)); then
    say "all Debian packages are there"
    return
  fi
  command -v apt-get >/dev/null || fail "these Debian 12 packages are missing: ${missing[*]}"
  local as_root=()
  if ((EUID != 0)); then
    command -v sudo >/dev/null || fail "run as root, or install sudo; these packages are missing: ${missing[*]}"
    as_root=(sudo)
  fi
  say "installing ${#missing[@]} Debian packages"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q update </dev/null ||
    fail "apt-get update failed: is there a network?"
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q install -y --no-install-recommends "${missing[@]}" \
    </dev/null || fail "apt-get could not install: ${missing[*]}"
}

# configure_and_build ON|OFF: with or without the tests, into build/.
configure_and_build() {
  say "configuring"
  cmake -G Ninja -S . -B build -DCANDELA_TESTS="$1" </dev/null
  say "building (the first time takes some minutes)"
  cmake --build build --parallel "$(nproc)" </dev/null
}
