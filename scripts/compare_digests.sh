#!/usr/bin/env bash
# Checks that two builds of skein fly the same flights. See --help.
set -euo pipefail

usage() {
    cat <<'HELP'
Usage: scripts/compare_digests.sh OLD NEW [--jobs N] [--list]

Flies the same flights with two skein binaries and compares the digests and the outcomes. A digest covers the state of
every drone and every delivered message in every tick. Equal digests therefore mean that a change moved no drone and
changed no message. Use the script after every refactoring:

  git worktree add ../before main && (cd ../before && cargo build --release)
  cargo build --release
  scripts/compare_digests.sh ../before/target/release/skein target/release/skein

The flights cover all scenario files of this checkout, the strategies, radio presets, delays, losses, every kind of
fault with and without ranging, random scenes and several sizes of swarm. Most flights run inline; a few run by
processes. Random scenes are printed by OLD and flown by both.

The script prints one line for each flight that differs, and then a table of all flights.

Options:
  --jobs N  flights side by side [default: the number of cores]
  --list    print the flights and fly none; needs no binaries

Exit code: 0 all flights are equal, 1 a flight differs or has no digest, 2 bad usage.
HELP
}

fail_usage() {
    echo "compare_digests: $1" >&2
    usage >&2
    exit 2
}

root=$(cd "$(dirname "$0")/.." && pwd)
jobs=$(nproc 2>/dev/null || echo 2)
list=
binaries=()
while [ $# -gt 0 ]; do
    case $1 in
    -h | --help)
        usage
        exit 0
        ;;
    --jobs)
        [ $# -ge 2 ] || fail_usage '--jobs needs a number'
        jobs=$2
        shift
        ;;
    --jobs=*) jobs=${1#--jobs=} ;;
    --list) list=yes ;;
    -*) fail_usage "unknown option $1" ;;
    *) binaries+=("$1") ;;
    esac
    shift
