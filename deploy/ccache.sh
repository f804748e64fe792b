#!/bin/sh
# ccache.sh CHECKOUT CCACHE COMPILER ARGUMENT...: compiles by ccache. The build calls it (CMakeLists.txt).
#
# A precompiled header is removed before it is made anew. If an old one is there, ccache 4.7 takes the old one's content
# as that of all headers in it, and may return what was made from other headers.
checkout=$1
shift
before=
for argument; do
  case "$before $argument" in "-o "*.gch) rm -f -- "$argument" ;; esac
  before=$argument
done
# The sloppiness that ccache needs if precompiled headers are in use. Paths below the checkout are hashed as relative
# ones, so that another clone finds the objects of this one. Hashes of files are kept by inode and times: a precompiled
# header has 90 to 360 MB, and each compile would hash it again, for up to half a second.
export CCACHE_SLOPPINESS=pch_defines,time_macros CCACHE_BASEDIR="$checkout" CCACHE_NOHASHDIR=true CCACHE_INODECACHE=true
exec "$@"
