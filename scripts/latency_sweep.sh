#!/bin/sh
# Flies the delay and loss sweep of docs/faults.md: delays, losses and strategies on scenario S2.
#
# Usage: scripts/latency_sweep.sh [OPTION]...
#
# Options are passed to `skein sweep`, such as --jobs 2 or --out DIR. If the sweep is interrupted, call the script again: it
# continues.
set -eu
cd "$(dirname "$0")/.."
exec cargo run --release --quiet -- sweep experiments/delay-loss.toml "$@"
