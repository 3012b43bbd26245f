#!/bin/sh
# Tries scripts/slurm_sweep.sh with a real Slurm of one node on this machine: flies a sweep of 1000 runs in 7 shards, kills two of them,
# which Slurm starts again, merges the shards, and compares the result with that of the sweep in one piece.
#
# Usage: scripts/try_slurm.sh [RUNS]
#
# Needs root and Debian's packages slurmctld, slurmd, slurm-client and munge. It starts daemons of its own with a configuration of its own,
# and ends them. SKEIN names the program [default: target/release/skein].
set -eu
cd "$(dirname "$0")/.."
runs=${1:-1000}
for program in slurmctld slurmd sbatch squeue scontrol scancel munged; do
    if ! command -v "$program" >/dev/null; then
        echo "skipped: expected the program $program (apt install slurmctld slurmd slurm-client munge)" >&2
        exit 0
    fi
done
if [ "$(id -u)" != 0 ]; then
    echo "skipped: expected to run as root, as slurmd does" >&2
    exit 0
fi
SKEIN=$(realpath "${SKEIN:-target/release/skein}")
export SKEIN
work=$(mktemp -d)
chmod 755 "$work"
daemons=
finish() {
    for pid in $daemons; do kill "$pid" 2>/dev/null || true; done
    wait
    if [ -n "${KEEP:-}" ]; then echo "kept: $work"; else rm -rf "$work"; fi
}
trap finish EXIT
cores=$(nproc)
mkdir "$work/state" "$work/spool" "$work/munge"
chmod 700 "$work/munge"
dd if=/dev/urandom of="$work/munge/key" bs=1024 count=1 2>/dev/null
chmod 400 "$work/munge/key"
cat >"$work/slurm.conf" <<CONF
ClusterName=try
SlurmctldHost=$(hostname)(127.0.0.1)
SlurmctldPort=16817
SlurmdPort=16818
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=$work/munge/socket
CredType=cred/munge
StateSaveLocation=$work/state
SlurmdSpoolDir=$work/spool
SlurmctldPidFile=$work/slurmctld.pid
SlurmdPidFile=$work/slurmd.pid
SlurmctldLogFile=$work/slurmctld.log
SlurmdLogFile=$work/slurmd.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
SchedulerParameters=requeue_delay=0,sched_min_interval=0
JobRequeue=1
MpiDefault=none
NodeName=$(hostname) NodeAddr=127.0.0.1 CPUs=$cores State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
CONF
export SLURM_CONF="$work/slurm.conf"
munged --foreground --force --socket="$work/munge/socket" --key-file="$work/munge/key" --pid-file="$work/munge/pid" \
    --log-file="$work/munge/log" --seed-file="$work/munge/seed" 2>"$work/munge/err" &
daemons=$!
slurmctld -D -f "$SLURM_CONF" 2>/dev/null &
daemons="$daemons $!"
slurmd -D -f "$SLURM_CONF" 2>/dev/null &
daemons="$daemons $!"
ready() { sinfo -h -o %T 2>/dev/null | grep -q idle; }
tries=0
until ready; do
    tries=$((tries + 1))
    if [ $tries -gt 300 ]; then
        echo "Slurm is not ready: its logs end with" >&2
        tail -n 5 "$work"/slurm*.log "$work/munge/log" >&2
        exit 1
    fi
    sleep 0.1
done
cat >"$work/sweep.toml" <<SWEEP
name = "try-slurm"
scenario = "$(pwd)/scenarios/paper/s1-left.toml"
seeds = $runs

[grid]
formation.start_jitter_m = 1
SWEEP
flown() { cat "$work/shards/$1/rows.jsonl" 2>/dev/null | wc -l; }
"$SKEIN" sweep "$work/sweep.toml" --out "$work/whole" --jobs "$cores" --quiet
job=$(sbatch --parsable --array=1-7 --output="$work/task-%a.log" scripts/slurm_sweep.sh "$work/sweep.toml" "$work/shards")
echo "job $job: 7 shards of $runs runs"
for task in 1 2; do
    until [ "$(flown "$task")" -gt 5 ]; do sleep 0.02; done
    scontrol requeue "${job}_$task"
    echo "shard $task is killed after $(flown "$task") runs, and starts again"
done
while [ -n "$(squeue -h -j "$job" 2>/dev/null)" ]; do sleep 0.2; done
cat "$work"/task-*.log
"$SKEIN" sweep merge "$work"/shards/* --out "$work/merged" --quiet
# The rows are in the order in which the runs ended; all other files have an order of their own.
for folder in whole merged; do sort "$work/$folder/rows.jsonl" >"$work/$folder.rows"; done
cmp "$work/whole.rows" "$work/merged.rows"
diff -r --exclude=rows.jsonl "$work/whole" "$work/merged"
echo "merged: all files of $(wc -l <"$work/merged/rows.jsonl") runs are those of the sweep in one piece"
