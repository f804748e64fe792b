#!/usr/bin/env bash
# Every citation in sources and docs, such as [Surname 1997, Eq. 3] or [Surname and Other 2014], has its key SurnameYEAR in
# docs/references.bib. usage: check_citations.sh SOURCE_DIR
set -euo pipefail
cd "$1"
cited=$(grep -rhoE '\[[A-Z][A-Za-z]+[^]]{0,40} (19|20)[0-9]{2}[^]]*\]' --include='*.cpp' --include='*.h' --include='*.md' \
  common worker master client docs | sed -E 's/^\[([A-Za-z]+).* ((19|20)[0-9]{2}).*/\1\2/' | sort -u)
[[ -n $cited ]] || { echo "no citation found: the pattern is broken" >&2; exit 1; }
result=0
for key in $cited; do
  grep -qE "^@[a-z]+\{$key," docs/references.bib || { echo "not in docs/references.bib: $key" >&2; result=1; }
done
echo "$(wc -w <<<"$cited") works cited"
exit $result
