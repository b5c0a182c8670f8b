"""A real team on loopback for attackers: four agents, their keys, what each takes in memory and log.

    with hostile_team(programs) as team:
        connection = team.connect("rover1", as_agent="rover3")
"""
import contextlib
import json
import os
import pathlib
import re
import resource
import signal
import subprocess
import tempfile
import time

import zmtp

NAMES = ["rover1", "rover2", "rover3", "base"]
FIRST_PORT = 7400
CLIENT_PORT = 7500  # Of rover1.
STEP_LIMIT_S = 60


class Failure(Exception):
    """One line that says what went wrong."""


def with_usual_limits():
    """Programs begin with the open files that most systems allow; an attacker has more."""
    resource.setrlimit(resource.RLIMIT_NOFILE, (1024, HARD_FILES))


HARD_FILES = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
resource.setrlimit(resource.RLIMIT_NOFILE, (HARD_FILES, HARD_FILES))


class Team:
    def __init__(self, programs, folder):
        self.programs, self.folder = programs, folder
        self.environment = {**os.environ, "MOONDB_TEAM": str(folder / "team.yaml"),
                            "MOONDB_RUN_DIR": str(folder / "run")}

    def moonctl(self, *words, check=True):
        done = subprocess.run([self.programs / "moonctl", *words], env=self.environment, cwd=self.folder,
                              capture_output=True, text=True, timeout=STEP_LIMIT_S, check=False,
                              preexec_fn=with_usual_limits)
        if check and done.returncode != 0:
            raise Failure(f"moonctl {' '.join(words)}: exit {done.returncode}: {done.stderr.strip()[-300:]}")
        return done

    def make(self):
        self.moonctl("config", "init", "--agents", "4", "--first-port", str(FIRST_PORT), "team.yaml")
        path = self.folder / "team.yaml"
        text = path.read_text()
        own = f'address: "tcp://127.0.0.1:{FIRST_PORT}"\n'
        if own not in text:
            raise Failure("the team file is not as this test knows it")
        path.write_text(text.replace(own, own + f'    client_address: "tcp://127.0.0.1:{CLIENT_PORT}"\n', 1))
        self.moonctl("clients", "add", "watcher", "--rights", "view", "--out", "watcher.sec")
        self.moonctl("up", "--merge-backend", "cpu")

    def down(self):
        self.moonctl("down", check=False)
        for agent in NAMES:  # One that an attacker stopped or froze.
            with contextlib.suppress(OSError, ValueError, Failure):
                os.kill(self.pid(agent), signal.SIGKILL)

    def restart(self, agent):
        """A new process: what an attacker made of the one before does not count for the next."""
        self.moonctl("-a", agent, "down", check=False)
        self.moonctl("-a", agent, "up", "--merge-backend", "cpu")

    def pid(self, agent):
        return int((self.folder / "moondb-data" / agent / "agent.pid").read_text().split()[0])

    def is_alive(self, agent):
        try:
            return "moondb_agent" in pathlib.Path(f"/proc/{self.pid(agent)}/cmdline").read_text()
        except (OSError, ValueError):
            return False

    def rss_mb(self, agent, peak=False):
        text = pathlib.Path(f"/proc/{self.pid(agent)}/status").read_text()
        return int(re.search(r"VmHWM:\s+(\d+)" if peak else r"VmRSS:\s+(\d+)", text)[1]) / 1024

    def forget_peak(self, agent):
        pathlib.Path(f"/proc/{self.pid(agent)}/clear_refs").write_text("5")

    def log_bytes(self, agent):
        return (self.folder / "moondb-data" / agent / "agent.log").stat().st_size

    def connects(self, agent, peer):
        """How often the agent's link to this peer came up since the agent started."""
        status = json.loads(self.moonctl("-a", agent, "status", "--json").stdout)
        shown = next(shown for shown in status["agents"] if shown["name"] == agent)["status"]
        return next(int(link["connects"]) for link in shown["peers"] if link["name"] == peer)

    def answers(self, agent):
        """How long the agent takes to say its status over ipc, in seconds."""
        begin = time.monotonic()
        self.moonctl("-a", agent, "status")
        return time.monotonic() - begin

    # --- Who may come in ---

    def address(self, agent):
        return ("127.0.0.1", FIRST_PORT + NAMES.index(agent))

    def keys(self, name):
        return tuple(zmtp.from_z85((self.folder / f"{name}.{kind}").read_text().split()[0]) for kind in ("pub", "sec"))

    def connect(self, agent, as_agent, routing_id=None):
        """As a member, with its true key."""
        number = str(NAMES.index(as_agent) + 1).encode() if routing_id is None else routing_id
        return zmtp.connect(self.address(agent), self.keys(agent)[0], self.keys(as_agent), number)

    def connect_client(self, key_name):
        """To rover1's client_address."""
        secret = zmtp.from_z85((self.folder / f"{key_name}.sec").read_text().split()[0])
        return zmtp.connect(("127.0.0.1", CLIENT_PORT), self.keys("rover1")[0], (zmtp.public_of(secret), secret))


@contextlib.contextmanager
def hostile_team(programs):
    with tempfile.TemporaryDirectory(prefix="moondb-hostile-") as name:
        team = Team(programs, pathlib.Path(name))
        try:
            team.make()
            yield team
        finally:
            team.down()
