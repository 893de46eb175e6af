#!/bin/bash
# A user's service manager (systemd --user) where systemd is not the init, with the user's home in DIR/home:
#
#   unshare --mount --pid --net --fork --kill-child --mount-proc tests/deploy/systemd.sh DIR
#
# It says "ready", or "skipped: WHY" where a package is missing, and ends with its standard input. To command it:
#
#   nsenter -t PID -m -p -n setpriv --reuid 1000 --regid 1000 --clear-groups \
#       env HOME=DIR/home XDG_RUNTIME_DIR=/run/user/1000 systemctl --user ...
#
# Package: systemd. Needs the rights of root.
set -euo pipefail
dir=$1
[ -x /lib/systemd/systemd ] || { echo "skipped: systemd is not installed"; exit 0; }
ip link set lo up
# The manager needs a machine that systemd has booted, with the files that its init would have created.
mount -t tmpfs none /run
mkdir -p /run/systemd/system /run/systemd/inaccessible/dir /run/user/1000
(
    cd /run/systemd/inaccessible
    touch reg
    mkfifo fifo
    chmod 0 dir reg fifo
)
mkdir -p "$dir/home"
chown 1000:1000 "$dir/home" /run/user/1000
chmod 700 /run/user/1000
# A control group of its own, which the user may divide.
groups=()
for tree in /sys/fs/cgroup/systemd /sys/fs/cgroup/unified /sys/fs/cgroup; do
    [ ! -e $tree/cgroup.procs ] || groups+=("$tree/pitchline-test-$(basename "$dir")-$RANDOM")
done
for group in "${groups[@]}"; do
    mkdir "$group"
    chown -R 1000:1000 "$group"
done
(
    for group in "${groups[@]}"; do echo $BASHPID >"$group/cgroup.procs"; done
    exec setpriv --reuid 1000 --regid 1000 --clear-groups \
        env -i PATH="$PATH" HOME="$dir/home" XDG_RUNTIME_DIR=/run/user/1000 XDG_STATE_HOME="$dir/home/.config" \
        /lib/systemd/systemd --user --unit=basic.target --log-target=console --default-standard-output=inherit
) </dev/null >"$dir/manager.log" 2>&1 &
manager=$!
for _ in $(seq 100); do
    kill -0 $manager || { cat "$dir/manager.log" >&2; exit 1; }
    if [ -S /run/user/1000/systemd/private ]; then
        echo ready
        cat >/dev/null
        kill $manager
        wait $manager || true
        for group in "${groups[@]}"; do find "$group" -depth -type d -exec rmdir {} + || true; done
        exit 0
    fi
    sleep 0.1
done
exit 1
