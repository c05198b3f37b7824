#!/usr/bin/env bash
# Frames a second of video at 1920x1440, by the pure-Rust decoders and by ffmpeg, both with two threads and both only
# decoding: clips of three seconds are made here, of pictures in a folder or of a generated pattern with noise.
#   benches/video.sh [FOLDER_OF_JPEGS]
set -euo pipefail
cd "$(dirname "$0")/.."
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

source=(-f lavfi -i "testsrc2=s=1920x1440:r=30:d=3,noise=alls=10:allf=t")
if [ $# -gt 0 ]; then
    source=(-framerate 30 -start_number 0 -i "$1/%d.jpg" -frames:v 90 -vf scale=1920:1440)
fi
make() {
    ffmpeg -v error "${source[@]}" -pix_fmt yuv420p "${@:2}" "$work/$1.mp4"
}
make "H.264, B-frames" -c:v libx264 -profile:v high -b:v 20M -g 30
make "H.264" -c:v libx264 -profile:v high -b:v 20M -g 30 -bf 0
make "HEVC, B-frames" -c:v libx265 -preset fast -b:v 12M -tag:v hvc1 -x265-params log-level=error:keyint=30:open-gop=0
make "HEVC" -c:v libx265 -preset fast -b:v 12M -tag:v hvc1 -x265-params log-level=error:keyint=30:bframes=0

cargo build --release --quiet --example decode_video
TIMEFORMAT="%R %U %S"
row() { # CLIP, DECODER, and the command
    local wall user system
    read -r wall user system < <({ time "${@:3}" >/dev/null; } 2>&1)
    awk -v clip="$1" -v name="$2" -v wall="$wall" -v cpu="$(echo "$user $system" | awk '{print $1 + $2}')" \
        'BEGIN { printf "| %s | %s | %.1f | %.1f |\n", clip, name, 90 / wall, 90 / cpu }'
}
echo "| clip | decoder | frames/s | frames for a second of one core |"
echo "|---|---|---|---|"
for clip in "$work"/*.mp4; do
    name="$(basename "$clip" .mp4)"
    row "$name" viola target/release/examples/decode_video "$clip"
    row "$name" ffmpeg ffmpeg -v error -threads 2 -i "$clip" -f null -
done
