#!/usr/bin/env bash
# SPDX-License-Identifier: BSD-2-Clause
# slurm.sh PMSP-DENSIFY MAP IMAGES MISSION.SH WORK: two nodes of a real Slurm on this host make 12 small missions and one mission
# in 7 shards. A node is killed in the middle of each. Every cloud must have the bytes of a local run. Exit code 77: no Slurm.
set -euo pipefail
program=$1 map=$2 images=$3 mission_sh=$4 work=$5

for tool in munged mungekey slurmctld slurmd sbatch squeue scontrol; do
  if ! command -v "$tool" >/dev/null; then
    echo "slurm.sh: skipped, there is no $tool"
    exit 77
  fi
done
if ((EUID != 0)); then
  echo "slurm.sh: skipped, only root may start the daemons"
  exit 77
fi

if [[ -z ${PMSP_SLURM_HAS_LIMIT-} ]]; then # limit for hanging commands
  PMSP_SLURM_HAS_LIMIT=yes exec timeout --kill-after=30 900 "$0" "$@"
fi

# Slurm's sockets have long names, and munged wants folders that only root may write to.
dir=$(mktemp -d /tmp/pmsp-slurm-XXXXXX)
chmod 755 "$dir"
rm -rf "$work"
mkdir -p "$work"

# Jobs leave all process groups. So daemons are known by the log that they have open, jobs by their environment.
processes() { # FILE VARIABLE...: that have a file of this name open, or each of these variables
  local environment pid variable
  if [[ -n $1 ]]; then { find /proc/[0-9]*/fd -lname "$1" 2>/dev/null || true; } | cut -d / -f 3 | sort -u; fi
  for environment in /proc/[0-9]*/environ; do
    pid=${environment//[!0-9]/}
    if [[ $pid == "$$" || $pid == "$BASHPID" ]]; then continue; fi
    for variable in "${@:2}"; do
      if ! grep -qszxF "$variable" "$environment"; then continue 2; fi
    done
    echo "$pid"
  done
}
kill_all() { # as processes(); daemons are killed before they can report ended jobs
  local -a pids
  local round
  for ((round = 0; round < 50; ++round)); do
    mapfile -t pids < <(processes "$@")
    if ((${#pids[@]} == 0)); then return 0; fi # in a trap a bare return has the previous status
    kill -KILL "${pids[@]}" 2>/dev/null || true
    sleep 0.05
  done
}
clean_up() {
  local status=$?
  trap '' EXIT INT TERM
  if ((status != 0)); then
    echo "slurm.sh: exit code $status after $SECONDS s, last waited for: $awaited" >&2
    squeue -a 2>/dev/null || true
    tail -n 30 "$dir"/*.log "$work"/*.out 2>/dev/null || true
  fi
  kill_all "$dir/*" "SLURM_CONF=$SLURM_CONF"
  rm -rf "$dir"
  exit "$status"
}
awaited=nothing
export SLURM_CONF=$dir/slurm.conf
trap clean_up EXIT
trap 'exit 143' INT TERM

fail() {
  echo "slurm.sh: $1" >&2
  exit 1
}
say() { printf '%3d s  %s\n' "$SECONDS" "$1"; }
wait_for() { # WHAT COMMAND...
  awaited=$1
  shift
  until "$@"; do sleep 0.1; done
}

free_port() { # FROM
  local port
  for ((port = $1; ; ++port)); do
    if ! (: <"/dev/tcp/127.0.0.1/$port") 2>/dev/null; then
      echo "$port"
      return
    fi
  done
}

# --- munge, slurmctld, two nodes ---
host=$(hostname -s)
port=$(free_port $((20000 + RANDOM % 10000)))
port1=$(free_port $((port + 1)))
port2=$(free_port $((port1 + 1)))
mkdir "$dir/munge" "$dir/state"
mungekey --create --keyfile="$dir/munge/key"
cat >"$SLURM_CONF" <<END
ClusterName=test
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=$port
SlurmUser=root
AuthType=auth/munge
CredType=cred/munge
AuthInfo=socket=$dir/munge/socket
StateSaveLocation=$dir/state
SlurmdSpoolDir=$dir/spool-%n
SlurmctldPidFile=$dir/slurmctld.pid
SlurmdPidFile=$dir/slurmd-%n.pid
SlurmctldLogFile=$dir/slurmctld.log
SlurmdLogFile=$dir/slurmd-%n.log
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU
SchedulerParameters=sched_interval=1,sched_min_interval=0,batch_sched_delay=0
SlurmdParameters=config_overrides
ReturnToService=2
MpiDefault=none
SlurmdTimeout=300
MessageTimeout=5
BatchStartTimeout=1
NodeName=n1 NodeHostname=$host NodeAddr=127.0.0.1 Port=$port1 CPUs=1
NodeName=n2 NodeHostname=$host NodeAddr=127.0.0.1 Port=$port2 CPUs=1
PartitionName=all Nodes=n1,n2 Default=YES MaxTime=10
END

start_node() { slurmd -N "$1"; }
kill_node() { kill_all "$dir/slurmd-$1.log" "SLURM_CONF=$SLURM_CONF" "SLURMD_NODENAME=$1"; }
nodes_are_idle() { [[ $(sinfo -h -t idle -o %D 2>/dev/null) == 2 ]]; }

munged --force --key-file="$dir/munge/key" --socket="$dir/munge/socket" --pid-file="$dir/munge/pid" \
  --log-file="$dir/munge.log" --seed-file="$dir/munge/seed" 2>/dev/null
slurmctld -i
start_node n1
start_node n2
wait_for "the nodes" nodes_are_idle
say "two nodes are up"

# --- expected results ---
cd "$work"
small=(--width 128 --height 64 --backend cpu)
for number in {1..12}; do # each different
  printf '{"name": "m%s", "map": "%s", "images": "%s", "options": {"seed": %s}}\n' "$number" "$map" "$images" "$number"
done >missions.jsonl
"$program" batch missions.jsonl -o local --jobs 2 --quiet "${small[@]}"
"$program" run "$map" --images "$images" -o local.ply --quiet --quality normal "${small[@]}"
say "local runs are done"

# --- a job array over missions, and one mission in shards; node n2 is killed in the middle of each ---
run_on() { # NODE FOLDER: waits for a run there whose workspace in this directory has planes
  local pid workspace
  for pid in $(processes "" "SLURM_CONF=$SLURM_CONF" "SLURMD_NODENAME=$1"); do
    workspace=$(tr '\0' '\n' 2>/dev/null <"/proc/$pid/cmdline" | sed -n 's/^--workspace=//p; /^--workspace$/{n;p}') || true
    if [[ -z $workspace || $(realpath -m "$workspace") != "$PWD/$2"* ]]; then continue; fi
    if compgen -G "$workspace/planes/*" >/dev/null && kill -STOP "$pid" 2>/dev/null; then
      return
    fi
  done
  return 1
}
is_requeued() { scontrol -o show job "$1" | grep -q ' Restarts=1 '; }
kill_in_the_middle() { # FOLDER
  local job
  wait_for "a run on n2" run_on n2 "$1"
  job=$(squeue -h -w n2 -t running -o %A)
  kill_node n2
  sleep 8 # a job that has just begun (MessageTimeout + BatchStartTimeout) is not missed when its node comes back
  start_node n2
  wait_for "the requeue of job $job" is_requeued "$job"
  sleep 2 # a node refuses what it ended within the same second ("Job credential revoked")
  say "node n2 was killed with a job of $1, and is back; the job is requeued"
}

"$program" batch missions.jsonl -o array "${small[@]}" --slurm=submit
kill_in_the_middle array
export PMSP_DENSIFY=$program
"$mission_sh" "$map" --images "$images" --workspace shards -o shards.ply --quality normal "${small[@]}"
kill_in_the_middle shards

nothing_waits() {
  local job
  for job in $(squeue -h -o '%A %r' | sed -n 's/ BeginTime$//p'); do
    scontrol update JobId="$job" StartTime=now # Slurm delays a requeued job by two minutes
  done
  [[ -z $(squeue -h) ]]
}
wait_for "the end of all jobs" nothing_waits
say "all jobs have ended"

# --- bytes ---
for number in {1..12}; do
  cmp "array/m$number/cloud.ply" "local/m$number/cloud.ply"
done
cmp shards.ply local.ply
[[ $(grep -c ,done, array/missions.csv) == 12 ]] || fail "the table: $(cat array/missions.csv)"
say "13 clouds have the bytes of local runs"
