#!/bin/bash
# A Slurm cluster of three simulated nodes, n1 to n3, of four processors each, with all its files in DIR:
#
#   unshare --mount --pid --net --fork --kill-child --mount-proc tests/deploy/slurm.sh DIR
#
# It says "ready" when all nodes are idle, or "skipped: WHY" where a package is missing, and ends with its standard
# input. The namespaces give it a loopback of its own, and end whatever it started. To run commands in it:
#
#   nsenter -t PID -m -p -n env SLURM_CONF=DIR/slurm.conf sbatch ...    (PID: the child of unshare)
#
# Packages: slurmctld, slurmd, slurm-client, munge, iproute2. Needs the rights of root.
set -euo pipefail
dir=$1
for program in munged slurmctld slurmd ip; do
    command -v $program >/dev/null || { echo "skipped: $program is not installed"; exit 0; }
done
host=$(hostname -s)
ip link set lo up
# The resolver assumes that a machine whose only address is loopback has no network.
ip addr add 10.77.2.1/32 dev lo
# munged refuses a socket in a folder that others cannot enter.
mount -t tmpfs none /run
mkdir -p "$dir/state" "$dir/log"
head -c 128 /dev/urandom >"$dir/munge.key"
chmod 600 "$dir/munge.key"
# slurmd asks for control groups from 23.02 on, even where nothing here uses them.
case $(slurmctld -V) in *" 22."* | *" 21."*) ;; *) echo CgroupPlugin=disabled >"$dir/cgroup.conf" ;; esac
# cred_expire is the time for which a requeued job is held: 120 s by default, and at least 5 s. KillWait is shorter than
# on most sites.
cat >"$dir/slurm.conf" <<CONF
ClusterName=simulated
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket=/run/munge.socket,cred_expire=5
CredType=cred/munge
StateSaveLocation=$dir/state
SlurmctldPidFile=/run/slurmctld.pid
SlurmctldLogFile=$dir/log/slurmctld
SlurmdSpoolDir=$dir/spool.%n
SlurmdPidFile=/run/slurmd.%n.pid
SlurmdLogFile=$dir/log/slurmd.%n
SlurmdParameters=config_overrides
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=bf_interval=1,sched_interval=2,sched_min_interval=0
ReturnToService=2
KillWait=10
PreemptType=preempt/partition_prio
PreemptMode=REQUEUE
NodeName=n[1-3] NodeHostname=$host NodeAddr=127.0.0.1 Port=[6821-6823] CPUs=4 RealMemory=4000 State=UNKNOWN
PartitionName=main Nodes=ALL Default=YES MaxTime=INFINITE PriorityTier=1
PartitionName=urgent Nodes=ALL MaxTime=INFINITE PriorityTier=9 PreemptMode=OFF
CONF
export SLURM_CONF=$dir/slurm.conf

munged --foreground --force --key-file="$dir/munge.key" --socket=/run/munge.socket --pid-file=/run/munged.pid \
    --log-file="$dir/log/munged" --seed-file=/run/munge.seed </dev/null >&2 &
slurmctld -D </dev/null >/dev/null 2>&1 &
for node in n1 n2 n3; do
    mkdir -p "$dir/spool.$node"
    slurmd -D -N $node </dev/null >/dev/null 2>&1 &
done
for _ in $(seq 300); do
    if [ "$(sinfo -h -N -p main -o %T 2>/dev/null | grep -c idle)" = 3 ]; then
        echo ready
        cat >/dev/null
        exit 0
    fi
    sleep 0.1
done
tail -n 5 "$dir"/log/* >&2
exit 1
