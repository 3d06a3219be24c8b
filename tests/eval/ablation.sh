#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-2-Clause
# ablation.sh ABLATION BUILD WORK: the report of a tiny synthetic mission, some rows of it again, and invalid arguments.
set -euo pipefail
ablation=$1 build=$2 work=$3
rm -rf "$work"

fail() {
  echo "ablation.sh: $1" >&2
  exit 1
}
report() { # ROWS: runs them on the mission named by the other arguments
  "$ablation" --build "$build" -o "$work" --only "$1" "${@:2}"
}
refused() { # MESSAGE ARGUMENTS...
  local said
  if said=$("$ablation" --build "$build" -o "$work" "${@:2}" 2>&1 >/dev/null); then fail "not refused: ${*:2}"; fi
  grep -qe "$1" <<<"$said" || fail "expected '$1' in: $said"
}
rows() { grep -cE '^\| .*[0-9.]+ \|$' "$work/ablation.md"; }

mission=(--synth "--scene room --keyframes 4 --width 256")
small=(-- --width 64 --height 32)
report "paper,fine patches" "${mission[@]}" "${small[@]}" >"$work.md"
[[ $(rows) == 2 ]] || fail "expected two rows: $(cat "$work/ablation.md")"
grep -q '^| paper ' "$work/ablation.md" || fail "no row 'paper'"
if grep -q ' - ' "$work/ablation.md"; then fail "a figure is missing: $(cat "$work/ablation.md")"; fi
diff -B "$work.md" "$work/ablation.md" || fail "what is printed is not what is written"

report online "${mission[@]}" "${small[@]}" >/dev/null
[[ $(rows) == 3 ]] || fail "earlier rows are lost: $(cat "$work/ablation.md")"
[[ $(grep -oE '^\| (paper|online|without fine patches) ' "$work/ablation.md" | tr -d '\n') == \
  "| paper | online | without fine patches " ]] || fail "rows are out of order"
[[ $(find "$work" -mindepth 1 | wc -l) == 2 ]] || fail "something is left over in $work"

refused "another mission" --only paper --synth "--scene sphere --keyframes 4 --width 256"
refused "another options" --only paper "${mission[@]}"
refused "no row 'without magic'" --only magic "${mission[@]}"
refused "belong together" --map map.msg
refused "exit code 3 of: .*pmsp-densify" --map nothing.msg --images "$work" --gt "$work"
