#!/bin/sh
# Claim: a master has neither a reader of scenes nor any of the renderer: it keeps scenes as bytes. `candela`, which has both,
# shows that they are still called so. Usage: check_links.sh MASTER CANDELA
set -eu
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
nm -C "$1" >"$scratch/master"
nm -C "$2" >"$scratch/candela"
for part in pugi candela::description candela::scene candela::transport candela::integrators; do
  if ! grep -q "\b$part::" "$scratch/candela"; then
    echo "$2 has no $part: what should a master not have?" >&2
    exit 1
  fi
  if grep "\b$part::" "$scratch/master" >&2; then
    echo "$1 has $part" >&2
    exit 1
  fi
done
