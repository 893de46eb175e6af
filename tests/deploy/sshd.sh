#!/bin/bash
# A machine "node" that takes one throwaway key by ssh, with its home folder and the client's in DIR/home:
#
#   unshare --mount --pid --net --fork --kill-child --mount-proc tests/deploy/sshd.sh DIR
#
# It says "ready", or "skipped: WHY" where a package is missing, and ends with its standard input. To log in:
#
#   nsenter -t PID -m -p -n ssh node
#
# Packages: openssh-server, openssh-client, iproute2. Needs the rights of root.
set -euo pipefail
dir=$1
for program in /usr/sbin/sshd ssh scp ssh-keygen ip; do
    command -v $program >/dev/null || { echo "skipped: $program is not installed"; exit 0; }
done
ip link set lo up
mount -t tmpfs none /run
mkdir -p /run/sshd "$dir/home/.ssh"
chmod 700 "$dir/home/.ssh"
ssh-keygen -q -t ed25519 -N '' -f "$dir/hostkey" >&2
ssh-keygen -q -t ed25519 -N '' -f "$dir/home/.ssh/id_ed25519" >&2
cp "$dir/home/.ssh/id_ed25519.pub" "$dir/home/.ssh/authorized_keys"
echo "node $(cat "$dir/hostkey.pub")" >"$dir/home/.ssh/known_hosts"
printf 'Host node\n  HostName 127.0.0.1\n  HostKeyAlias node\n' >"$dir/home/.ssh/config"
# ssh and sshd look for the home folder in /etc/passwd.
mount --bind "$dir/home" "$(getent passwd root | cut -d: -f6)"
cat >"$dir/sshd_config" <<CONF
ListenAddress 127.0.0.1
HostKey $dir/hostkey
PidFile none
UsePAM no
PasswordAuthentication no
PermitRootLogin prohibit-password
# The folder of a test need not be root's own.
StrictModes no
Subsystem sftp internal-sftp
CONF
/usr/sbin/sshd -D -e -f "$dir/sshd_config" </dev/null >&2 &
sshd=$!
for _ in $(seq 100); do
    kill -0 $sshd || exit 1
    if ssh node true </dev/null >/dev/null 2>&1; then
        echo ready
        cat >/dev/null
        exit 0
    fi
    sleep 0.1
done
exit 1
