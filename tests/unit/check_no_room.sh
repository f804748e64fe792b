#!/bin/sh
# Claim: a render that may not write what it must (a limit on file sizes stands for a full disk) neither dies by a signal nor
# hangs nor says nothing: it ends with exit code 1 and one line that names the file and the cause.
# Usage: check_no_room.sh CANDELA SCENE
candela=$1
scene=$2
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
render() { # LIMIT ITERATIONS OPTIONS...; the limit in units of 512 bytes
  (
    ulimit -f "$1"
    iterations=$2
    shift 2
    timeout 60 "$candela" render "$scene" --size 400x300 --iterations "$iterations" --quiet -o "$folder/out.exr" "$@" \
      2>"$folder/err"
  )
  code=$?
  cat "$folder/err"
}
expect_code() {
  [ $code -eq "$1" ] || { echo "exit code $code, not $1"; exit 1; }
}
expect_error() {
  expect_code 1
  grep -q "candela: error: $1" "$folder/err" || { echo "no error that says why"; exit 1; }
}
film=3000   # enough for the image, not for a checkpoint
nothing=600 # enough for the ledger, for neither image nor checkpoint

echo "--- no room for anything"
render $nothing 2
expect_error '.*cannot write: File too large (make room, then go on with: .* --resume)'
[ ! -e "$folder/out.exr" ] || { echo "there is half an image"; exit 1; }
[ -d "$folder/out.exr.candela" ] || { echo "the state is gone"; exit 1; }

# Claim: the state that is kept goes on.
echo "--- room again"
render unlimited 2 --resume --keep-state
expect_code 0
cp "$folder/out.exr" "$folder/two.exr"

# Claim: the image is what the user asked for: once it is written whole the command succeeds, and a state that stays behind
# it is one warning naming its folder.
echo "--- room for the image alone"
render $film 4 --resume --keep-state
expect_code 0
warnings=$(grep -c 'candela: warning: ' "$folder/err")
[ "$warnings" -eq 1 ] || { echo "$warnings warnings"; exit 1; }
grep -q "candela: warning: $folder/out.exr.candela: the state lacks the last iterations: .*File too large" "$folder/err" ||
  { echo "no warning that names the state"; exit 1; }
cmp -s "$folder/out.exr" "$folder/two.exr" && { echo "the image is the old one"; exit 1; }

# Claim: an image that cannot be written leaves the one before, and the state to go on from.
echo "--- no room for a larger image"
cp "$folder/out.exr" "$folder/four.exr"
render $nothing 6 --resume
expect_error '.*out.exr: cannot write: File too large (make room, then go on with: .* --resume)'
cmp -s "$folder/out.exr" "$folder/four.exr" || { echo "the image is another"; exit 1; }
render unlimited 6 --resume
expect_code 0
[ ! -e "$folder/out.exr.candela" ] || { echo "the state is still there"; exit 1; }
