#!/usr/bin/env bash
# How fast a home's map takes in a clip and is read: a simulated home of CLIPS clips (20 when not given), three more one by
# one, then its map under load. Needs curl, jq and wrk, and `cargo build --release`.
set -euo pipefail
cd "$(dirname "$0")/.."
viola=target/release/viola
clips=${1:-20}
work=$(mktemp -d)
trap 'kill "$server" 2>/dev/null || true; rm -rf "$work"' EXIT

"$viola" simulate --set normal --seed 5 --clips $((clips + 3)) --out "$work/home" >/dev/null
"$viola" serve --listen 127.0.0.1:8097 --data "$work/data" >"$work/log" 2>&1 &
server=$!
at=http://127.0.0.1:8097
home=$at/v1/homes/h
until curl -sf $at/readyz >/dev/null; do sleep 0.1; done
curl -sf -X PUT "$home" -H 'content-type: application/json' -d '{}' >/dev/null
curl -sf -X PUT "$home/lidar-map" --data-binary @"$work/home/valetudo.json" >/dev/null

add() { curl -sf -X POST "$home/clips" --data-binary @"$work/home/clip_$1.zip" >/dev/null; }
# Until every clip has settled and the map was looked at again.
settled() {
    until curl -sf "$home/map" 2>/dev/null | jq -e --argjson n "$1" \
        '(.clips | length) + (.left_out | length) >= $n and all(.left_out[]; .state != "queued" and .state != "aligning" and .state != "aligned")' >/dev/null; do
        sleep 0.05
    done
}

for ((i = 0; i < clips; i++)); do add $i; done
settled "$clips"
for ((i = clips; i < clips + 3; i++)); do
    add $i
    settled $((i + 1))
done
echo "the last merges:"
grep -E '"message":"map merged"' "$work/log" | tail -3 | jq -r '"  \(.clips) clips, \(.tiles) tiles made anew, \(.seconds) s"'

echo "GET .../map:"
wrk -t1 -c16 -d8s --latency "$home/map" | grep -E '99%|Requests/sec'
memory() { awk '/VmRSS/ {print $2 / 1024 " MiB"}' /proc/$server/status; }
echo "points, $(memory) before:"
for query in '' 'format=glb' 'classes=wall' 'voxel=0.06'; do
    for _ in $(seq 20); do curl -s -o /dev/null "$home/map/points?$query"; done
    curl -s -o /dev/null -w "  %{size_download} bytes at %{speed_download} bytes/s  $query\n" "$home/map/points?$query"
done
echo "  $(memory) after 84 downloads"
