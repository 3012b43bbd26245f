#!/bin/sh
# Compares a swarm over two hosts on this machine with the same swarm without hosts, in lockstep: ticks per second, and bytes per tick and
# drone on the network. Both share this machine's cores, so only the ratios within a run of this script mean something.
#
# Usage: scripts/hosts_cost.sh [DRONES]...
#
# PROGRAMS names the folder of skein and skein-hosts [default: target/release].
set -eu
cd "$(dirname "$0")/.."
programs=$(realpath "${PROGRAMS:-target/release}")
export PATH="$programs:$PATH"
work=$(mktemp -d)
"$programs/skein" host --name a --drones 5000 --listen tcp/127.0.0.1:17501 >"$work/a" &
a=$!
"$programs/skein" host --name b --drones 5000 --listen tcp/127.0.0.1:17502 >"$work/b" &
b=$!
trap 'kill $a $b; wait; rm -rf "$work"' EXIT
until [ -s "$work/a" ] && [ -s "$work/b" ]; do sleep 0.05; done
for drones in "${@:-8}"; do
    for _ in 1 2 3; do
        for where in here hosts; do
            if [ $where = hosts ]; then
                half=$((drones / 2))
                set -- --hosts "a=$half,b=$half" --connect tcp/127.0.0.1:17501,tcp/127.0.0.1:17502
            else
                set --
            fi
            # The mission does not end in four seconds, which is exit code 1.
            "$programs/skein" run scenarios/open-field.toml --set "formation.drones=$drones" --set time.timeout_s=4 --no-record \
                --json --out "$work/run" --force "$@" >"$work/summary" || [ $? = 1 ]
            python3 - "$where" "$work/summary" <<'PYTHON'
import json, sys
summary = json.load(open(sys.argv[2]))
ticks, hosts = summary["ticks"], summary["hosts"]
drones = sum(len(host["drones"]) for host in hosts)
net = [round(sum(host[key] for host in hosts) / ticks / drones) for key in ("bytes_down", "bytes_up")] if hosts else None
print(f"{summary['drones']} drones {sys.argv[1]}: {ticks / summary['wall_s']:.0f} ticks/s, digest {summary['digest']}"
      + (f", bytes per tick and drone {net[0]} down {net[1]} up" if net else ""))
PYTHON
        done
    done
done
