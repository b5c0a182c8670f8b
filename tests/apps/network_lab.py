"""Four real agents in four network namespaces, each with a 1 Mbit/s link: for tests and measurements of a whole team.

    with network_lab.lab(programs) as (team, network): ...

Processes and namespaces are removed afterwards, even after an error in the body or during set-up. If a run is killed,
the next run removes the killed run's namespaces and their processes.
"""
import contextlib
import json
import os
import pathlib
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time

NAMES = ["rover1", "rover2", "rover3", "base"]
RATE = "1mbit"
CAPACITY_BYTES_PER_S = 125_000
STEP_LIMIT_S = 60


class Failure(Exception):
    """An error described in one line."""


class Unsupported(Failure):
    """This machine cannot create the network."""


def run(*command, check=True):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=2 * STEP_LIMIT_S,
                          check=False)
    if check and done.returncode != 0:
        line = (done.stderr.strip() or done.stdout.strip() or "no output").splitlines()[-1]
        raise Failure(f"{' '.join(str(part) for part in command)}: {line} (exit {done.returncode})")
    return done


def address(agent):
    return f"10.77.0.{agent + 1}"


class Network:
    """The network: one namespace per agent, and one with the bridge that connects them."""

    def __init__(self):
        self.hub = f"moondb{os.getpid()}hub"
        self.spaces = [f"moondb{os.getpid()}n{i + 1}" for i in range(len(NAMES))]

    def make(self):
        for space in [self.hub, *self.spaces]:
            run("ip", "netns", "add", space)
            run("ip", "-n", space, "link", "set", "lo", "up")
        run("ip", "-n", self.hub, "link", "add", "br0", "type", "bridge")
        run("ip", "-n", self.hub, "link", "set", "br0", "up")
        for i, space in enumerate(self.spaces):
            port = f"p{i + 1}"
            run("ip", "-n", self.hub, "link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", space)
            run("ip", "-n", self.hub, "link", "set", port, "master", "br0", "up")
            run("ip", "-n", space, "addr", "add", f"{address(i)}/24", "dev", "eth0")
            run("ip", "-n", space, "link", "set", "eth0", "up")
            for where, device in ((self.hub, port), (space, "eth0")):
                run("tc", "-n", where, "qdisc", "add", "dev", device, "root", "tbf", "rate", RATE, "burst", "4kb",
                    "latency", "100ms")

    def set_link(self, agent, is_up):
        run("ip", "-n", self.hub, "link", "set", f"p{agent + 1}", "up" if is_up else "down")

    def bytes_to(self, agent):
        """Returns the bytes sent to that agent so far, with all headers except Ethernet's preamble and gap."""
        return self._counted(agent)["tx"]["bytes"]

    def bytes_from(self, agent):
        return self._counted(agent)["rx"]["bytes"]

    def _counted(self, agent):
        return json.loads(run("ip", "-n", self.hub, "-j", "-s", "link", "show", f"p{agent + 1}").stdout)[0]["stats64"]

    def remove(self):
        for space in [self.hub, *self.spaces]:
            remove_space(space)


def remove_space(space):
    """Removes a namespace. Kills its processes first, because they keep it alive."""
    for pid in run("ip", "netns", "pids", space, check=False).stdout.split():
        with contextlib.suppress(ProcessLookupError):
            os.kill(int(pid), signal.SIGKILL)
    run("ip", "netns", "del", space, check=False)


def remove_left_behind():
    """Removes namespaces of runs whose process has ended."""
    for line in run("ip", "netns", "list", check=False).stdout.splitlines():
        found = re.match(r"(moondb(\d+)(?:hub|n\d+))\b", line)
        if found and not pathlib.Path(f"/proc/{found.group(2)}").exists():
            remove_space(found.group(1))


