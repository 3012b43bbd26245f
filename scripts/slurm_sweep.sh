#!/bin/sh
# Flies a sweep as an array job of Slurm: each task flies one shard. A task that is started again continues its shard.
#
# Usage: sbatch --array=1-N scripts/slurm_sweep.sh EXPERIMENT FOLDER [OPTION]...
#
# FOLDER must be on a file system that all nodes share. Task i writes its shard to FOLDER/i. Options are passed to `skein sweep`.
# SKEIN names the program [default: skein in PATH]. When all tasks are done, put the shards together:
#
#   skein sweep merge FOLDER/*
#
#SBATCH --job-name=skein-sweep
#SBATCH --requeue
set -eu
if [ $# -lt 2 ]; then
    echo "usage: sbatch --array=1-N $0 EXPERIMENT FOLDER [OPTION]..." >&2
    exit 2
fi
: "${SLURM_ARRAY_TASK_ID:?expected an array job, such as sbatch --array=1-7}" "${SLURM_ARRAY_TASK_COUNT:?}"
experiment=$1
folder=$2
shift 2
mkdir -p "$folder"
exec "${SKEIN:-skein}" sweep "$experiment" --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" \
    --out "$folder/$SLURM_ARRAY_TASK_ID" --jobs "${SLURM_CPUS_PER_TASK:-1}" --quiet "$@"
