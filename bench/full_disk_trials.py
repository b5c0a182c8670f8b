#!/usr/bin/env python3
"""Trials: a rover whose disk was full stores again after a prune.

Usage: full_disk_trials.py PROGRAMS [--trials N] [--json FILE]

In each trial rover3 of a team of four keeps its data on a tmpfs of 96 MB, with 500 maps of its own that leader and
survivor have, too. Another program fills the disk: at once, slowly, or while a client inserts without a pause. The agent is
ended by SIGTERM or SIGKILL, and started again; its maps are pruned; leader and survivor are swapped. From then on it has to
take nodes and states, and also half a minute later. Six kinds of trials, in turn. Needs to mount (root).
Exit codes: 0 all rovers stored again, 1 not.
"""
import argparse
import importlib.util
import json
import pathlib
import signal
import sys
import tempfile
import threading
import time

MAPS = 500
FILLS = ("at once", "slowly", "under inserts")
ENDS = (signal.SIGTERM, signal.SIGKILL)

FILE = pathlib.Path(__file__).resolve().parent.parent / "tests/apps/full_disk_test.py"
spec = importlib.util.spec_from_file_location("full_disk_test", FILE)
full_disk_test = importlib.util.module_from_spec(spec)
spec.loader.exec_module(full_disk_test)
full_disk_test.DISK_MB["tmpfs"] = 96


def fill_slowly(team):
    with open(team.disk.folder / "fill", "ab", buffering=0) as file:
        try:
            while True:
                file.write(bytes(1 << 20))
                time.sleep(0.05)
        except OSError:
            pass


def fill_under_inserts(team):
    is_over = threading.Event()

    def insert():
        while not is_over.is_set():
            team.insert(check=False)

    client = threading.Thread(target=insert)
    client.start()
    time.sleep(0.5)
    fill_slowly(team)
    time.sleep(1)
    is_over.set()
    client.join()


def takes(team):
    """Checks whether the agent stores a node and a state. Returns an empty text if it does, or else the reason."""
    state = team.moonctl("-a", team.name, "record", "insert", "temperature", '{"celsius": -20}', check=False)
    for done in (team.insert(check=False), state):
        if done.returncode != 0:
            return done.stderr.strip()
    return ""


def trial(team, fill, end):
    """Runs one trial. Returns an empty text if the rover stores again, or else the reason why it does not."""
    team.begin()
    for _ in range(MAPS - 6):
        team.insert_map()
    team.moonctl("sync", "now", "--wait")
    team.moonctl("replicate", "now", "--wait")
    if fill == "slowly":
        fill_slowly(team)
    elif fill == "under inserts":
        fill_under_inserts(team)
    team.disk.fill()
    team.end(end)
    team.disk.fill()
    team.up(team.name)
    while "local_traversability_map" in team.moonctl("-a", team.name, "db", "prune", "--type",
                                                     "local_traversability_map", "--json").stdout:
        pass
    team.moonctl("role", "swap")
    for wait_s in (0, 30):
        time.sleep(wait_s)
        if why := takes(team):
            return f"after {wait_s} s: {why}"
    return ""


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    trials = []
    for number in range(options.trials):
        fill, end = FILLS[number % 3], ENDS[number // 3 % 2]
        with tempfile.TemporaryDirectory(prefix="moondb-full-") as folder:
            team = full_disk_test.Team(options.programs.resolve(), pathlib.Path(folder), "rover3", "tmpfs", None)
            try:
                text = team.file.read_text()
                team.file.write_text(text.replace("budget_kbps: 1000", "budget_kbps: 100000"))
                why = trial(team, fill, end)
            except full_disk_test.Failure as failure:
                why = str(failure)
            finally:
                team.close()
        trials.append({"fill": fill, "end": end.name, "why": why})
        print(f"{number + 1}: filled {fill}, {end.name}: {why or 'stores again'}", flush=True)
    stored = sum(not each["why"] for each in trials)
    print(f"{stored} of {len(trials)} rovers store again")
    if options.json:
        options.json.write_text(json.dumps({"trials": trials, "stored": stored}, indent=1) + "\n")
    return 0 if stored == len(trials) else 1


if __name__ == "__main__":
    sys.exit(main())
