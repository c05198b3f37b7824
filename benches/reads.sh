#!/usr/bin/env bash
# Reads of eight kinds at a fixed rate while two workers align: benches/reads.sh RATE SECONDS. The `viola` of the PATH
# serves, and the example `load` beside it reads. Needs curl, jq, and `cargo build --release --examples`.
set -euo pipefail
cd "$(dirname "$0")/.."
load="$(dirname "$(command -v viola)")/examples/load"
work="$(mktemp -d)"
trap 'kill $(jobs -p) 2>/dev/null || true; wait "$server" 2>/dev/null || true; rm -rf "$work"' EXIT

viola simulate --set normal --seed 5000 --clips 2 --frames 24 --out "$work/home" >/dev/null
viola serve --listen 127.0.0.1:0 --workers 2 --data "$work/data" >"$work/address" 2>"$work/log" &
server=$!
until grep -q 'listening on' "$work/address"; do sleep 0.1; done
base="$(sed -n 's/^listening on //p' "$work/address")"
send() { curl -sf -X "$1" "$base$2" "${@:3}"; }
make() {
    send PUT "/v1/homes/$1" -H 'content-type: application/json' -d '{}' >/dev/null
    send PUT "/v1/homes/$1/lidar-map" --data-binary @"$work/home/valetudo.json" >/dev/null
    send POST "/v1/homes/$1/clips" --data-binary @"$work/home/clip_$2.zip"
}
clip="$(make h1 0 | jq -r .id)"
until send GET /v1/homes/h1/map >/dev/null 2>&1; do sleep 0.2; done

# Work for the workers until the end: a new home every second.
for ((n = 2; ; n++)); do make "h$n" 1 >/dev/null || true; sleep 1; done &
sleep 1
echo -n "$1 reads a second beside two workers: "
"$load" reads "$base" "$1" "$2" /v1/homes/h1 /v1/homes/h1/clips "/v1/homes/h1/clips/$clip" '/v1/homes?limit=50' '/v1/changes?limit=50' \
    /v1/homes/h1/map /v1/homes/h2 /v1/homes/h1/lidar-map
