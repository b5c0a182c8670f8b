#!/usr/bin/env python3
"""Plants faults in a robot and its team, and checks that `moonctl doctor` finds each of them, and nothing without one.

Usage: doctor_test.py PROGRAMS    the folder of moonctl and moondb_agent. Runs in a network of its own.
Exit codes: 0 passed, 1 failed, 77 skipped (this machine makes no network; it says so).
"""
import contextlib
import json
import os
import pathlib
import signal
import socket
import subprocess
import sys
import tempfile
import time

from snippets_test import in_own_network

SKIPPED = 77
NAMES = ["rover1", "rover2", "base"]
OF_ALL_PEERS = ["the disk is too full", "a peer's name is unknown", "the radio loses packets"]


class Failure(Exception):
    """An error described in one line."""


class Team:
    """Three agents, each in a folder of its own, as on three robots."""

    def __init__(self, programs, folder):
        self.programs, self.folder = programs, folder
        self.agents = {}
        self.moonctl("config", "init", "--agents", len(NAMES), folder / "ops/team.yaml")
        for name in NAMES:
            self.moonctl("-t", folder / "ops/team.yaml", "config", "pack", name, folder / f"{name}.pack")
            self.moonctl("config", "unpack", folder / f"{name}.pack", folder / name)

    def moonctl(self, *arguments, expected=(0,)):
        command = [self.programs / "moonctl", *arguments]
        done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=120, check=False)
        if done.returncode not in expected:
            raise Failure(f"{' '.join(map(str, command))} ended with {done.returncode}: {done.stdout}{done.stderr}")
        return done.stdout

    def start(self, name):
        file = self.folder / f"{name}.log"
        with open(file, "w", encoding="utf-8") as log:
            self.agents[name] = subprocess.Popen([self.programs / "moondb_agent", "-t", self.folder / name / "team.yaml",
                                                  "-a", name], stdout=log, stderr=log)
        for _ in range(600):
            if "ready:" in file.read_text(encoding="utf-8"):
                return
            time.sleep(0.1)
        raise Failure(f"{name} does not start: {file.read_text(encoding='utf-8')}")

    def stop(self, name):
        agent = self.agents.pop(name)
        agent.send_signal(signal.SIGCONT)
        agent.terminate()
        agent.wait(timeout=30)

    def stop_all(self):
        for name in list(self.agents):
            self.stop(name)

    def doctor(self, *arguments, prefix=()):
        """Returns {check: result} of rover1's doctor; of several results of a check the worst."""
        command = [*prefix, self.programs / "moonctl", "--json", "-t", self.folder / "rover1/team.yaml", "-a", "rover1",
                   "doctor", *arguments]
        done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=120, check=False)
        if done.returncode not in (0, 1):
            raise Failure(f"doctor ended with {done.returncode}: {done.stdout}{done.stderr}")
        answer = json.loads(done.stdout)
        if (answer["fault_count"] > 0) != (done.returncode == 1):
            raise Failure(f"doctor ended with {done.returncode} for {answer['fault_count']} faults")
        results = {}
        for check in answer["checks"]:
            if check["result"] in ("FAULT", "advice") and not check["remedy"]:
                raise Failure(f"doctor does not say what to do: {check}")
            results[check["check"]] = max(results.get(check["check"], ""), check["result"], key=["", "unknown", "good",
                                                                                                 "advice", "FAULT"].index)
        return results


@contextlib.contextmanager
def kept(*files):
    """Puts the files back as they were."""
    before = [(file, file.read_bytes(), file.stat().st_mode) for file in files]
    yield
    for file, content, mode in before:
        file.write_bytes(content)
        file.chmod(mode)


@contextlib.contextmanager
def changed(team, name, what, text):
    """Replaces `what` in an agent's team file."""
    file = team.folder / name / "team.yaml"
    yaml = file.read_text(encoding="utf-8")
    if what not in yaml:
        raise Failure(f"{file} does not contain {what}")
    with kept(file):
        file.write_text(yaml.replace(what, text, 1), encoding="utf-8")
        yield


