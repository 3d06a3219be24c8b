#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-2-Clause
# benchmark.sh BENCHMARK BUILD WORK: tables of tiny stand-ins of each layout, and broken layouts.
set -euo pipefail
benchmark=$1 build=$2 work=$3
rm -rf "$work"
mkdir -p "$work"
cd "$work"

fail() {
  echo "benchmark.sh: $1" >&2
  exit 1
}
expect() { # TEXT PATTERN...: extended regular expressions
  local pattern
  for pattern in "${@:2}"; do grep -qE -e "$pattern" <<<"$1" || fail "expected '$pattern' in: $1"; done
}
standin() { # NAME OPTION...; of $scene
  "$build/pmsp-synth" --layout "$1" --scene "${scene:-room}" --keyframes 5 --width 256 -o "$1" "${@:2}" >/dev/null
}
run() { # NAME OPTION...: prints the table
  "$benchmark" "$1" "$1" -o "out-$1" --build "$build" "${@:2}"
}
refused() { # STATUS MESSAGE ARGUMENT...
  local said status=0
  said=$("$benchmark" --build "$build" "${@:3}" 2>&1 >/dev/null) || status=$?
  ((status == $1)) || fail "exit code $status, expected $1, of: ${*:3}: $said"
  expect "$said" "$2"
}
figure() { # FILE KEY: the first number with this key
  grep -oE -m1 "\"$2\": [0-9.e+-]+" "$1" | head -n1 | cut -d' ' -f2
}
below() { # FILE KEY LIMIT
  local value
  value=$(figure "$1" "$2")
  awk -v value="$value" -v limit="$3" 'BEGIN { exit !(value != "" && value < limit) }' ||
    fail "$1: $2 is '$value', expected less than $3"
}
small=(-- --quality online --width 128 --height 64)

standin ob3d
table=$(run ob3d "${small[@]}")
expect "$table" '^benchmark +ob3d' 'poses of the map are the truth, 5 keyframes' '^  mean ' 'AbsRel' '^  plain ' \
  '^  solid angle ' 'normals +mean \[deg\]' '^surface '
if grep -qE '^  [0-9]+ +[0-9]+\.' <<<"$table"; then fail "a line for a keyframe in: $table"; fi
below out-ob3d/depth.json abs_rel 0.05
below out-ob3d/depth.json normal_median_deg 15
below out-ob3d/cloud.json error_median_relative 0.02

scene=yard standin tartanair
expect "$(run tartanair "${small[@]}")" '^benchmark +tartanair' 'AbsRel' '^surface '
below out-tartanair/depth.json abs_rel 0.1 # depth in eighths of a metre
below out-tartanair/depth.json rmse 5      # the sky, saturated, is no surface at 8192 m

standin fiord
expect "$(run fiord "${small[@]}")" '^benchmark +fiord' '^surface ' ' - ' 'correctness is unknown'
below out-fiord/cloud.json error_median_relative 0.02

standin hilti-trimble --map-scale 0.6
expect "$(run hilti-trimble)" 'alignment +by positions' '5 of 5 keyframes matched'
below out-hilti-trimble/poses.json position_rmse_m 0.001

# What is missing or broken.
refused 2 'usage' ob3d
refused 2 'is no benchmark' pano3d ob3d -o new
refused 2 'is no option' ob3d ob3d --quality high
refused 6 'exists' ob3d ob3d -o out-ob3d
refused 3 'has no cameras' ob3d tartanair -o new
refused 3 'has no sparse' fiord tartanair -o new
mv fiord/lidar.ply scan.ply
refused 3 'has none of lidar.ply lidar.las' fiord fiord -o new
sed -i 's/"depth_scale": 8.0/"depth_scale": 1000.0/' tartanair/scene.json
refused 3 'expected depth in eighths' tartanair tartanair -o new
[[ ! -e new ]] || fail "a refused layout left results"
rm ob3d/depths/00003_depth.exr
echo broken >ob3d/depths/00002_depth.exr
refused 3 '00002_depth.exr' ob3d ob3d -o broken "${small[@]}"