class Team:
    def __init__(self, programs, folder, network, agent_program="moondb_agent"):
        self.environment = None  # Environment of the agents. None: this program's environment.
        self.programs, self.folder, self.network = pathlib.Path(programs), folder, network
        self.agent_program = self.programs / agent_program
        self.file = folder / "team.yaml"
        self.agents = {}
        run(self.programs / "moonctl", "config", "init", "--agents", len(NAMES), self.file)
        text = self.file.read_text(encoding="utf-8")
        # Turn off automatic solving. Otherwise the leader could store solved poses between a transfer and the
        # comparison of the stores.
        text = text.replace("solve_by_itself: true", "solve_by_itself: false")
        for i in range(len(NAMES)):
            text = text.replace(f"tcp://127.0.0.1:{7400 + i}", f"tcp://{address(i)}:7400")
        self.file.write_text(text, encoding="utf-8")

    def start(self, agent, *arguments):
        with open(self.log(agent), "a", encoding="utf-8") as log:
            self.agents[agent] = subprocess.Popen(
                ["ip", "netns", "exec", self.network.spaces[agent], str(self.agent_program), "-t", str(self.file), "-a",
                 NAMES[agent], "--data-dir", str(self.folder / NAMES[agent]), "--merge-backend", "cpu",
                 *(str(argument) for argument in arguments)], stdout=log, stderr=log, env=self.environment)
        self.until(lambda: self.moonctl("-a", NAMES[agent], "status", check=False).returncode == 0,
                   f"{NAMES[agent]} does not start")

    def until_joined(self):
        """Waits until each agent has reached every other one."""
        self.until(lambda: all(peer["is_connected"] for agent in self.status() for peer in agent["status"]["peers"]),
                   "the agents do not reach each other")

    def kill(self, agent):
        self.agents[agent].send_signal(signal.SIGKILL)
        self.agents.pop(agent).wait()

    def stop(self):
        for agent in self.agents.values():
            agent.terminate()
        for agent in self.agents.values():
            try:
                agent.wait(timeout=30)
            except subprocess.TimeoutExpired:
                agent.kill()
                agent.wait()
        self.agents.clear()

    def log(self, agent):
        return self.folder / f"{NAMES[agent]}.log"

    def last_words(self):
        """Returns the end of each agent's log, to find the cause of a failure."""
        text = ""
        for agent, name in enumerate(NAMES):
            if self.log(agent).exists():
                lines = self.log(agent).read_text(encoding="utf-8", errors="replace").splitlines()[-8:]
                text += "\n".join([f"--- {name}", *lines, ""])
        return text

    def moonctl(self, *arguments, check=True):
        return run(self.programs / "moonctl", "-t", self.file, *arguments, check=check)

    def status(self):
        """Returns the status of each agent as printed by moonctl status --json."""
        return json.loads(self.moonctl("--json", "status").stdout)["agents"]

    def feed(self, mission, *arguments):
        run(self.programs / "moondb_replay", "feed", "-t", self.file, "--mission", mission, *arguments)

    def share(self, kind):
        """Syncs or replicates everything. Retries if a change of roles or a lost link ended the command."""
        for tries_left in reversed(range(5)):
            done = self.moonctl("--timeout", f"{STEP_LIMIT_S}s", kind, "now", "--wait", check=tries_left == 0)
            if done.returncode == 0:
                return
            time.sleep(1)

    @staticmethod
    def until(condition, text, limit_s=STEP_LIMIT_S):
        end = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > end:
                raise Failure(text)
            time.sleep(0.2)

    def records(self, agent):
        """Returns {(origin, epoch, type, seq): hash} of shared records. Omits events, which appear at any time."""
        found = {}
        file = self.folder / NAMES[agent] / "moondb.sqlite"
        with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True)) as db:
            tables = [name for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
            for table in tables:
                columns = [row[1] for row in db.execute(f"PRAGMA table_info({table})")]
                if not {"origin", "seq", "hash"} <= set(columns) or table == "agent_event":
                    continue
                kind = "data_type" if "data_type" in columns else f"'{table}'"
                rows = db.execute(f"SELECT origin, epoch, {kind}, seq, hash FROM {table} WHERE seq IS NOT NULL")
                found.update({row[:4]: row[4] for row in rows})
        return found


@contextlib.contextmanager
def scratch_folder():
    with tempfile.TemporaryDirectory(prefix="moondb-net-") as folder:
        yield pathlib.Path(folder)


@contextlib.contextmanager
def lab(programs, agent_program="moondb_agent"):
    """Yields a team with agents not yet started, and its network. Raises Unsupported if the network cannot be made."""
    if os.geteuid() != 0 or not shutil.which("ip") or not shutil.which("tc"):
        raise Unsupported("needs root, ip and tc (package iproute2)")
    with contextlib.ExitStack() as stack:
        # Exit through an exception on SIGTERM, so that the clean-up below runs.
        before = signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
        stack.callback(signal.signal, signal.SIGTERM, before)
        remove_left_behind()
        folder = stack.enter_context(scratch_folder())
        os.environ["MOONDB_RUN_DIR"] = str(folder / "run")
        network = Network()
        stack.callback(network.remove)
        try:
            network.make()
        except Failure as failure:
            raise Unsupported(f"this machine makes no network namespaces at 1 Mbit/s: {failure}") from failure
        team = Team(programs, folder / "team", network, agent_program)
        stack.callback(team.stop)
        try:
            yield team, network
        except (Failure, subprocess.TimeoutExpired):
            print(team.last_words(), file=sys.stderr)
            raise
