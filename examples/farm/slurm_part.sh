#!/usr/bin/env bash
#SBATCH --job-name=halfshade-part
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
# One task of the array that slurm_submit.sh submits: part SLURM_ARRAY_TASK_ID. Asked for again, a finished part is left.
set -euo pipefail
split=$1 parts=$2 directory=$3
shift 3
part=$directory/$SLURM_ARRAY_TASK_ID
[[ -f $part/part.json ]] && exit 0
exec "${HALFSHADE:-halfshade}" render "$@" --split "$split" --part "$SLURM_ARRAY_TASK_ID/$parts" --output "$part" \
  --threads "${SLURM_CPUS_PER_TASK:-1}" --quiet
