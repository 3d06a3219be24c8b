#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-2-Clause
# Submits one large mission to Slurm: an array of shards makes planes, then one makes points, then a job merges them.
#
#   mission.sh [--shards N] [--gres GRES] [--sbatch WORDS] [--print] \
#     MAP --images DIR --workspace WORK -o CLOUD [OPTION OF pmsp-densify run...]
#
#   --shards N       tasks in each array [7]
#   --gres GRES      what a shard's task needs, such as gpu:1; without it shards are made on CPUs
#   --sbatch WORDS   more options for sbatch, such as "--partition=long --cpus-per-task=8"
#   --print          print the commands, submit nothing
#
# The same command, given again when its jobs have ended, makes what is missing.
set -euo pipefail

shards=7 gres="" print="" workspace="" cloud=cloud.ply
more=() run=()
while (($# > 0)); do
  case $1 in
    --shards) shards=${2:?} && shift 2 ;;
    --gres) gres=${2:?} && shift 2 ;;
    --sbatch) read -r -a more <<<"${2?}" && shift 2 ;;
    --print) print=yes && shift ;;
    --workspace) workspace=${2:?} && shift 2 ;;
    -o | --output) cloud=${2:?} && shift 2 ;;
    -h | --help) sed -n '3,/^set/{/^#/p}' "$0" && exit ;;
    *) run+=("$1") && shift ;;
  esac
done
if [[ -z $workspace || ! $shards =~ ^[1-9][0-9]*$ ]]; then
  echo "mission.sh: --workspace DIR is needed, and a number of --shards; see mission.sh --help" >&2
  exit 2
fi

program=${PMSP_DENSIFY:-pmsp-densify}
backend=cpu
array=(--array="0-$((shards - 1))")
if [[ -n $gres ]]; then
  backend=cuda
  array+=(--gres="$gres")
fi
words() { printf '%q ' exec "$program" "$@"; }
shard=$(words run --backend "$backend" "${run[@]}" --workspace "$workspace" --shard auto --wave)
merge=$(words merge "$workspace" -o "$cloud")

if [[ -n $print ]]; then
  sbatch() {
    echo "sbatch ${*@Q}" >&2
    echo ID
  }
fi
submit() { # NAME OPTIONS...
  sbatch --parsable --requeue --open-mode=append --job-name="pmsp-$1" --kill-on-invalid-dep=yes "${more[@]}" "${@:2}"
}

planes=$(submit planes "${array[@]}" --wrap "$shard planes")
points=$(submit points "${array[@]}" --dependency="afterok:${planes%%;*}" --wrap "$shard points")
cloud_job=$(submit merge --dependency="afterok:${points%%;*}" --wrap "$merge")
if [[ -z $print ]]; then
  echo "jobs ${planes%%;*} (planes), ${points%%;*} (points), ${cloud_job%%;*} (merge) make $cloud"
fi
