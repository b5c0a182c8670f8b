#!/usr/bin/env bash
# Runs a team in which every second agent is the aarch64 program under qemu-user, shares a mission, and compares the merged
# maps of the leader (x86-64) and the survivor (aarch64) byte for byte.
#   mixed_team_test.sh PROGRAMS ARM64_PROGRAMS SYSROOT [MISSION]    a generated mission if none is given
set -euo pipefail
programs=$(realpath "$1") arm64=$(realpath "$2") sysroot=$(realpath "$3")
folder=$(mktemp -d /tmp/moondb-mixed-XXXX)
export MOONDB_RUN_DIR=$folder/run MOONDB_TEAM=$folder/team/team.yaml PATH=$programs:$PATH
trap 'kill $(jobs -p) 2> /dev/null || true; wait; rm -rf "$folder"' EXIT
mission=${4:-$folder/mission}
[ $# -gt 3 ] || moondb_mission generate --seed 7 --minutes 10 --out "$mission" > /dev/null
moonctl config init --mission "$mission" "$MOONDB_TEAM" --first-port 17600 > /dev/null
names=$(moonctl --json config show |
  python3 -c 'import json, sys; print(*(agent["name"] for agent in json.load(sys.stdin)["config"]["agents"]))')
number=0
for name in $names; do
  number=$((number + 1))
  program=(moondb_agent)
  [ $((number % 2)) -eq 1 ] || program=(qemu-aarch64-static -L "$sysroot" "$arm64/moondb_agent")
  "${program[@]}" --merge-backend cpu -t "$MOONDB_TEAM" -a "$name" > "$folder/$name.log" 2>&1 &
done
for attempt in $(seq 600); do
  [ "$(grep -l ready: "$folder"/*.log | wc -l)" -ne "$number" ] || break
  [ "$attempt" -lt 600 ] || { echo "mixed team: an agent did not start"; tail -n 2 "$folder"/*.log; exit 1; }
  sleep 0.1
done
moondb_replay feed -t "$MOONDB_TEAM" --mission "$mission" > /dev/null 2>&1
moonctl --timeout 600s sync now --wait > /dev/null 2>&1
moonctl graph optimize > /dev/null
moonctl --timeout 600s replicate now --wait > /dev/null 2>&1
moonctl db diff rover1 rover2 2> /dev/null | tail -1
for name in rover1 rover2; do moonctl -a $name --timeout 600s map export "$folder/$name" > /dev/null; done
grep -h "merges on" "$folder/rover1.log" "$folder/rover2.log"
cmp "$folder/rover1/map.pgm" "$folder/rover2/map.pgm"
echo "mixed team: the merged maps of x86-64 and aarch64 are equal, $(stat -c %s "$folder/rover1/map.pgm") bytes"
