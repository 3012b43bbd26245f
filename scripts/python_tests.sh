#!/usr/bin/env bash
# Builds the wheel of python/ in a fresh virtual environment and runs the tests in python/tests with it. Where there is no Python
# that can do this, it says so and passes. The environment is in a temporary folder; the build is in target/python, or in
# CARGO_TARGET_DIR.
set -euo pipefail
cd "$(dirname "$0")/.."

skip() { echo "python: $*: the Python tests are skipped" >&2; exit 0; }

python=${PYTHON:-python3}
command -v "$python" >/dev/null || skip "there is no $python"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || skip "$("$python" --version) is older than 3.10"
scratch=$(mktemp -d)
trap 'rm -rf -- "$scratch"' EXIT
"$python" -m venv "$scratch/venv" >/dev/null 2>&1 || skip "$python has no module venv"
pip=("$scratch/venv/bin/python" -m pip --quiet --disable-pip-version-check)
"${pip[@]}" install 'maturin>=1.8,<2' || skip 'maturin could not be installed'
# A thinner build than a release: its tests need no speed to the last tenth.
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target/python}
export CARGO_PROFILE_RELEASE_LTO=off CARGO_PROFILE_RELEASE_CODEGEN_UNITS=16 CARGO_PROFILE_RELEASE_DEBUG=0
# Lints first. In the same profile, they share what the build makes for the compiler itself.
cargo fmt --check --manifest-path python/Cargo.toml
cargo clippy --quiet --release --locked --all-targets --manifest-path python/Cargo.toml -- -D warnings
PATH="$scratch/venv/bin:$PATH" maturin build --quiet --release --locked --manifest-path python/Cargo.toml --out "$scratch" \
    --interpreter "$scratch/venv/bin/python"
"${pip[@]}" install "$(echo "$scratch"/skein-*.whl)[test]"
cd "$scratch"
"$scratch/venv/bin/python" -m pytest -q -p no:cacheprovider "$OLDPWD/python/tests" "$@"
