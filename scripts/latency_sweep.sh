#!/bin/sh
# Delay times loss times strategy on S2: the figures of docs/faults.md. Interrupted, it goes on when called again.
# Arguments are handed on to `skein sweep`, such as --jobs 2 or --out DIR.
set -eu
cd "$(dirname "$0")/.."
exec cargo run --release --quiet -- sweep experiments/delay-loss.toml "$@"
