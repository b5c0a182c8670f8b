#!/usr/bin/env python3
"""Counts the bytes that cross the sockets when a real team shares a whole mission. The agents are moondb_agent processes
under CURVE, over TCP on the loopback device of a network namespace of their own (needs root).

Each rover's agent is given its records. Two more agents have none: the leader, to which all is synced, and the
designated survivor, to which the leader replicates all. So every record crosses twice, and each of the two is what one
destination costs that lacks everything: that is to be set against the same records as the paper's statements.

Usage: socket_bytes.py PROGRAMS MISSION [CODEC] [--json]
    PROGRAMS  folder of moonctl, moondb_agent and wire_feed
    MISSION   rolling, single_view, or the folder of a recorded mission
    CODEC     compact, the default; zstd, plain; or paper_sql, whose statements are then sent in earnest

For each crossing: records acknowledged and coded bytes as the sessions count them. Also bytes and packets on the device
in both directions: payload, ZeroMQ, CURVE, acknowledgments, TCP and IP, in packets of at most 1,500 bytes. Then the size
under paper_sql, which wire_bench computes, and how many times smaller the device's bytes are.
"""
import argparse
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile

AGENT_COUNT = 7  # Four rovers with records, the leader, the survivor, and the base station, which gets no records.
LEADER, SURVIVOR = "rover5", "rover6"
PATIENCE = "3h"


def in_own_network():
    if not os.environ.get("MOONDB_OWN_NETWORK"):
        os.environ["MOONDB_OWN_NETWORK"] = "1"
        os.execvp("unshare", ["unshare", "-n", "bash", "-c", 'ip link set lo mtu 1500 gso_max_segs 1 up; exec "$@"', "bash", sys.executable,
                              *sys.argv])


def loopback():
    """Returns the bytes and packets sent over lo since the namespace was created."""
    for line in pathlib.Path("/proc/self/net/dev").read_text().splitlines():
        if line.strip().startswith("lo:"):
            fields = line.split(":")[1].split()
            return int(fields[8]), int(fields[9])
    raise SystemExit("no loopback device")


def team_text(text, codec):
    """Returns the team file with all states shared, and without records that agents write themselves."""
    head, share, ground = re.fullmatch(r"(.*\nshare:\n)(.*)(\nground:\n.*)", text, re.DOTALL).groups()
    share = re.sub(r"(temperature|power): latest", r"\1: all", share)
    share = share.replace("agent_event: all", "agent_event: none")
    text = head + share + re.sub(r"(?m)^(  \w+): (all|latest)$", r"\1: none", ground)
    for old, new in ((r"leader: \w+", f"leader: {LEADER}"), (r"survivor: \w+", f"survivor: {SURVIVOR}"),
                     ("codec: compact", f"codec: {codec}"), ("solve_by_itself: true", "solve_by_itself: false")):
        text, count = re.subn(old, new, text)
        assert count == 1, f"the team file has no {old}"
    return text


class Team:
    def __init__(self, programs, folder, codec):
        self.programs = programs
        self.file = pathlib.Path(folder) / "team.yaml"
        self.environment = dict(os.environ, MOONDB_RUN_DIR=f"{folder}/run", MOONDB_TEAM=str(self.file))
        self.data = pathlib.Path(folder) / "data"
        self.run("moonctl", "config", "init", "--agents", AGENT_COUNT, self.file)
        self.file.write_text(team_text(self.file.read_text(), codec))

    def run(self, program, *arguments):
        done = subprocess.run([self.programs / program, *map(str, arguments)], env=self.environment,
                              stdout=subprocess.PIPE, text=True)
        if done.returncode != 0:
            raise SystemExit(f"{program} {' '.join(map(str, arguments))} failed")
        return done.stdout

    def sessions(self, kind):
        """Returns acknowledged records and coded bytes by sender and destination."""
        return {(agent["name"], session["to"]): (int(session["session"]["acknowledged_records"]),
                                                  int(session["session"]["coded_bytes"]))
                for agent in json.loads(self.run("moonctl", kind, "status", "--json"))["agents"]
                for session in agent["sessions"]}

    def cross(self, kind):
        """Syncs or replicates all records once and measures the bytes."""
        sessions_before, device_before = self.sessions(kind), loopback()
        self.run("moonctl", "--timeout", PATIENCE, kind, "now", "--wait")
        device_after = loopback()
        directions = []
        for pair, (records, coded) in sorted(self.sessions(kind).items()):
            records_before, coded_before = sessions_before.get(pair, (0, 0))
            if records > records_before:
                directions.append({"from": pair[0], "to": pair[1], "records": records - records_before,
                                   "coded": coded - coded_before})
        return {"directions": directions, "records": sum(each["records"] for each in directions),
                "coded": sum(each["coded"] for each in directions), "device": device_after[0] - device_before[0],
                "packets": device_after[1] - device_before[1]}


def measure(programs, mission, codec):
    with tempfile.TemporaryDirectory(prefix="moondb-bytes-") as folder:
        team = Team(programs, folder, codec)
        try:
            team.run("moonctl", "up", "--merge-backend", "cpu", "--data-dir", team.data)
            fed = json.loads(team.run("wire_feed", mission))
            crossings = {kind: team.cross(kind) for kind in ("sync", "replicate")}
        finally:
            team.run("moonctl", "down", "--data-dir", team.data)
    for kind, crossing in crossings.items():
        if crossing["records"] != fed["records"]:
            raise SystemExit(f"{kind} brought {crossing['records']} of {fed['records']} records")
        crossing["paper_sql"] = fed["paper_sql_bytes"]
        crossing["ratio"] = round(fed["paper_sql_bytes"] / crossing["device"], 1)
    return {"mission": fed["mission"], "codec": codec, "records": fed["records"], "maps": fed["maps"],
            "crossings": crossings}


def table_of(measured):
    columns = ("records", "coded", "device", "packets", "paper_sql")
    lines = [f"{measured['mission']}, {measured['codec']}: {measured['records']} records, {measured['maps']} of them maps",
             f"  {'':18}" + "".join(f"{name:>12}" for name in columns) + f"{'ratio':>9}"]
    for kind, crossing in measured["crossings"].items():
        ratio = f"1/{crossing['ratio']}"
        lines.append(f"  {kind:18}" + "".join(f"{crossing[name]:>12}" for name in columns) + f"{ratio:>9}")
        for each in crossing["directions"]:
            lines.append(f"    {each['from'] + ' to ' + each['to']:16}{each['records']:>12}{each['coded']:>12}")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("programs", type=lambda path: pathlib.Path(path).resolve())
    parser.add_argument("mission")
    parser.add_argument("codec", nargs="?", default="compact", choices=("compact", "zstd", "plain", "paper_sql"))
    parser.add_argument("--json", action="store_true")
    arguments = parser.parse_args()
    in_own_network()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # Exit through an exception, so that the team is stopped.
    measured = measure(arguments.programs, arguments.mission, arguments.codec)
    print(json.dumps(measured, indent=1) if arguments.json else table_of(measured))


if __name__ == "__main__":
    main()
