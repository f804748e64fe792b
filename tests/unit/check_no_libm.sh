#!/bin/sh
# Claim (law 3): the renderer calls no libm function whose bits may depend on the machine. glibc chooses sinf, expf, powf ... by CPU
# at run time; worker/core/math.h is what the renderer uses instead. Usage: check_no_libm.sh LIBRARY.a
set -eu
[ -s "$1" ] || { echo "no library at $1" >&2; exit 1; }
forbidden='sin|cos|tan|sincos|asin|acos|atan|atan2|sinh|cosh|tanh|exp|exp2|expm1|log|log2|log10|log1p|pow|cbrt|hypot|erf|erfc|tgamma|lgamma'
symbols=$(nm -A -u "$1")
if found=$(printf '%s\n' "$symbols" | grep -E " U ($forbidden)f?l?(@.*)?\$"); then
  echo "the renderer calls libm where it should call worker/core/math.h:" >&2
  echo "$found" >&2
  exit 1
fi
