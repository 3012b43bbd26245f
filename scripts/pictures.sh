#!/usr/bin/env bash
# Makes the pictures of the README and of docs/watching.md from a flight of the forest: docs/images/forest-flight.svg
# (animated), report-light.png, report-dark.png and report-phone.png. Needs Chromium (Debian package `chromium`).
#
# Usage: scripts/pictures.sh
#
# The variable SKEIN may name a skein binary. Otherwise the script builds one.
set -euo pipefail
cd "$(dirname "$0")/.."
chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome) || {
    echo "pictures: expected Chromium (Debian package chromium)" >&2
    exit 3
}
scratch=$(mktemp -d)
trap 'rm -rf -- "$scratch"' EXIT
skein=${SKEIN:-}
if [ -z "$skein" ]; then
    cargo build --release --quiet
    skein=target/release/skein
fi
"$skein" run scenarios/paper/forest.toml --strategy congestion-aware-paper --runtime inline --quiet --out "$scratch/forest"
cp "$scratch/forest/plots/flight.svg" docs/images/forest-flight.svg

# shot NAME WIDTH HEIGHT COLOURS: a picture of the report, 55 s into the flight. COLOURS is 1 for light, 0 for dark.
shot() {
    "$chromium" --headless=new --no-sandbox --disable-gpu --hide-scrollbars --virtual-time-budget=4000 \
        --blink-settings="preferredColorScheme=$4" --window-size="$2,$3" --user-data-dir="$scratch/profile-$1" \
        --screenshot="docs/images/$1.png" "file://$scratch/forest/report.html#t=55&drone=3" 2>"$scratch/log" || {
        cat "$scratch/log" >&2
        exit 1
    }
}
shot report-light 1280 800 1
shot report-dark 1280 800 0
shot report-phone 390 844 1
