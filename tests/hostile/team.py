"""A real team on loopback for attackers: four agents, their keys, what each takes in memory, log and disk, what it holds.

    with hostile_team(programs) as team:
        connection = team.connect("rover1", as_agent="rover3")

rover1 leads, rover2 survives; both have records that an attacker could destroy. rover3 is the member that attackers take
over: while one speaks in its place (member.py) the real one rests.
"""
import contextlib
import json
import os
import pathlib
import re
import resource
import shutil
import signal
import sqlite3
import struct
import subprocess
import sys
import tempfile
import time

import messages
import nacl.signing
import zmq
import zmtp
from moondb import AgentError, Client  # noqa: F401


NAMES = ["rover1", "rover2", "rover3", "base"]
HONEST = ["rover1", "rover2", "base"]
TAKEN = "rover3"
FIRST_PORT = 7400
CLIENT_PORT = 7500  # Port of rover1's client_address.
STEP_LIMIT_S = 60
NODES = 10  # Number of nodes of each rover before the first attack.
KEPT_TABLES = ["pose_graph_node", "pose_graph_edge", "local_traversability_map", "map_quarantine", "agent_event"]


class Failure(Exception):
    """An error described in one line."""


def with_usual_limits(files_max=None):
    """Sets the limit on open files that most systems have, for programs about to start. An attacker has a higher
    limit. With `files_max`, the programs cannot raise the limit beyond it."""
    resource.setrlimit(resource.RLIMIT_NOFILE, (1024, files_max or HARD_FILES))


HARD_FILES = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
resource.setrlimit(resource.RLIMIT_NOFILE, (HARD_FILES, HARD_FILES))


