#!/usr/bin/env bash
# Sends random signals to runs, sweeps, views and reports, and checks after each round that nothing is left, lost or hangs.
# scripts/soak.sh [ROUNDS] [SEED]: the first round has this seed, the next one the next. A round that fails prints its seed.
set -euo pipefail
cd "$(dirname "$0")/.."
SKEIN_SOAK_ROUNDS=${1:-100} SKEIN_SOAK_SEED=${2:-$RANDOM} \
    cargo test --release --workspace --test soak -- --nocapture
