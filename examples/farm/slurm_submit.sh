#!/usr/bin/env bash
# Renders a picture as a Slurm job array, with a job that merges the parts behind it; prints the number of that job:
#
#   slurm_submit.sh SPLIT PARTS OUTPUT SCENE [options of halfshade render]
#
# SPLIT is crop, frames, samples or blockers. OUTPUT and SCENE must lie where all nodes see them. HALFSHADE names the
# program. Options for sbatch (partition, time limit) go into SBATCH_... variables or into the two scripts.
set -euo pipefail
split=$1 parts=$2 output=$3
shift 3
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
mkdir -p "$output.parts"
array=$(sbatch --parsable --array="1-$parts" --output="$output.parts.%a.log" \
  "$here/slurm_part.sh" "$split" "$parts" "$output.parts" "$@")
sbatch --parsable --dependency="afterok:$array" --kill-on-invalid-dep=yes --output="$output.merge.log" \
  "$here/slurm_merge.sh" "$output.parts" "$output"
