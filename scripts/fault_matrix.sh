#!/bin/sh
# Kinds of faults times moments times targets: the matrix of docs/faults.md. Interrupted, it goes on when called again.
# Arguments are handed on to `skein sweep`, such as --jobs 2 or --set sensors.ranging=false.
set -eu
cd "$(dirname "$0")/.."
exec cargo run --release --quiet -- sweep experiments/faults.toml "$@"
