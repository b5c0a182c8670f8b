#!/usr/bin/env python3
"""The leader's disk is removed at random moments of a mission: was all that is missing then counted by `moonctl risk`?

Usage: risk_trials.py PROGRAMS [--trials N] [--seed S] [--first-port P]
    PROGRAMS is the folder of moonctl and moondb_agent.

A team of four on this machine. All rovers insert nodes without a pause, and syncs and replications are ordered at
random times. In each trial `moonctl --json risk` counts, and at most 3 s later the leader is killed and its disk
removed. A record is missing if the leader's file held it and no other agent's file does, as SQLite reads them. Each
missing record that existed when the count began must be among the keys that `risk` listed for the leader. Each listed
record must be in one of the files.

Prints one JSON object; exit code 1 if a trial failed.
"""
import argparse
import contextlib
import json
import os
import pathlib
import random
import sqlite3
import sys
import tempfile
import threading
import time

from lost_disk_trials import LEADER, NAMES, Team, lose_disk, node

TYPES = ["pose_graph_node", "agent_event", "role_assignment"]  # Under the policy `all`: nothing supersedes them.
KILL_LIMIT_S = 3.0


def keys_of(team, agent):
    """Returns the keys (type, origin, epoch, seq) of the shared records in the agent's file."""
    file = team.data(agent) / "moondb.sqlite"
    keys = set()
    with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True, timeout=10)) as db:
        for kind in TYPES:
            rows = db.execute(f"SELECT origin, epoch, seq FROM {kind} WHERE seq IS NOT NULL")
            keys |= {(kind, origin, epoch % 2**64, seq) for origin, epoch, seq in rows}
    return keys


def listed_keys(report):
    """Returns the keys of TYPES that `moonctl --json risk` lists for the leader."""
    leader = next(agent for agent in report["agents"] if agent["name"] == NAMES[LEADER])
    return {(part["type"], NAMES.index(part["origin"]) + 1, int(part["epoch"], 16), seq)
            for part in leader["lost_without"] if part["type"] in TYPES
            for seq in range(int(part["first"]), int(part["last"]) + 1)}


class Mission:
    """Inserts and shares in the background."""

    def __init__(self, team, draw):
        self.team, self.draw, self.is_over = team, draw, threading.Event()
        self.threads = [threading.Thread(target=self.insert, args=(agent,)) for agent in range(3)]
        self.threads.append(threading.Thread(target=self.share))
        for thread in self.threads:
            thread.start()

    def insert(self, agent):
        index = int(time.time() * 1000)
        while not self.is_over.is_set():
            index += 1
            body = node(agent, index)
            body["map_from_node"]["position_m"]["x"] = index % 1000
            self.team.moonctl("-a", NAMES[agent], "record", "insert", "pose_graph_node", json.dumps(body),
                              check=False)

    def share(self):
        while not self.is_over.wait(self.draw.uniform(0, 3)):
            self.team.moonctl("--timeout", "5s", self.draw.choice(["sync", "replicate"]), "now", "--wait", check=False)

    def end(self):
        self.is_over.set()
        for thread in self.threads:
            thread.join()


def run_trial(team, draw):
    """Runs one trial. Returns (error or None, number of listed records, number of missing records)."""
    mission = Mission(team, random.Random(draw.random()))
    try:
        time.sleep(draw.uniform(0.5, 4))
        before = keys_of(team, LEADER)
        started = time.monotonic()
        listed = listed_keys(json.loads(team.moonctl("--json", "risk").stdout))
        time.sleep(max(0.0, draw.uniform(0, KILL_LIMIT_S) - (time.monotonic() - started)))
        team.kill(LEADER)
    finally:
        mission.end()
    held = keys_of(team, LEADER)
    others = set().union(*(keys_of(team, agent) for agent in range(1, len(NAMES))))
    missing = (held & before) - others
    lose_disk(team, LEADER, None)
    team.start(LEADER)
    uncounted = missing - listed
    vanished = listed - held - others
    error = None
    if uncounted:
        error = f"{len(uncounted)} missing records were not counted, for example {sorted(uncounted)[0]}"
    elif vanished:
        error = f"{len(vanished)} counted records are nowhere, for example {sorted(vanished)[0]}"
    elif not team.share():
        error = "the team does not share again"
    return error, len(listed), len(missing)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("programs")
    parser.add_argument("--trials", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first-port", type=int, default=27450)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    errors, listed_count, missing_count, started = [], 0, 0, time.monotonic()
    with tempfile.TemporaryDirectory(prefix="moondb-risk-") as folder:
        os.environ["MOONDB_RUN_DIR"] = str(pathlib.Path(folder) / "run")
        team = Team(options.programs, pathlib.Path(folder), options.first_port)
        try:
            for agent in range(len(NAMES)):
                team.start(agent)
            for number in range(1, options.trials + 1):
                error, listed, missing = run_trial(team, draw)
                listed_count += listed
                missing_count += missing
                if error:
                    errors.append(error)
                    print(f"trial {number}: {error}", file=sys.stderr, flush=True)
        finally:
            team.stop()
    print(json.dumps({"trials": options.trials, "seed": options.seed, "failed": len(errors), "errors": errors[:20],
                      "counted_records": listed_count, "missing_records": missing_count,
                      "seconds": round(time.monotonic() - started, 1)}))
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
