#!/usr/bin/env python3
"""Attacks a real team, one attacker after the other, and looks whether it holds.

Usage: hostile_test.py PROGRAMS [--only NAME] [--scale X] [--json FILE]

PROGRAMS is the folder of moonctl and moondb_agent. After each attacker the agent lives, has taken at most 64 MB more at
any time, has logged little, answers its own clients, and takes part in sharing. With a smaller scale attackers send less.
Exit codes: 0 all held, 1 not, 77 skipped (python3-nacl is missing, or ports are taken; it says which).
"""
import argparse
import json
import os
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "apps"))
from python_example_test import python_with  # noqa: E402
from snippets_test import SKIPPED, in_own_network, taken_port  # noqa: E402

MODULES = ["nacl"]
RSS_MB_MAX = 64
LOG_BYTES_MAX = 64 * 1024


def attack(team, attacker, scale):
    """What became of rover1; with "broken", what did not hold."""
    from team import Failure
    team.restart("rover1")
    team.moonctl("sync", "now", "--wait", "--timeout", "30s")
    team.forget_peak("rover1")
    rss_mb, log_bytes = team.rss_mb("rover1"), team.log_bytes("rover1")
    broken = []
    try:
        attacker(team, scale)
    except Failure as failure:
        broken.append(str(failure))
    if not team.is_alive("rover1"):
        return {"broken": [*broken, "the agent ended"]}
    result = {
        "rss_mb_more": round(team.rss_mb("rover1", peak=True) - rss_mb, 1),
        "rss_mb_left": round(team.rss_mb("rover1") - rss_mb, 1),
        "log_bytes": team.log_bytes("rover1") - log_bytes,
    }
    if result["rss_mb_more"] > RSS_MB_MAX:
        broken.append(f"it took {result['rss_mb_more']} MB")
    if result["log_bytes"] > LOG_BYTES_MAX:
        broken.append(f"it logged {result['log_bytes']} bytes")
    try:
        result["status_s"] = round(team.answers("rover1"), 3)
        team.moonctl("sync", "now", "--wait", "--timeout", "30s")
    except Failure as failure:
        broken.append(str(failure))
    return {**result, "broken": broken}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("--only")
    parser.add_argument("--scale", type=float, default=1)
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    if taken_port() is not None:
        print(f"skipped: port {taken_port()} is taken")
        return SKIPPED
    import door
    from team import hostile_team
    results = {}
    with hostile_team(options.programs.resolve()) as team:
        for attacker in [*door.ATTACKERS]:
            if options.only and options.only != attacker.__name__:
                continue
            if options.scale < 1 and attacker in door.ONLY_AT_LENGTH:
                continue
            print(f"{attacker.__name__}: {attacker.__doc__.splitlines()[0]}", flush=True)
            results[attacker.__name__] = attack(team, attacker, options.scale)
            print(f"    {json.dumps(results[attacker.__name__])}", flush=True)
    if options.json:
        options.json.write_text(json.dumps(results, indent=1) + "\n")
    return 1 if any(result["broken"] for result in results.values()) else 0


def with_modules():
    """Runs this again with an interpreter that has the packages, where this one has not."""
    python = python_with(MODULES)
    if python is None:
        print(f"skipped: Python lacks one of {', '.join(MODULES)}")
        sys.exit(SKIPPED)
    if python != sys.executable:
        os.execv(python, [python, *sys.argv])


if __name__ == "__main__":
    with_modules()
    in_own_network()
    sys.exit(main())
