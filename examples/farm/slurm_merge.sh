#!/usr/bin/env bash
#SBATCH --job-name=halfshade-merge
#SBATCH --ntasks=1
# Runs once all tasks of the array have ended well.
set -euo pipefail
directory=$1 output=$2
"${HALFSHADE:-halfshade}" merge "$directory"/* --output "$output"
rm -r "$directory"
