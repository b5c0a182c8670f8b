#!/usr/bin/env bash
# Gives a running robot another IP address, as a DHCP server does, and checks that the others look up its host name again and
# connect to the new one. Runs in namespaces of its own, with /etc/hosts as the name server.
#   moved_host_test.sh PROGRAMS    the folder of moonctl and moondb_agent
# Exit codes: 0 passed, 1 failed, 77 skipped (this machine makes no namespaces).
set -euo pipefail
if [ -z "${MOONDB_OWN_HOSTS:-}" ]; then
  unshare --mount --net ip link set lo up 2> /dev/null || { echo "skipped: needs root, unshare and iproute2"; exit 77; }
  MOONDB_OWN_HOSTS=1 exec unshare --mount --net "$0" "$@"
fi
programs=$(realpath "$1")
folder=$(mktemp -d /tmp/moondb-moved-XXXX)
export MOONDB_RUN_DIR=$folder/run MOONDB_TEAM=$folder/team.yaml PATH=$programs:$PATH
trap 'kill $(jobs -p) 2> /dev/null || true; wait; rm -rf "$folder"' EXIT
ip link set lo up

move_to() {
  ip address add "$1/32" dev lo
  echo "$1 rover2.field" > "$folder/hosts"
}

# Waits until the leader has a connection to an address of rover2, and exchanges messages with it.
expect_link_to() {
  for _ in $(seq 300); do
    if ss -Htn state established dst "$1" | grep -q ":7401" && moonctl -a rover1 status | grep -q "2/2"; then
      echo "rover1 reaches rover2 at $1"
      return
    fi
    sleep 0.1
  done
  echo "failed: rover1 does not reach rover2 at $1"
  ss -tn
  moonctl -a rover1 status
  exit 1
}

move_to 10.9.0.2
mount --bind "$folder/hosts" /etc/hosts
moonctl config init --agents 3 "$MOONDB_TEAM" > /dev/null
sed -i 's|    address: "tcp://127.0.0.1:7401"|    address: "tcp://rover2.field:7401"\n    listen: "tcp://0.0.0.0:7401"|' "$MOONDB_TEAM"
grep -q rover2.field "$MOONDB_TEAM"
for name in rover1 rover2 base; do moondb_agent -t "$MOONDB_TEAM" -a $name > "$folder/$name.log" 2>&1 & done
expect_link_to 10.9.0.2
ip address del 10.9.0.2/32 dev lo
move_to 10.9.0.3
expect_link_to 10.9.0.3
moonctl -a rover2 record insert temperature '{"celsius": 20}' > /dev/null
moonctl sync now --wait
