#!/usr/bin/env python3
"""Counts what crosses the sockets when a real team shares a recorded mission: moondb_agent processes under CURVE, over
TCP on a loopback device that nobody else uses (a network namespace of its own; needs root).

Each rover's records go to the leader, and all to the designated survivor. Printed are the coded bytes that the sessions
count, what the device counted (payload, ZeroMQ, CURVE, acknowledgments, TCP, IP and 14 bytes of Ethernet a packet, both
ways), and the second over the first.

Usage: socket_bytes.py PROGRAMS MISSION [CODEC]    PROGRAMS is the folder of moonctl; CODEC compact, the default, or zstd.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile


def in_own_network():
    if not os.environ.get("MOONDB_OWN_NETWORK"):
        os.environ["MOONDB_OWN_NETWORK"] = "1"
        os.execvp("unshare", ["unshare", "-n", "bash", "-c", 'ip link set lo up; exec "$@"', "bash", sys.executable,
                              *sys.argv])


def loopback():
    """Bytes and packets sent over lo since the namespace began."""
    for line in pathlib.Path("/proc/self/net/dev").read_text().splitlines():
        if line.strip().startswith("lo:"):
            fields = line.split(":")[1].split()
            return int(fields[8]), int(fields[9])
    raise SystemExit("no loopback device")


def main():
    if len(sys.argv) not in (3, 4):
        raise SystemExit(__doc__.strip())
    in_own_network()
    programs, mission = (pathlib.Path(path).resolve() for path in sys.argv[1:3])
    codec = sys.argv[3] if len(sys.argv) == 4 else "compact"
    with tempfile.TemporaryDirectory(prefix="moondb-bytes-") as folder:
        team = pathlib.Path(folder) / "team.yaml"
        environment = dict(os.environ, MOONDB_RUN_DIR=f"{folder}/run", MOONDB_TEAM=str(team))

        def run(program, *arguments):
            return subprocess.run([programs / program, *map(str, arguments)], env=environment, check=True,
                                  capture_output=True, text=True).stdout

        run("moonctl", "config", "init", "--mission", mission, team)
        text = team.read_text()
        for old, new in ("codec: compact", f"codec: {codec}"), ("solve_by_itself: true", "solve_by_itself: false"):
            assert old in text, f"the team file has no {old}"
            text = text.replace(old, new)
        team.write_text(text)
        run("moonctl", "up", "--merge-backend", "cpu")
        try:
            run("moondb_replay", "feed", "--mission", mission)
            bytes_before, packets_before = loopback()
            run("moonctl", "sync", "now", "--wait")
            run("moonctl", "replicate", "now", "--wait")
            bytes_after, packets_after = loopback()
            records = coded = 0
            for kind in "sync", "replicate":
                for agent in json.loads(run("moonctl", kind, "status", "--json"))["agents"]:
                    for session in agent.get("sessions", []):
                        records += session["session"]["acknowledged_records"]
                        coded += session["session"]["coded_bytes"]
        finally:
            run("moonctl", "down")
    crossed = bytes_after - bytes_before
    print(f"{mission.name}, {codec}: {records:.0f} records acknowledged, {coded:.0f} bytes coded, {crossed} bytes in "
          f"{packets_after - packets_before} packets: {crossed / coded:.3f} times")


if __name__ == "__main__":
    main()