class Team:
    def __init__(self, programs, folder):
        self.programs, self.folder = programs, folder
        self.is_taken = False  # True if an attacker has taken the place of rover3.
        self.last_node, self.fresh_rss_mb = NODES, 0
        self.environment = {**os.environ, "MOONDB_TEAM": str(folder / "team.yaml"),
                            "MOONDB_RUN_DIR": str(folder / "run")}

    def moonctl(self, *words, check=True, files_max=None):
        done = subprocess.run([self.programs / "moonctl", *words], env=self.environment, cwd=self.folder,
                              capture_output=True, text=True, timeout=STEP_LIMIT_S, check=False,
                              preexec_fn=lambda: with_usual_limits(files_max))
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
        for y in range(3):  # The rovers start side by side.
            text = text.replace("# start: {x: 0, y: 0,", f"start: {{x: 0, y: {2 * y},", 1)
        path.write_text(text.replace(own, own + f'    client_address: "tcp://127.0.0.1:{CLIENT_PORT}"\n', 1))
        for name, rights in (("watcher", "view"), ("sharer", "share")):
            self.moonctl("clients", "add", name, "--rights", rights, "--out", f"{name}.sec")
        self.moonctl("up", "--merge-backend", "cpu")
        self.is_taken = False
        self.fresh_rss_mb = self.rss_mb("rover1")  # Memory of the agent before it has received any request.
        for agent in ("rover1", "rover2", "rover3"):
            number = NAMES.index(agent) + 1
            self.insert(agent, [*(messages.node(number, i, x=i) for i in range(1, NODES + 1)),
                                *(messages.edge(number, i) for i in range(1, NODES)),
                                messages.map_at(number, 1), messages.map_at(number, NODES)])
        self.settle()
        self.moonctl("sync", "now", "--wait", "--timeout", "30s")
        self.moonctl("replicate", "now", "--wait", "--timeout", "30s")

    def rebuild(self):
        """Replaces a team that an attacker broke by a fresh one."""
        was_taken = self.is_taken
        self.down()
        for path in self.folder.iterdir():
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
        self.make()
        if was_taken:
            self.take_over()

    def down(self):
        self.moonctl("down", check=False)
        for agent in NAMES:  # An attacker may have stopped or frozen an agent, so kill those that still run.
            with contextlib.suppress(OSError, ValueError, Failure):
                os.kill(self.pid(agent), signal.SIGKILL)

    def restart(self, agent, files_max=None):
        """Restarts the agent, so that an attacker's effect on its process does not count for the next attacker. With
        `files_max`, the agent may open that many files."""
        self.moonctl("-a", agent, "down", check=False)
        self.moonctl("-a", agent, "up", "--merge-backend", "cpu", files_max=files_max)

    def take_over(self):
        """Stops rover3, so an attacker can take its place."""
        if not self.is_taken:
            self.moonctl("-a", TAKEN, "down")
            self.is_taken = True

    def give_back(self):
        if self.is_taken:
            self.moonctl("-a", TAKEN, "up", "--merge-backend", "cpu")
            self.is_taken = False

    # --- What the honest agents do ---

    def call(self, agent, **request):
        """Sends a request as the agent's own user, who has all rights. Returns the ControlReply."""
        endpoint = (self.data_folder(agent) / "agent.endpoint").read_text().strip()
        client = Client(endpoint, self.team_id.hex(), timeout_s=STEP_LIMIT_S)
        try:
            return client.call(messages.control.ControlRequest(**request))
        except (AgentError, TimeoutError) as error:
            raise Failure(f"{agent}: {error}") from error
        finally:
            client.close()

    def insert(self, agent, records):
        return self.call(agent, insert={"records": records}).insert.keys

    def insert_node(self, agent):
        """Inserts a node that the agent never had. Returns its record key."""
        self.last_node += 1
        return self.insert(agent, [messages.node(NAMES.index(agent) + 1, self.last_node, x=self.last_node % 50)])[0]

    def share(self, limit_s=STEP_LIMIT_S):
        """Inserts a node each at rover2 and at the leader, and shares until leader and survivor have both. Returns
        the duration in seconds. Raises Failure after limit_s."""
        awaited = {"rover1": ("rover2", self.insert_node("rover2")), "rover2": ("rover1", self.insert_node("rover1"))}
        begin = time.monotonic()
        self.call("rover2", share={"kind": "SHARING_KIND_SYNC"})
        self.call("rover1", share={"kind": "SHARING_KIND_REPLICATION"})
        while True:
            awaited = {agent: (origin, key) for agent, (origin, key) in awaited.items()
                       if self.node_hash(agent, key) != self.node_hash(origin, key)}
            if not awaited:
                return time.monotonic() - begin
            if time.monotonic() - begin > limit_s:
                raise Failure(f"what was inserted did not come to {', '.join(awaited)} within {limit_s} s")
            time.sleep(0.02)

    def settle(self):
        """Repeats share() until it succeeds: after a start, links must come up and the leader takes a new term.
        Returns the duration in seconds of the successful share()."""
        end = time.monotonic() + STEP_LIMIT_S
        while True:
            try:
                return self.share(5)
            except Failure:
                if time.monotonic() > end:
                    raise
                time.sleep(0.2)

    def prune_everything(self, agent):
        """Requests a prune of all records, as the agent's operator would. The agent may refuse."""
        self.moonctl("-a", agent, "db", "prune", *(word for table in KEPT_TABLES for word in ("--type", table)),
                     check=False)

    def status(self, agent):
        """Returns the AgentStatus of an agent."""
        return self.call(agent, status={}).status

    # --- What an agent holds ---

    def data_folder(self, agent):
        return self.folder / "moondb-data" / agent

    def store(self, agent):
        """Opens the agent's database file for reading."""
        return contextlib.closing(sqlite3.connect(f"file:{self.data_folder(agent)}/moondb.sqlite?mode=ro", uri=True))

    def records(self, agent):
        """Returns the records under the policy `all` in the agent's file: {(table, origin, epoch, seq): hash}."""
        held = {}
        with self.store(agent) as store:
            for table in KEPT_TABLES:
                rows = store.execute(f"SELECT origin, epoch, seq, hash FROM {table} WHERE seq IS NOT NULL")
                held.update({(table, origin, epoch & (1 << 64) - 1, seq): digest for origin, epoch, seq, digest in rows})
        return held

    def records_of(self, agent, table):
        """Returns the number of records of that agent's own in a table of its file."""
        with self.store(agent) as store:
            return store.execute(f"SELECT count(*) FROM {table} WHERE origin = ?",
                                 (NAMES.index(agent) + 1,)).fetchone()[0]

    def node_hash(self, agent, key):
        """Returns the record of a pose-graph node; None if the agent does not hold it."""
        with self.store(agent) as store:
            epoch = struct.unpack("<q", struct.pack("<Q", key.epoch))[0]
            row = store.execute("SELECT hash FROM pose_graph_node WHERE origin = ? AND epoch = ? AND seq = ?",
                                (key.origin_agent, epoch, key.seq)).fetchone()
            return row and row[0]

    def disk_bytes(self, agent):
        return sum(path.stat().st_size for path in self.data_folder(agent).glob("moondb.sqlite*"))

    @property
    def team_id(self):
        return bytes.fromhex(re.search(r'^team_id: "([0-9a-f]{32})"', (self.folder / "team.yaml").read_text(), re.M)[1])

    def pid(self, agent):
        return int((self.data_folder(agent) / "agent.pid").read_text().split()[0])

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
        return (self.data_folder(agent) / "agent.log").stat().st_size

    def log_end(self, agent, lines=20):
        return (self.data_folder(agent) / "agent.log").read_text(errors="replace").splitlines()[-lines:]

    def connects(self, agent, peer):
        """Returns how often the agent's link to this peer has come up since the agent started."""
        status = json.loads(self.moonctl("-a", agent, "status", "--json").stdout)
        shown = next(shown for shown in status["agents"] if shown["name"] == agent)["status"]
        return next(int(link["connects"]) for link in shown["peers"] if link["name"] == peer)

    def answers(self, agent):
        """Returns the time in seconds until the agent answers a status request over ipc."""
        begin = time.monotonic()
        self.moonctl("-a", agent, "status")
        return time.monotonic() - begin

    # --- Keys and connections ---

    def address(self, agent):
        return ("127.0.0.1", FIRST_PORT + NAMES.index(agent))

    def z85_keys(self, name):
        """Returns (public, secret) keys of an agent."""
        return tuple((self.folder / f"{name}.{kind}").read_text().split()[0].encode() for kind in ("pub", "sec"))

    def keys(self, name):
        return tuple(zmtp.from_z85(key.decode()) for key in self.z85_keys(name))

    def sign(self, agent, roles):
        """Signs `roles` with that agent's key, as in runtime/team/role_signature.h."""
        seed = zmtp.from_z85((self.folder / f"{agent}.sign").read_text().split()[0])
        roles.ClearField("signature")
        signed = b"moondb roles 1" + self.team_id.hex().encode() + roles.SerializeToString()
        roles.signature = nacl.signing.SigningKey(seed).sign(signed).signature

    def client_keys(self, key_name):
        """Returns (public, secret) keys of a listed client."""
        secret = (self.folder / f"{key_name}.sec").read_text().split()[0].encode()
        return zmq.curve_public(secret), secret

    def connect(self, agent, as_agent, routing_id=None):
        """Connects as a member with its true key."""
        number = str(NAMES.index(as_agent) + 1).encode() if routing_id is None else routing_id
        return zmtp.connect(self.address(agent), self.keys(agent)[0], self.keys(as_agent), number)

    def connect_client(self, key_name, routing_id=b"", timeout_s=zmtp.TIMEOUT_S):
        """Connects to rover1's client_address."""
        _, secret = (zmtp.from_z85(key.decode()) for key in self.client_keys(key_name))
        return zmtp.connect(("127.0.0.1", CLIENT_PORT), self.keys("rover1")[0], (zmtp.public_of(secret), secret), routing_id,
                            timeout_s)


@contextlib.contextmanager
def hostile_team(programs):
    with tempfile.TemporaryDirectory(prefix="moondb-hostile-") as name:
        team = Team(programs, pathlib.Path(name))
        try:
            team.make()
            yield team
        finally:
            team.down()
