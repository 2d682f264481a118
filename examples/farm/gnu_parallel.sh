#!/usr/bin/env bash
# Renders a picture in parts with GNU parallel, then merges them:
#
#   gnu_parallel.sh SPLIT PARTS JOBS OUTPUT SCENE [options of halfshade render]
#
# SPLIT is crop, frames, samples or blockers. HALFSHADE names the program, THREADS what each job may use (default 1).
# Parts that were finished stay in OUTPUT.parts when something fails, and are not made again.
set -euo pipefail
split=$1 parts=$2 jobs=$3 output=$4
shift 4
halfshade=${HALFSHADE:-halfshade}
directory=$output.parts
mkdir -p "$directory"

unfinished() {
  local i
  for ((i = 1; i <= parts; ++i)); do [[ -f $directory/$i/part.json ]] || echo "$i"; done
}

unfinished | parallel --will-cite --jobs "$jobs" --halt now,fail=1 --quote \
  "$halfshade" render "$@" --split "$split" --part "{}/$parts" --output "$directory/{}" \
  --threads "${THREADS:-1}" --quiet

"$halfshade" merge "$directory"/* --output "$output"
rm -r "$directory"
