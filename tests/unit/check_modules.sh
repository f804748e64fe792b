#!/bin/sh
# Claims: a program without its module of images says so when it starts, in one line that names the file and the mend, and ends
# with exit code 1; with the module in ../lib/candela, or where the dynamic linker looks, it starts. A file that is no module,
# and one of another version, are errors too.
# Usage: check_modules.sh PROGRAMS SCENE
programs=$1
scene=$2
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder/bin" "$folder/lib/candela"
cp "$programs/candela" "$programs/candela-master" "$programs/candela-worker" "$folder/bin"
refused() { # TEXT PROGRAM ARGUMENTS...
  text=$1
  program=$2
  shift 2
  timeout 120 "$folder/bin/$program" "$@" >"$folder/out" 2>"$folder/err"
  code=$?
  cat "$folder/err"
  [ $code -eq 1 ] || { echo "$program: exit code $code, not 1"; exit 1; }
  [ "$(wc -l <"$folder/err")" -eq 1 ] || { echo "$program: not one line"; exit 1; }
  grep -q "$text" "$folder/err" || { echo "$program: no error that says '$text'"; exit 1; }
}
render() {
  timeout 300 "$folder/bin/candela" render "$scene" --size 8x8 --iterations 1 --quiet --fresh -o "$folder/out.exr"
}
mend="candela-images.so is missing (install candela-images.so of this version into $folder/bin or $folder/lib/candela)"
refused "$mend" candela-master --data "$folder/data" --listen 127.0.0.1:0
refused "$mend" candela-worker --master 127.0.0.1:1 --cache "$folder/cache"
refused "$mend" candela render "$scene" -o "$folder/out.exr"
[ ! -e "$folder/out.exr.candela" ] || { echo "render began without a way to write its image"; exit 1; }

echo "--- a file that is no module"
echo "no module" >"$folder/bin/candela-images.so"
refused "cannot load a module: .*candela-images.so" candela convert "$scene" "$folder/out.png"
echo "--- a module of another version"
cp "$programs/libclock_shift.so" "$folder/bin/candela-images.so"
refused "candela-images.so is of another version, without candela_image_codec_1" candela convert "$scene" "$folder/out.png"
rm "$folder/bin/candela-images.so"

echo "--- in lib/candela, and where the dynamic linker looks"
cp "$programs/candela-images.so" "$folder/lib/candela"
render || exit 1
mkdir "$folder/elsewhere"
mv "$folder/lib/candela/candela-images.so" "$folder/elsewhere"
LD_LIBRARY_PATH=$folder/elsewhere render || exit 1
[ -s "$folder/out.exr" ] || { echo "there is no image"; exit 1; }
