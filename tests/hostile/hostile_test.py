#!/usr/bin/env python3
"""Attacks a real team, one attacker after the other, and looks whether it holds.

Usage: hostile_test.py PROGRAMS [--only NAME] [--module NAME] [--scale X] [--not-yet] [--seed N] [--json FILE]

PROGRAMS is the folder of moonctl and moondb_agent. During each attacker the others go on sharing; after it the attacked
agent runs, took at most 64 MB more at any time (or RSS_MB_MAX_OF its module), logged and stored little, and answers; no
honest agent lost a record that it had, and what rover2 inserts then comes to the leader. With a smaller scale attackers send
less, and those that show nothing then are left out. Attackers against which there is no check yet (NOT_YET of their module)
run with --not-yet alone, and fail nothing.
Exit codes: 0 all held, 1 not, 77 skipped (a package of Python is missing, or ports are taken; it says which).
"""
import argparse
import contextlib
import importlib
import json
import os
import pathlib
import random
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "apps"))
from python_example_test import python_with  # noqa: E402
from snippets_test import SKIPPED, in_own_network, taken_port  # noqa: E402

PACKAGES = ["nacl", "zmq", "google.protobuf", "zstandard"]
MODULES = ["listener", "records", "graph", "havesets", "sessions", "roles", "commands", "costs", "clients", "files", "fuzz"]
RSS_MB_MAX = 64
# Growth of the agent's memory in MB after which the agent is restarted before the next attack.
RSS_MB_LEFT_MAX = 4
LOG_BYTES_MAX = 64 * 1024
DISK_BYTES_MAX = 64 * 1024 * 1024
SHARE_S_MAX = 20  # Time limit in seconds for sharing while an attack runs.
# Number of status requests after each sharing, and the pause in seconds after each request.
STATUS_QUESTIONS, PAUSE_S = 5, 0.1


class Bystander:
    """While an attack runs, repeats status requests to the attacked agent over ipc and sharing among the honest
    agents. Keeps the longest duration of each."""

    def __init__(self, team):
        self.team, self.share_s, self.status_s, self.failure = team, 0, 0, None
        self.is_over = threading.Event()
        self.thread = threading.Thread(target=self._run)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.is_over.set()
        self.thread.join()

    def _run(self):
        from team import Failure
        while not self.is_over.is_set():
            try:
                self.share_s = max(self.share_s, self.team.share(SHARE_S_MAX))
                for _ in range(STATUS_QUESTIONS):
                    begin = time.monotonic()
                    self.team.status("rover1")
                    self.status_s = max(self.status_s, time.monotonic() - begin)
                    self.is_over.wait(PAUSE_S)
            except Failure as failure:
                self.failure = f"while it ran: {failure}"


def lost_records(team, before, of_team):
    """Yields a line for each honest agent that lost records, or that holds other contents under their keys. With
    `of_team`, a record counts as lost only if no honest agent holds it any more."""
    now = {agent: team.records(agent) for agent in before}
    if of_team:
        before, now = [{"the team": {key: digest for held in agents.values() for key, digest in held.items()}}
                       for agents in (before, now)]
    for agent, held in before.items():
        lost = sum(now[agent].get(key) != digest for key, digest in held.items())
        if lost:
            yield f"{agent} lost {lost} of {len(held)} records"


def costs(team, before):
    rss_mb, log_bytes, disk_bytes = before
    return {
        "rss_mb_more": round(team.rss_mb("rover1", peak=True) - rss_mb, 1),
        "rss_mb_left": round(team.rss_mb("rover1") - rss_mb, 1),
        "log_bytes": team.log_bytes("rover1") - log_bytes,
        "disk_bytes": team.disk_bytes("rover1") - disk_bytes,
    }


def beyond_bounds(result, rss_mb_max):
    if result["rss_mb_more"] > rss_mb_max:
        yield f"it took {result['rss_mb_more']} MB"
    if result["log_bytes"] > LOG_BYTES_MAX:
        yield f"it logged {result['log_bytes']} bytes"
    if result["disk_bytes"] > DISK_BYTES_MAX:
        yield f"it stored {result['disk_bytes']} bytes"


def still_shares(team):
    """Returns the present durations of a status request and of sharing."""
    return {"status_s": round(team.answers("rover1"), 3), "share_s": round(team.share(), 3)}


def refresh(team):
    """Restarts the attacked agent if an attacker enlarged its process: memory that it can reuse would hide the
    memory that the next attacker makes it use. Then shares without an attack, and returns the duration in seconds."""
    if team.rss_mb("rover1") > team.fresh_rss_mb + RSS_MB_LEFT_MAX:
        team.restart("rover1")
        team.settle()
        team.fresh_rss_mb = team.rss_mb("rover1")
    return team.settle()


