#!/usr/bin/env python3
"""Measures the cost of authentication: real teams of four agents on loopback, one with keys and one without
(`insecure`), while idle and while their roles are swapped again and again.

Usage: security_cost.py PROGRAMS [--seconds S] [--swaps N] [--pairs N] [--json FILE]
    PROGRAMS   folder of moonctl and moondb_agent
    --seconds  how long the teams are watched idle (30)
    --swaps    how many swaps there are, one a second (15; an agent takes 20 changes of one issuer at once)
    --pairs    how often both teams are watched, in turn (3)

Prints, and writes as JSON: the processor time of all four agents as a share of one processor, with keys and without. Also prints
the frames that each agent handed to the socket of each other agent for a swap. Medians of the pairs.
"""
import argparse
import contextlib
import json
import os
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time

NAMES = ["rover1", "rover2", "rover3", "base"]
TICKS_S = os.sysconf("SC_CLK_TCK")


class Team:
    def __init__(self, programs, folder):
        self.programs, self.folder = programs, folder
        self.environment = {**os.environ, "MOONDB_TEAM": str(folder / "team.yaml"), "MOONDB_RUN_DIR": str(folder / "run")}

    def moonctl(self, *words):
        return subprocess.run([self.programs / "moonctl", *words], env=self.environment, cwd=self.folder, check=True,
                              capture_output=True, text=True).stdout

    def processor_s(self):
        """Returns the processor time of all four agents since they started."""
        total = 0
        for name in NAMES:
            pid = (self.folder / "moondb-data" / name / "agent.pid").read_text().split()[0]
            fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
            total += int(fields[11]) + int(fields[12])
        return total / TICKS_S

    def sent_bytes(self):
        """Returns the bytes sent as {(from, to): bytes}."""
        sent = {}
        for shown in json.loads(self.moonctl("status", "--json"))["agents"]:
            for peer in shown["status"]["peers"]:
                sent[shown["name"], peer["name"]] = float(peer.get("sent_bytes", 0))
        return sent


@contextlib.contextmanager
def running_team(programs, has_keys):
    with tempfile.TemporaryDirectory(prefix="moondb-cost-") as name:
        team = Team(programs, pathlib.Path(name))
        team.moonctl("config", "init", "--agents", "4", "--first-port", "7600", "team.yaml")
        if not has_keys:
            path = team.folder / "team.yaml"
            lines = [line for line in path.read_text().splitlines() if not re.match(r"\s*(signing_)?key:", line)]
            path.write_text("insecure: true\n" + "\n".join(lines) + "\n")
        team.moonctl("up", "--merge-backend", "cpu")
        try:
            time.sleep(3)
            yield team
        finally:
            team.moonctl("down")


def watch(programs, has_keys, options):
    with running_team(programs, has_keys) as team:
        begin, before = time.monotonic(), team.processor_s()
        time.sleep(options.seconds)
        rest = (team.processor_s() - before) / (time.monotonic() - begin)
        idle_begin, idle = time.monotonic(), team.sent_bytes()
        time.sleep(options.seconds / 3)
        idle_end = team.sent_bytes()
        idle_rate = {link: (idle_end[link] - idle[link]) / (time.monotonic() - idle_begin) for link in idle}
        begin, before, sent = time.monotonic(), team.processor_s(), team.sent_bytes()
        for i in range(options.swaps):
            team.moonctl("role", "swap")
            time.sleep(max(0, begin + i + 1 - time.monotonic()))
        seconds, after = time.monotonic() - begin, team.sent_bytes()
        swapping = (team.processor_s() - before) / seconds
        of_a_swap = [(after[link] - sent[link] - idle_rate[link] * seconds) / options.swaps for link in sent]
        return {"idle": rest, "swapping": swapping, "bytes_a_swap_max": max(of_a_swap),
                "bytes_a_swap_median": statistics.median(of_a_swap)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("--swaps", type=int, default=15)
    parser.add_argument("--pairs", type=int, default=3)
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    programs = options.programs.resolve()
    pairs = [{"with_keys": watch(programs, True, options), "without": watch(programs, False, options)}
             for _ in range(options.pairs)]
    result = {name: {key: statistics.median(pair[name][key] for pair in pairs) for key in pairs[0][name]}
              for name in ("with_keys", "without")}
    result["pairs"] = pairs
    for name, figures in list(result.items())[:2]:
        print(f"{name:9}  idle {100 * figures['idle']:.2f} % of a processor, a swap a second "
              f"{100 * figures['swapping']:.2f} %; a swap takes {figures['bytes_a_swap_median']:.0f} bytes on a link, "
              f"{figures['bytes_a_swap_max']:.0f} at most")
    if options.json:
        options.json.write_text(json.dumps(result, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
