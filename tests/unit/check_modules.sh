#!/bin/sh
# Claims: a master, a render, and a conversion of OpenEXR to PNG need no module of images. A worker without it says so when it
# starts, and a scene or a conversion with an image of another format when it meets the image, in one line that names the module
# and the mend. With the module in ../lib/candela, or where the dynamic linker looks, they go on. A file that is no module, and one
# of another version, are errors too.
# Usage: check_modules.sh PROGRAMS SCENE
programs=$1
scene=$2
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder/bin" "$folder/lib/candela"
cp "$programs/candela" "$programs/candela-master" "$programs/candela-worker" "$folder/bin"
refused() { # CODE TEXT PROGRAM ARGUMENTS...
  wanted=$1
  text=$2
  program=$3
  shift 3
  timeout 120 "$folder/bin/$program" "$@" >"$folder/out" 2>"$folder/err"
  code=$?
  cat "$folder/err"
  [ $code -eq "$wanted" ] || { echo "$program: exit code $code, not $wanted"; exit 1; }
  [ "$(wc -l <"$folder/err")" -eq 1 ] || { echo "$program: not one line"; exit 1; }
  grep -q "$text" "$folder/err" || { echo "$program: no error that says '$text'"; exit 1; }
}
render() { # SCENE
  timeout 300 "$folder/bin/candela" render "$1" --size 8x8 --iterations 1 --quiet --fresh -o "$folder/out.exr"
}
printf 'P6\n2 1\n255\n\1\2\3\4\5\6' >"$folder/two.ppm"
printf 'P3\n2 1\n255\n10 20 30 40 50 60\n' >"$folder/ascii.ppm"
cat >"$folder/textured.xml" <<END
<scene version="3.0.0">
  <integrator type="path"/>
  <sensor type="perspective"><transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform></sensor>
  <shape type="rectangle">
    <bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string name="filename" value="ascii.ppm"/></texture></bsdf>
  </shape>
  <emitter type="constant"/>
</scene>
END

echo "--- without the module"
render "$scene" || exit 1
timeout 120 "$folder/bin/candela" convert "$folder/out.exr" "$folder/out.png" || exit 1
timeout 120 "$folder/bin/candela" compare "$folder/out.exr" "$folder/out.png" || exit 1
: >"$folder/listening"
"$folder/bin/candela-master" --data "$folder/data" --listen 127.0.0.1:0 >"$folder/listening" &
master=$!
i=0
until grep -q "^listening" "$folder/listening"; do
  i=$((i + 1))
  [ $i -lt 600 ] || { kill $master; echo "the master does not listen"; exit 1; }
  sleep 0.1
done
kill $master
wait $master
mend="candela-images.so is missing (install candela-images.so of this version into $folder/bin or $folder/lib/candela)"
refused 1 "$mend" candela-worker --master 127.0.0.1:1 --cache "$folder/cache"
refused 1 "cannot load a module: candela-images.so: .*(install candela-images.so of this version" candela convert "$folder/two.ppm" "$folder/out.png"
refused 1 "cannot load a module: candela-images.so: .*(install candela-images.so of this version" candela convert "$folder/out.exr" "$folder/out.jpg"
refused 1 "ascii.ppm: $mend" candela render "$folder/textured.xml" --size 8x8 --iterations 1 --quiet --fresh -o "$folder/out.exr"

echo "--- a file that is no module"
echo "no module" >"$folder/bin/candela-images.so"
refused 1 "cannot load a module: .*candela-images.so" candela convert "$folder/two.ppm" "$folder/out.png"
echo "--- a module of another version"
cp "$programs/libclock_shift.so" "$folder/bin/candela-images.so"
refused 1 "candela-images.so is of another version, without candela_image_codec_3" candela convert "$folder/two.ppm" "$folder/out.png"
rm "$folder/bin/candela-images.so"

echo "--- in lib/candela, and where the dynamic linker looks"
cp "$programs/candela-images.so" "$folder/lib/candela"
render "$folder/textured.xml" || exit 1
mkdir "$folder/elsewhere"
mv "$folder/lib/candela/candela-images.so" "$folder/elsewhere"
LD_LIBRARY_PATH=$folder/elsewhere render "$folder/textured.xml" || exit 1
[ -s "$folder/out.exr" ] || { echo "there is no image"; exit 1; }
