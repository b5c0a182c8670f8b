#!/usr/bin/env python3
"""Real agents whose disks are lost or put back, again and again: is the newest state that was acknowledged still there?

Usage: lost_disk_trials.py PROGRAMS [--trials N] [--case wiped|restored|both] [--seed S] [--first-port P]
    PROGRAMS is the folder of moonctl and moondb_agent.

A team of four on this machine. In each trial one agent, a rover, the leader or the survivor in turn, inserts a state, it
is synced and replicated, and the agent is killed. Its disk is then wiped (case `wiped`), or a `moonctl db backup` of
before that state is put back (case `restored`), which runs for one or two processes. The agent inserts a newer state
at a random moment of its first seconds; when that was acknowledged, everything is synced and replicated again. A state is lost
if the agent, the leader and the survivor hold another one in the end, as SQLite reads their files. A node is lost if it
was acknowledged and one of the three lacks it.

Prints one JSON object; exit code 1 if anything was lost.
"""
import argparse
import contextlib
import json
import os
import pathlib
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time

NAMES = ["rover1", "rover2", "rover3", "base"]
LEADER, SURVIVOR = 0, 1
CASES = ["wiped", "restored"]
SETTLE_LIMIT_S = 15


class Team:
    def __init__(self, programs, folder, first_port):
        self.programs, self.folder = pathlib.Path(programs).absolute(), folder
        self.file = folder / "team.yaml"
        self.processes = {}
        self.moonctl("config", "init", "--agents", len(NAMES), "--first-port", first_port, self.file)
        text = self.file.read_text(encoding="utf-8")
        # Turn off automatic solving. Otherwise the leader could store solved poses between the last sync and the
        # comparison of the files.
        self.file.write_text(text.replace("solve_by_itself: true", "solve_by_itself: false"), encoding="utf-8")

    def moonctl(self, *arguments, check=True):
        command = [str(self.programs / "moonctl"), *(str(a) for a in arguments)]
        if arguments[0] != "config":
            command[1:1] = ["-t", str(self.file)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
        if check and done.returncode != 0:
            raise RuntimeError(f"{' '.join(command[1:])}: exit {done.returncode}: {done.stderr.strip()}")
        return done

    def data(self, agent):
        return self.folder / "moondb-data" / NAMES[agent]

    def start(self, agent):
        with open(self.folder / f"{NAMES[agent]}.log", "a", encoding="utf-8") as log:
            self.processes[agent] = subprocess.Popen(
                [str(self.programs / "moondb_agent"), "-t", str(self.file), "-a", NAMES[agent], "--merge-backend", "cpu"],
                stdout=log, stderr=log)
        self.until(lambda: self.moonctl("-a", NAMES[agent], "status", check=False).returncode == 0, "does not start")

    def kill(self, agent):
        self.processes[agent].send_signal(signal.SIGKILL)
        self.processes.pop(agent).wait()

    def stop(self):
        for process in self.processes.values():
            process.terminate()
        for process in self.processes.values():
            process.wait(timeout=30)

    def share(self):
        """Syncs and replicates. Returns True if both commands report that all records are acknowledged."""
        for kind in ("sync", "replicate"):
            for tries_left in reversed(range(8)):
                done = self.moonctl("--timeout", "30s", kind, "now", "--wait", check=False)
                if done.returncode == 0:
                    break
                if tries_left == 0:
                    return False
                time.sleep(0.5)
        return True

    @staticmethod
    def until(condition, text, limit_s=60):
        end = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end:
                raise RuntimeError(text)
            time.sleep(0.1)

    def insert(self, agent, kind, body):
        self.moonctl("-a", NAMES[agent], "record", "insert", kind, json.dumps(body))

    def states(self, holder, origin):
        """Returns the temperatures and node indexes of `origin` that `holder` stores."""
        file = self.data(holder) / "moondb.sqlite"
        with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True, timeout=10)) as db:
            celsius = [c for (c,) in db.execute("SELECT celsius FROM temperature WHERE origin = ?", (origin + 1,))]
            nodes = {n for (n,) in db.execute("SELECT node_index FROM pose_graph_node WHERE origin = ?", (origin + 1,))}
        return celsius, nodes


def node(agent, index):
    return {"node": {"agent_id": agent + 1, "index": index},
            "map_from_node": {"position_m": {"x": index}, "orientation": {"w": 1}}}


def backup(team, agent, path):
    path.unlink(missing_ok=True)
    team.moonctl("-a", NAMES[agent], "db", "backup", path)


def lose_disk(team, agent, copy):
    """Replaces the agent's disk by `copy`, or by an empty one if None. Requires: the agent is not running."""
    for file in team.data(agent).glob("moondb.sqlite*"):
        file.unlink()
    if copy:
        shutil.copy(copy, team.data(agent) / "moondb.sqlite")


def run_trial(team, number, case, draw):
    """Runs one trial. Returns the error, or None."""
    agent = draw.choice([2, 2, LEADER, SURVIVOR])
    value, lives = number * 10.0, draw.choice([1, 2])
    copy = team.folder / "copy.sqlite" if case == "restored" else None
    if copy:
        backup(team, agent, copy)
    team.insert(agent, "temperature", {"celsius": value})
    team.insert(agent, "pose_graph_node", node(agent, 2 * number))
    if not team.share():
        return "the state before was not acknowledged"
    team.kill(agent)
    lose_disk(team, agent, copy)
    team.start(agent)
    if copy and lives == 2:
        team.insert(agent, "temperature", {"celsius": value + 1})
        team.kill(agent)
        team.start(agent)
    time.sleep(draw.choice([0, 0, 0.1, 0.3, 1, 3]))
    team.insert(agent, "temperature", {"celsius": value + 2})
    team.insert(agent, "pose_graph_node", node(agent, 2 * number + 1))
    if not team.share():
        return "the newer state was not acknowledged"
    wanted = ([value + 2], {2 * number, 2 * number + 1})
    end = time.monotonic() + SETTLE_LIMIT_S
    while True:
        found = {NAMES[holder]: team.states(holder, agent) for holder in {agent, LEADER, SURVIVOR}}
        if all(celsius == wanted[0] and wanted[1] <= nodes for celsius, nodes in found.values()):
            return None
        if time.monotonic() > end:
            temperatures = {name: celsius for name, (celsius, _) in found.items()}
            return f"{case}, {NAMES[agent]}, {lives} lives: {wanted[0]} was acknowledged, held are {temperatures}"
        time.sleep(0.2)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("programs")
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--case", choices=[*CASES, "both"], default="both")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first-port", type=int, default=27400)
    options = parser.parse_args()
    draw = random.Random(options.seed)
    cases = CASES if options.case == "both" else [options.case]
    errors, counts, started = [], dict.fromkeys(cases, 0), time.monotonic()
    with tempfile.TemporaryDirectory(prefix="moondb-disk-") as folder:
        os.environ["MOONDB_RUN_DIR"] = str(pathlib.Path(folder) / "run")
        team = Team(options.programs, pathlib.Path(folder), options.first_port)
        try:
            for agent in range(len(NAMES)):
                team.start(agent)
            for number in range(1, options.trials + 1):
                case = cases[number % len(cases)]
                counts[case] += 1
                error = run_trial(team, number, case, draw)
                if error:
                    errors.append(error)
                    print(f"trial {number}: {error}", file=sys.stderr, flush=True)
        finally:
            team.stop()
    print(json.dumps({"trials": counts, "seed": options.seed, "lost": len(errors), "errors": errors[:20],
                      "seconds": round(time.monotonic() - started, 1)}))
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main())
