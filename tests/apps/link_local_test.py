#!/usr/bin/env python3
"""Two real agents that reach each other by link-local IPv6 addresses with an interface, in a network namespace.

Usage: link_local_test.py PROGRAMS    PROGRAMS is the folder of moonctl and moondb_agent.
Exit codes: 0 passed, 1 failed, 77 skipped (no namespaces here).
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import time

SKIPPED = 77
LIMIT_S = 60


def run(*command, **options):
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, check=False, **options)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))} ended with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout


def has_address():
    """Waits until the kernel has checked that no other computer has the address."""
    return "tentative" not in run("ip", "-6", "address", "show", "dev", "lo")


def check(programs, folder):
    run("ip", "link", "set", "lo", "up")
    run("ip", "address", "add", "fe80::1/64", "dev", "lo")
    end = time.monotonic() + LIMIT_S
    while not has_address() and time.monotonic() < end:
        time.sleep(0.2)
    environment = dict(os.environ, MOONDB_RUN_DIR=f"{folder}/run", MOONDB_TEAM=f"{folder}/team/team.yaml")
    moonctl = lambda *words: run(programs / "moonctl", *words, env=environment)
    team = folder / "team/team.yaml"
    moonctl("config", "init", "--agents", "2", team)
    team.write_text(team.read_text(encoding="utf-8").replace("tcp://127.0.0.1:", "tcp://[fe80::1%lo]:"), encoding="utf-8")
    moonctl("config", "check", team)
    try:
        moonctl("up")
        moonctl("-a", "base", "record", "insert", "temperature", '{"celsius": 4}')
        moonctl("sync", "now", "--wait", "--timeout", f"{LIMIT_S}s")
        moonctl("doctor", "-a", "rover1")
        listed = moonctl("-a", "rover1", "record", "list", "temperature")
        if "base" not in listed:
            raise RuntimeError(f"rover1 has not received the record: {listed}")
    finally:
        subprocess.run([programs / "moonctl", "down"], env=environment, capture_output=True, timeout=LIMIT_S, check=False)


def main():
    programs = pathlib.Path(sys.argv[1]).resolve()
    if len(sys.argv) == 2:
        namespace = ["unshare", "--user", "--map-root-user", "--net"]
        if subprocess.run([*namespace, "true"], capture_output=True, check=False).returncode != 0:
            print("skipped: this user cannot make a network namespace")
            return SKIPPED
        return subprocess.run([*namespace, sys.executable, __file__, programs, "inside"], check=False).returncode
    with tempfile.TemporaryDirectory(prefix="moondb-link-") as folder:
        check(programs, pathlib.Path(folder))
    print("passed")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (RuntimeError, subprocess.TimeoutExpired) as failure:
        print(f"failed: {failure}")
        sys.exit(1)
