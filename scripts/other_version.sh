#!/usr/bin/env bash
# Builds the example boids as it is, and once more with another version of Skein. Then it flies a swarm in which one
# program starts pilots of the other. A program whose first two version numbers differ must be refused before the first tick, in
# words that name both versions; a program of another patch release must fly, with the digest of a single program.
#
#     scripts/other_version.sh            the next minor version
#     scripts/other_version.sh 0.1.9      this one
#
# It takes some minutes: all crates of Skein are built twice. So it is no part of the tests, which only imitate the other version.
set -euo pipefail
cd "$(dirname "$0")/.."

own=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)
IFS=. read -r major minor _ <<<"$own"
other=${1:-$major.$((minor + 1)).0}
export CARGO_TARGET_DIR=${CARGO_TARGET_DIR:-$PWD/target}
scratch=$(mktemp -d)
trap 'rm -rf -- "$scratch"' EXIT

# build FOLDER FILE: builds the program in a clone, and keeps it as this file.
build() {
    (cd "$1" && cargo build --quiet -p skein-example-boids)
    cp "$CARGO_TARGET_DIR/debug/boids" "$2"
}

mkdir "$scratch/clone"
git ls-files -z | tar --create --null --files-from=- | tar --extract --directory="$scratch/clone"
sed -i "s/\"${own//./\\.}\"/\"$other\"/" "$scratch/clone/Cargo.toml"
echo "building $own" >&2
build . "$scratch/own"
echo "building $other" >&2
build "$scratch/clone" "$scratch/other"

# fly LAUNCHER PILOT: flies with one program, which starts the pilots of two drones from the other. Sets `code`.
fly() {
    sed "/^\[\[pilot\]\]/,/^\$/d" examples/boids/field.toml >"$scratch/mixed.toml"
    cat >>"$scratch/mixed.toml" <<TOML

[[pilot]]
name = "boids"
command = ["$2"]
drones = [1, 2]

[[pilot]]
name = "boids"
TOML
    rm -rf -- "$scratch/run"
    code=0
    "$1" run "$scratch/mixed.toml" --json --set mission.duration_s=2 --out "$scratch/run" >"$scratch/out.json" 2>"$scratch/words" || code=$?
}
fail() { echo "other_version: $*" >&2; cat "$scratch/words" >&2; exit 1; }
digest() { tr -d ' \n' <"$scratch/out.json" | grep -oE '"digest":"[0-9a-f]{16}"'; }

fly "$scratch/own" "$scratch/own"
[ "$code" -eq 0 ] || fail "$own does not fly with itself: exit code $code"
alone=$(digest)
if [ "${own%.*}" = "${other%.*}" ]; then
    fly "$scratch/own" "$scratch/other"
    [ "$code" -eq 0 ] && [ "$(digest)" = "$alone" ] || fail "pilots of $other do not fly with $own: exit code $code"
    echo "pilots of $other fly with $own: $(digest)"
    exit
fi
for pair in "own other" "other own"; do
    read -r launcher pilot <<<"$pair"
    fly "$scratch/$launcher" "$scratch/$pilot"
    [ "$code" -eq 2 ] || fail "expected exit code 2, found $code"
    for version in "${own%.*}" "${other%.*}"; do
        grep -qF "Skein $version (" "$scratch/words" || fail "expected the version $version in words"
    done
    [ ! -s "$scratch/out.json" ] || fail 'expected no summary'
    ! grep -qs '"t_s"' "$scratch/run/events.jsonl" || fail 'expected no event'
    cat "$scratch/words"
done
