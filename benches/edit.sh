#!/usr/bin/env bash
# Prints the seconds from an edit of a source file to a running development binary, then takes the edit back:
#
#   benches/edit.sh NAME FILE TEXT OTHER_TEXT
#
# TEXT must be in one line of FILE. NAME is only printed. Settings of cargo in the environment do not count.
set -euo pipefail
cd "$(dirname "$0")/.."
name="$1" file="$2" text="$3" other="$4"
[ "$(grep -cF -- "$text" "$file")" = 1 ] || { echo "\"$text\" is not in one line of $file" >&2; exit 1; }
unset CARGO_INCREMENTAL CARGO_PROFILE_DEV_DEBUG CARGO_TARGET_DIR
cargo build --quiet
before="$(mktemp)"
cp "$file" "$before"
trap 'cp "$before" "$file"; rm "$before"' EXIT
begun="$(date +%s.%N)"
TEXT="$text" OTHER="$other" perl -pi -e 's/\Q$ENV{TEXT}\E/$ENV{OTHER}/' "$file"
cargo build --quiet
target/debug/viola --version >/dev/null
printf '| edit of | time |\n|---|---|\n'
awk -v name="$name" -v begun="$begun" -v ended="$(date +%s.%N)" 'BEGIN { printf "| %s | %.1f |\n", name, ended - begun }'