done
[[ $jobs =~ ^[1-9][0-9]*$ ]] || fail_usage "--jobs needs a number above 0, not $jobs"
if [ -z "$list" ]; then
    [ ${#binaries[@]} -eq 2 ] || fail_usage "expected two binaries, not ${#binaries[@]}"
    for binary in "${binaries[@]}"; do
        [ -x "$binary" ] || fail_usage "$binary is not an executable file"
    done
    old=$(realpath "${binaries[0]}")
    new=$(realpath "${binaries[1]}")
fi

# The flights, one per line: the group in the closing table, the scenario, and the options of `skein run` (no spaces inside
# an option). A scenario is a path below scenarios/, or scene:SEED for a random scene.

strategies='congestion-aware congestion-aware-paper shortest-path'
s1=paper/s1-left.toml
s2=paper/s2-right.toml
s3b=paper/s3b-centred.toml
forest=paper/forest.toml
field=open-field.toml

flights() {
    scenario_flights
    fixed_flights
    radio_flights
    fault_flights
    ranging_flights
    swarm_flights
    scene_flights
    process_flights
}

# Every scenario file with every strategy.
scenario_flights() {
    local file strategy
    (cd "$root/scenarios" && find . -name '*.toml' -printf '%P\n') | LC_ALL=C sort | while read -r file; do
        for strategy in $strategies; do
            echo "scenarios $file --strategy $strategy"
        done
    done
}

fixed_flights() {
    echo "fixed $s1 --strategy fixed:3/2 --set formation.drones=5"
    echo "fixed $s2 --strategy fixed:4/4"
    echo "fixed $s2 --strategy fixed:8/0 --seed 5"
    echo "fixed $s3b --strategy fixed:1/4 --set formation.drones=5"
    echo "fixed $field --strategy fixed:3/5"
}

radio_flights() {
    local preset delay
    for preset in ideal wifi mesh-lossy lte jammed satellite; do
        echo "radio $s2 --set radio.preset=$preset"
        echo "radio $forest --strategy congestion-aware-paper --set radio.preset=$preset --seed 2"
    done
    for delay in 0.1 0.5 1; do
        echo "radio $s2 --set radio.delay_s=$delay --set radio.loss=0.25"
        echo "radio $forest --set radio.delay_s=$delay --set radio.loss=0.5 --seed 3"
    done
    echo "radio $s1 --set radio.delay_s=0.2 --set radio.jitter_s=0.1 --set radio.delay_model=gamma --set radio.duplicate=0.2"
    echo "radio $s1 --set radio.delay_s=0.2 --set radio.jitter_s=0.05 --set radio.delay_model=uniform --set radio.asymmetry=2"
    echo "radio $s2 --set radio.delay_s=0.1 --set radio.jitter_s=0.05 --set radio.delay_model=normal"
    echo "radio $s2 --set radio.range_m=150"
    echo "radio $s2 --set radio.range_m=200 --set radio.shadowing_db=6 --set radio.path_loss_exponent=3"
    echo "radio $s2 --set radio.rate_bps=200000"
    echo "radio $forest --set radio.burst.share=0.3 --set radio.burst.scope=\"swarm\""
    echo "radio $forest --set radio.burst.share=0.3 --set radio.burst.scope=\"link\" --set radio.burst.length_s=2"
    echo "radio $s2 --set radio.rule.0={topics=[\"plan\",\"assignment\"],loss=0.6,delay_s=0.4}"
}

fault_flights() {
    local fault
    while read -r fault; do
        echo "faults $s2 --set fault.0={$fault}"
        echo "faults $forest --strategy congestion-aware-paper --set fault.0={$fault} --set radio.delay_s=0.1"
    done <<'FAULTS'
kind="kill",on="queued",after_s=1,target="leader"
kind="freeze",for_s=3,on="queued",target="leader"
kind="restart",for_s=4,on="grouped",target="group-leader:N1"
kind="slow",reaction_time_s=0.3,at_s=2,target="all"
kind="deaf",on="detected",target="member"
kind="mute",on="detected",for_s=5,target="leader"
kind="partition",at_s=8,for_s=10,sides="halves"
kind="blind",at_s=3,target="leader"
kind="blind",sensor="ranging",on="grouped",drones=[1,3]
kind="noise",position_bias_m=[0.3,-0.2],position_std_m=0.1,velocity_std_mps=0.05,at_s=1,target="random"
kind="ranging",ranging_dropout_share=0.5,ranging_std_m=2,on="detected",target="leader"
kind="ranging",ranging_latency_s=0.5,ranging_field_rad=3,ranging_occlusion=true,on="queued",target="all"
kind="gnss",position_bias_m=[0,1],position_drift_mps=[0.1,0],position_error_max_m=2,at_s=5,target="member"
kind="clock",clock_offset_s=-0.5,clock_drift_ppm=100,on="queued",target="leader"
kind="wind",at_s=0,wind_mps2=[0,0.3],gust_mps2=0.5
FAULTS
    echo "faults $s2 --set fault.0={kind=\"kill\",at_s=6,target=\"leader\"} --set faults.failsafe=land"
    echo "faults $s2 --set fault.0={kind=\"partition\",at_s=5,for_s=12,sides=[[0,1,2],[3,4]]} --set fault.1={kind=\"kill\",on=\"gate\",target=\"first-in-queue\"}"
    echo "faults $s2 --set fault.0={kind=\"freeze\",for_s=2,on=\"reforming\",target=\"last-in-queue\"} --seed 9"
}

# Without ranging, drones know of each other by beacon alone.
ranging_flights() {
    echo "no-ranging $s1 --set sensors.ranging=false"
    echo "no-ranging $s2 --set sensors.ranging=false --set radio.delay_s=0.5"
    echo "no-ranging $forest --set sensors.ranging=false"
    echo "no-ranging $forest --set sensors.ranging=false --strategy congestion-aware-paper --set radio.preset=mesh-lossy"
    echo "no-ranging $s2 --set sensors.ranging=false --strategy shortest-path --set radio.loss=0.5"
    echo "no-ranging $s2 --set sensors.ranging=false --set fault.0={kind=\"kill\",at_s=9,target=\"leader\"}"
}

swarm_flights() {
    local drones
    for drones in 1 2 3 16 33; do
        echo "swarms $field --set formation.drones=$drones"
    done
    echo "swarms $field --set formation.drones=64 --set formation.shape=grid --strategy congestion-aware-paper"
    echo "swarms $field --set formation.drones=12 --set formation.shape=line --set mission.reformation=greedy"
    echo "swarms $field --set formation.drones=12 --set formation.shape=wedge --set mission.reformation=tps"
    echo "swarms $field --set formation.drones=10 --set formation.shape=circle --set mission.reformation=identity"
    echo "swarms $s2 --set formation.start_jitter_m=5 --seed 4"
    echo "swarms $s2 --set objective.time_per_s=2 --set objective.energy_per_kj=0"
    echo "swarms $forest --set drone.reaction_time_s=0.3"
    echo "swarms $forest --set guidance.queue=false --set time.dt_s=0.05"
}

scene_flights() {
    local seed
    for seed in 1 2 3 4 5 6 7 8; do
        echo "scenes scene:$seed"
        echo "scenes scene:$seed --strategy congestion-aware-paper"
    done
    echo "scenes scene:9 --set radio.preset=mesh-lossy --set sensors.ranging=false"
    echo "scenes scene:10 --strategy shortest-path --set radio.delay_s=0.3"
}

process_flights() {
    echo "processes $s2 --runtime processes"
    echo "processes $forest --runtime processes --strategy congestion-aware-paper --set radio.preset=wifi"
    echo "processes $s2 --runtime processes --set fault.0={kind=\"kill\",on=\"queued\",target=\"leader\"}"
    echo "processes $s2 --runtime processes --set fault.0={kind=\"restart\",for_s=3,at_s=8,drone=2}"
    echo "processes $field --runtime processes --set formation.drones=16 --set radio.loss=0.2"
}

# result BINARY SCENARIO OPTION...: the digest and the outcome of a flight, or the first line of what went wrong.
result() {
    local binary=$1 scenario=$2 folder summary
    shift 2
    folder=$(mktemp -d -u "$scratch/run.XXXXXXXX")
    [[ " $* " == *' --runtime '* ]] || set -- "$@" --runtime inline
    summary=$("$binary" run "$scenario" "$@" --no-record --quiet --json --out "$folder" 2>&1) || true
    rm -rf -- "$folder"
    tr -d ' \n' <<<"$summary" | grep -oE '"(outcome|digest)":"[^"]*"' | tr '\n' ' ' | grep digest ||
        echo "no digest: ${summary%%$'\n'*}"
}

# compare LINE: flies one flight with both binaries and appends `GROUP equal|differs` to the results.
compare() {
    local group scenario options before after verdict=equal
    read -r group scenario options <<<"$1"
    case $scenario in
    scene:*) scenario=$scratch/scene-${scenario#scene:}.toml ;;
    *) scenario=$root/scenarios/$scenario ;;
    esac
    read -ra options <<<"$options"
    before=$(result "$old" "$scenario" "${options[@]}")
    after=$(result "$new" "$scenario" "${options[@]}")
    if [ "$before" != "$after" ] || [[ $before == 'no digest'* ]]; then
        verdict=differs
        printf 'differs: %s\n    old: %s\n    new: %s\n' "${1#* }" "$before" "$after"
    fi
    echo "$group $verdict" >>"$scratch/results"
}

if [ -n "$list" ]; then
    flights
    exit 0
fi

scratch=$(mktemp -d)
trap 'rm -rf -- "$scratch"' EXIT
export root old new scratch
export -f compare result
for seed in 1 2 3 4 5 6 7 8 9 10; do
    "$old" scene "$seed" >"$scratch/scene-$seed.toml"
done
flights >"$scratch/flights"
tr '\n' '\0' <"$scratch/flights" | xargs -0 -P "$jobs" -I '{}' bash -c 'compare "$1"' compare '{}'

awk '
    NR == FNR { if (!($1 in planned)) order[++groups] = $1; planned[$1]++; next }
    { count[$1, $2]++ }
    END {
        printf "%-12s %8s %8s %8s\n", "flights", "flown", "equal", "differ"
        for (i = 1; i <= groups; i++) {
            group = order[i]
            equal = count[group, "equal"]; differ = planned[group] - equal
            printf "%-12s %8d %8d %8d\n", group, planned[group], equal, differ
            flown += planned[group]; all_equal += equal
        }
        printf "%-12s %8d %8d %8d\n", "all", flown, all_equal, flown - all_equal
        exit flown != all_equal
    }
' "$scratch/flights" "$scratch/results"
