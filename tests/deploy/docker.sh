#!/bin/bash
# A Docker engine that listens at DIR/docker.sock, with all its files in DIR:
#
#   unshare --mount --pid --net --fork --kill-child --mount-proc tests/deploy/docker.sh DIR
#
# It says "ready", or "skipped: WHY" where a package is missing, and ends with its standard input. The namespaces keep
# its bridges, mounts and processes apart from the machine's.
#
# Packages: docker.io, docker-compose, mmdebstrap, iproute2. Needs the rights of root.
set -euo pipefail
dir=$1
for program in dockerd docker-compose mmdebstrap ip; do
    command -v $program >/dev/null || { echo "skipped: $program is not installed"; exit 0; }
done
ip link set lo up
mount -t tmpfs none /run
# Control groups that containers leave behind are empty when all processes are gone.
group=pitchline-test-$BASHPID-$RANDOM
forget() { find /sys/fs/cgroup -depth -type d -path "*/$group*" -exec rmdir {} + 2>/dev/null || true; }
# No higher limit than this process may grant.
dockerd --data-root "$dir/data" --exec-root "$dir/exec" --host "unix://$dir/docker.sock" --pidfile /run/docker.pid \
    --iptables=false --ip6tables=false --cgroup-parent="/$group" \
    --default-ulimit "nofile=$(ulimit -Hn):$(ulimit -Hn)" </dev/null >&2 &
engine=$!
for _ in $(seq 300); do
    kill -0 $engine || exit 1
    if /usr/bin/docker --host "unix://$dir/docker.sock" version >/dev/null 2>&1; then
        echo ready
        cat >/dev/null
        /usr/bin/docker --host "unix://$dir/docker.sock" ps -aq | xargs -r /usr/bin/docker --host "unix://$dir/docker.sock" rm -f >/dev/null
        kill $engine
        wait $engine || true
        forget
        exit 0
    fi
    sleep 0.1
done
exit 1
