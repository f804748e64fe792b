#!/bin/sh
# Claim: a render that may not write what it must (a limit on file sizes stands for a full disk) neither dies by a signal nor
# hangs nor says nothing: it ends with exit code 1 and one line that names the file and the cause.
# Usage: check_no_room.sh CANDELA SCENE
candela=$1
scene=$2
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
ulimit -f 600 # units of 512 bytes: enough for the ledger, not for a film of this size
timeout 60 "$candela" render "$scene" --size 400x300 --iterations 2 --quiet -o "$folder/out.exr" 2>"$folder/err"
code=$?
cat "$folder/err"
[ $code -eq 1 ] || { echo "exit code $code, not 1"; exit 1; }
grep -q 'candela: error: .*cannot write: File too large' "$folder/err" || { echo "no error that says why"; exit 1; }
[ ! -e "$folder/out.exr" ] || { echo "there is half an image"; exit 1; }
