#!/usr/bin/env bash
# Makes the small videos of tests/video.rs from generated patterns, and the sums of their frames' planes as ffmpeg
# decodes them. Made with ffmpeg 5.1.9, x264 164 and x265 3.5; the sums hold for the files, not for other versions.
set -euo pipefail
cd "$(dirname "$0")"

pattern="testsrc2=s=160x120:r=30:d=1"
noise="testsrc2=s=160x120:r=30:d=1,noise=alls=12:allf=t:all_seed=7"
make() { # NAME, and then what ffmpeg is to do
    ffmpeg -v error -y -f lavfi -i "$2" -pix_fmt yuv420p -threads 1 "${@:3}" -map_metadata -1 -fflags +bitexact "$1"
}
x265="log-level=error:keyint=12:pools=none:frame-threads=1:info=0"

make h264_b.mp4 "$noise" -c:v libx264 -profile:v high -g 12 -crf 28 -x264-params "bframes=3:ref=4:weightp=2:b-pyramid=normal"
make h264_no_b.mp4 "$pattern" -c:v libx264 -profile:v baseline -g 10 -bf 0 -crf 26
make h264_open.mp4 "$pattern" -c:v libx264 -crf 28 -x264-params "open-gop=1:keyint=8:bframes=3:scenecut=0"
make hevc_b.mp4 "$noise" -c:v libx265 -tag:v hvc1 -crf 30 -x265-params "$x265:open-gop=0:bframes=4"
make hevc_no_b.mp4 "$pattern" -c:v libx265 -tag:v hvc1 -crf 28 -x265-params "$x265:open-gop=0:bframes=0"
make hevc_open.mp4 "$pattern" -c:v libx265 -tag:v hvc1 -crf 28 -x265-params "$x265:open-gop=1:bframes=4:scenecut=0"
make hevc_10.mp4 "$pattern" -pix_fmt yuv420p10le -c:v libx265 -tag:v hvc1 -crf 30 -x265-params "$x265:bframes=3"
# Every picture a group of its own.
make intra.mp4 "testsrc2=s=96x64:r=30:d=1" -c:v libx264 -g 1 -crf 35
# BT.709 in full range, as phones say it, and a size that is no multiple of a block's.
make bt709.mov "testsrc2=s=154x118:r=30:d=0.5" -vf scale=out_color_matrix=bt709:out_range=full -c:v libx264 -crf 28 \
    -colorspace bt709 -color_primaries bt709 -color_trc bt709 -color_range pc

# The same pictures, said to be turned clockwise by a quarter, which ffmpeg counts the other way round.
for file in h264_no_b hevc_no_b; do
    ffmpeg -v error -y -i $file.mp4 -c copy -metadata:s:v rotate=270 -fflags +bitexact rotated_$file.mp4
done
mv rotated_h264_no_b.mp4 rotated.mp4
mv rotated_hevc_no_b.mp4 hevc_rotated.mp4
# Coded anew, with the turn applied to the pictures: upright, and without a turn in the header.
ffmpeg -v error -y -i hevc_rotated.mp4 -c:v libx265 -tag:v hvc1 -crf 18 -threads 1 -x265-params "$x265:open-gop=0:bframes=0" \
    -map_metadata -1 -fflags +bitexact hevc_upright.mp4
# Cut without coding anew: the edit list leaves out what lies between the key frame and the cut.
ffmpeg -v error -y -ss 0.55 -i h264_b.mp4 -t 0.3 -c copy -fflags +bitexact edited.mp4
ffmpeg -v error -y -i hevc_b.mp4 -c copy -fflags +bitexact hevc_b.mov
# Refused: fragments, fields, other chroma.
ffmpeg -v error -y -i h264_no_b.mp4 -c copy -movflags frag_keyframe+empty_moov -fflags +bitexact fragmented.mp4
make interlaced.mp4 "testsrc2=s=160x128:r=30:d=0.2" -c:v libx264 -flags +ildct+ilme -x264-params tff=1
make chroma_422.mp4 "testsrc2=s=160x120:r=30:d=0.2" -pix_fmt yuv422p -c:v libx264
make mpeg4.mp4 "testsrc2=s=160x120:r=30:d=0.2" -c:v mpeg4

# File, number of the frame, when it is shown in seconds after the first, SHA-256 of its planes.
for file in *.mp4 *.mov; do
    case $file in fragmented.mp4 | interlaced.mp4 | chroma_422.mp4 | mpeg4.mp4) continue ;; esac
    base=$(ffprobe -v error -select_streams v -show_entries stream=time_base -of csv=p=0 "$file")
    ffmpeg -v error -noautorotate -i "$file" -fps_mode passthrough -enc_time_base -1 -copyts -f framehash -hash sha256 - |
        grep -v '^#' | tr -d ' ' | awk -F, -v file="$file" -v base="$base" '
            BEGIN { split(base, part, "/") }
            NR == 1 { first = $3 }
            { printf "%s %d %.6f %s\n", file, NR - 1, ($3 - first) * part[1] / part[2], $6 }'
done >frames.txt