def attack(team, attacker, scale, prunes, is_idle, rss_mb_max):
    """Runs an attacker. Returns measurements of the team; "broken" lists the violated conditions. `prunes`: the
    operator removes records during the attack. `is_idle`: the other agents do not share during the attack, because
    the attacked agent is stopped or another agent leads."""
    from team import HONEST, Failure
    quiet_s = refresh(team)
    team.forget_peak("rover1")
    held = {agent: team.records(agent) for agent in HONEST}
    before = (team.rss_mb("rover1"), team.log_bytes("rover1"), team.disk_bytes("rover1"))
    broken = []
    begin = time.monotonic()
    bystander = Bystander(team)
    with contextlib.nullcontext() if is_idle else bystander:
        try:
            attacker(team, scale)
        except Failure as failure:
            broken.append(str(failure))
    result = {"attack_s": round(time.monotonic() - begin, 1), "quiet_share_s": round(quiet_s, 3),
              "share_s_meanwhile": round(bystander.share_s, 3), "status_s_meanwhile": round(bystander.status_s, 3)}
    if not team.is_alive("rover1"):
        return {**result, "broken": [*broken, "the agent ended"], "log": team.log_end("rover1")}
    if bystander.failure:
        broken.append(bystander.failure)
    result.update(costs(team, before))
    broken += beyond_bounds(result, rss_mb_max)
    try:
        result.update(still_shares(team))
    except Failure as failure:
        broken.append(str(failure))
    broken += lost_records(team, held, of_team=prunes)
    return {**result, "broken": broken}


def chosen(options):
    """Returns (module, attacker) of all attackers to run, in order."""
    for name in MODULES:
        module = importlib.import_module(name)
        for attacker in module.ATTACKERS:
            is_long = options.scale < 1 and attacker in getattr(module, "ONLY_AT_LENGTH", [])
            is_not_yet = attacker in getattr(module, "NOT_YET", {}) and not options.not_yet
            is_meant = options.only in (None, attacker.__name__) and options.module in (None, name)
            if is_meant and not is_long and not is_not_yet:
                yield module, attacker


def report(module, attacker, result):
    """Prints the result. Returns True if it counts as a failure."""
    reason = getattr(module, "NOT_YET", {}).get(attacker)
    if reason and result["broken"]:
        result["not_yet"] = reason
    elif reason:
        print(f"    it held: take {attacker.__name__} out of NOT_YET")
    print(f"    {json.dumps(result)}", flush=True)
    return bool(result["broken"]) and not reason


def run(options):
    from team import hostile_team
    results, failed = {}, []
    with hostile_team(options.programs.resolve()) as team:
        for module, attacker in chosen(options):
            print(f"{module.__name__}.{attacker.__name__}: {attacker.__doc__.splitlines()[0]}", flush=True)
            team.take_over() if getattr(module, "TAKES_ROVER3", False) else team.give_back()
            prunes = attacker in getattr(module, "PRUNING", [])
            idle = [*getattr(module, "LEADS", []), *getattr(module, "RESTARTS", [])]
            is_idle = getattr(module, "AT_REST", False) or attacker in idle
            rss_mb_max = getattr(module, "RSS_MB_MAX_OF", {}).get(attacker, RSS_MB_MAX)
            result = results[attacker.__name__] = attack(team, attacker, options.scale, prunes, is_idle, rss_mb_max)
            if report(module, attacker, result):
                failed.append(attacker.__name__)
            if result["broken"] or attacker in getattr(module, "LEAVES_MUCH", []):
                team.rebuild()
    print(f"{len(results)} attackers; not withstood: {', '.join(failed) or 'none'}")
    if options.json:
        options.json.write_text(json.dumps(results, indent=1) + "\n")
    return 1 if failed or not results else 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("--only")
    parser.add_argument("--module", choices=MODULES)
    parser.add_argument("--scale", type=float, default=1)
    parser.add_argument("--not-yet", action="store_true")
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 32))
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    if taken_port() is not None:
        print(f"skipped: port {taken_port()} is taken")
        return SKIPPED
    sys.path.insert(0, str(options.programs.resolve().parent / "python"))  # The package moondb.
    print(f"seed {options.seed}")
    random.seed(options.seed)
    return run(options)


def with_modules():
    """Runs this program again with an interpreter that has the packages, if this one lacks them."""
    python = python_with(PACKAGES)
    if python is None:
        print(f"skipped: Python lacks one of {', '.join(PACKAGES)}")
        sys.exit(SKIPPED)
    if python != sys.executable:
        os.execv(python, [python, *sys.argv])


if __name__ == "__main__":
    with_modules()
    in_own_network()
    with contextlib.suppress(KeyboardInterrupt):
        sys.exit(main())
