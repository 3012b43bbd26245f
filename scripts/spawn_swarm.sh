#!/usr/bin/env bash
# Starts a swarm of a given size and formation, and flies it past one tree. See --help.
set -euo pipefail

usage() {
    cat <<'HELP'
Usage: scripts/spawn_swarm.sh [DRONES] [FORMATION] [SPACING_M] [OPTION]...

Starts one process per drone and one for the world, and flies scenarios/open-field.toml.

  DRONES      number of drones [8]
  FORMATION   nested-v, v, wedge, line, column, grid or circle [v]
  SPACING_M   metres between neighbours, at least 4 [8]
  OPTION      the first argument that begins with a dash, and all after it, are passed to
              `skein run`

Examples:
  scripts/spawn_swarm.sh 12 line
  scripts/spawn_swarm.sh 30 grid 10 --seed 7 --json
  scripts/spawn_swarm.sh 5 --clock realtime:4 --set radio.loss=0.2
HELP
}

positional=()
while [ $# -gt 0 ]; do
    case $1 in
    -h | --help)
        usage
        exit 0
        ;;
    -*) break ;;
    *) positional+=("$1") ;;
    esac
    shift
done
if [ ${#positional[@]} -gt 3 ]; then
    usage >&2
    exit 2
fi
overrides=()
for key in drones shape spacing_m; do
    if [ ${#positional[@]} -gt 0 ]; then
        overrides+=(--set "formation.$key=${positional[0]}")
        positional=("${positional[@]:1}")
    fi
done

here=$(cd "$(dirname "$0")/.." && pwd)
exec cargo run --release --quiet --manifest-path "$here/Cargo.toml" -- \
    run "$here/scenarios/open-field.toml" ${overrides[@]+"${overrides[@]}"} "$@"