def plant_all(team):
    """Yields (fault, check, least result, results) of each planted fault."""
    robot = team.folder / "rover1"
    secret, signing = robot / "rover1.sec", robot / "rover1.sign"
    for fault, plant in (
            ("the secret key is missing", secret.unlink),
            ("others may read the secret key", lambda: secret.chmod(0o644)),
            ("the secret key is another agent's", lambda: secret.write_bytes((team.folder / "base/base.sec").read_bytes()))):
        with kept(secret):
            plant()
            yield fault, "keys", "FAULT", team.doctor()
    with kept(signing):
        signing.unlink()
        yield "the signing key is missing", "keys", "FAULT", team.doctor()
    (robot / "file").write_text("", encoding="utf-8")
    yield "the data folder cannot be made", "data", "FAULT", team.doctor("--data-dir", robot / "file/data")
    yield ("the data folder is another agent's", "data", "FAULT",
           team.doctor("--data-dir", team.folder / "base/moondb-data/base"))
    if os.path.ismount("/dev/shm"):
        with tempfile.TemporaryDirectory(dir="/dev/shm") as memory:
            yield "the data folder is in memory", "data", "FAULT", team.doctor("--data-dir", memory)
    with changed(team, "rover1", "map: {", "retention: {disk_free_mb_min: 1e9}\nmap: {"):
        yield "the disk is too full", "disk", "FAULT", team.doctor()
    yield ("the agent may open too few files", "limits", "FAULT",
           team.doctor(prefix=["prlimit", "--nofile=1024:1024"]))
    with changed(team, "rover1", "127.0.0.1:7402", "base.invalid:7402"):
        yield "a peer's name is unknown", "to base", "FAULT", team.doctor()
    subprocess.run(["ip", "link", "set", "lo", "mtu", "1000"], check=True)
    yield "the radio carries small packets only", "to rover2", "advice", team.doctor()
    subprocess.run(["ip", "link", "set", "lo", "mtu", "65536"], check=True)
    netem = ["tc", "qdisc", "add", "dev", "lo", "root", "netem", "loss", "70%"]
    if subprocess.run(netem, capture_output=True, check=False).returncode == 0:
        yield "the radio loses packets", "to rover2", "FAULT", team.doctor()
        subprocess.run(["tc", "qdisc", "del", "dev", "lo", "root"], check=True)
    else:
        print("left out: the kernel has no netem to lose packets with")
    with changed(team, "rover2", "budget_kbps: 1000", "budget_kbps: 900"):
        team.stop("rover2")
        team.start("rover2")
        time.sleep(1)
        yield "a peer's team file differs", "to rover2", "FAULT", team.doctor()
    team.stop("rover2")
    team.start("rover2")
    team.stop("base")
    yield "a peer is off", "to base", "FAULT", team.doctor()
    team.start("base")
    team.agents["rover1"].send_signal(signal.SIGSTOP)
    yield "the agent hangs", "agent", "FAULT", team.doctor()
    team.stop("rover1")
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", 7400))
        other.listen()
        yield "another program has the port", "address", "FAULT", team.doctor()
    with changed(team, "rover1", "127.0.0.1:7400", "10.99.99.1:7400"):
        yield "the address is another computer's", "address", "FAULT", team.doctor()


def main():
    if len(sys.argv) != 2:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    programs = pathlib.Path(sys.argv[1]).resolve()
    in_own_network()
    if not os.environ.get("MOONDB_OWN_NETWORK"):
        print("skipped: needs a network of its own (root, unshare, iproute2)")
        return SKIPPED
    with tempfile.TemporaryDirectory(prefix="moondb-doctor-", dir="/var/tmp") as folder:
        os.environ["MOONDB_RUN_DIR"] = f"{folder}/run"
        team = Team(programs, pathlib.Path(folder))
        try:
            for name in NAMES:
                team.start(name)
            time.sleep(1)
            if "FAULT" in team.doctor().values():
                raise Failure(f"doctor finds a fault without any: {team.doctor()}")
            count = 0
            for fault, check, least, results in plant_all(team):
                count += 1
                found = results.get(check)
                if found not in (least, "FAULT"):
                    raise Failure(f"{fault}: doctor says '{found}' of '{check}': {results}")
                others = {name for name, result in results.items() if result == "FAULT" and name != check}
                # The agent runs in its own data folder, and has the port.
                others -= {"address"} if fault.startswith("the data folder") else set()
                # The others have the team file as it was, and losses stop every connection.
                others -= {"to rover2", "to base"} if fault in OF_ALL_PEERS else set()
                if others:
                    raise Failure(f"{fault}: doctor finds faults of {others} too: {results}")
            print(f"{count} faults planted, {count} found")
        except Failure as failure:
            print(f"failed: {failure}")
            return 1
        finally:
            team.stop_all()
    return 0


if __name__ == "__main__":
    sys.exit(main())
