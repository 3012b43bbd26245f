#!/bin/sh
# Flies the fault matrix of docs/faults.md: every kind of fault, at three moments, on the leader and on a member.
#
# Usage: scripts/fault_matrix.sh [OPTION]...
#
# Options are passed to `skein sweep`, such as --jobs 2 or --set sensors.ranging=false. If the sweep is interrupted, call the
# script again: it continues.
set -eu
cd "$(dirname "$0")/.."
exec cargo run --release --quiet -- sweep experiments/faults.toml "$@"
