"""Attackers with files: they can write files that an agent or another program of moondb reads."""
import contextlib
import os
import pathlib
import random
import shutil
import signal
import sqlite3
import struct
import subprocess
import sys
import tempfile
import threading
import time
import zlib

import messages
from team import NAMES, Failure

READ_LIMIT_S = 10
READ_MB_MAX = 256
# Starts a program and prints its exit code and its peak memory in kB. The kernel counts the memory of the parent
# process as the program's own, so this parent is small.
MEASURED = """
import os, subprocess, sys
process = subprocess.Popen(sys.argv[1:], stdout=sys.stderr)
_, status, used = os.wait4(process.pid, 0)
print(os.waitstatus_to_exitcode(status), used.ru_maxrss)
"""
VICTIM_TEXT = "what was here before"


@contextlib.contextmanager
def stopped(team, agent="rover1"):
    team.moonctl("-a", agent, "down")
    try:
        yield team.data_folder(agent)
    finally:
        team.moonctl("-a", agent, "up", "--merge-backend", "cpu", check=False)
        if not team.is_alive(agent):
            raise Failure(f"{agent} does not start any more: {team.log_end(agent, 2)}")
        team.settle()


def refuses_to_start(team, agent, why):
    """Tries to start the agent. Raises Failure if it starts in spite of the attack."""
    done = team.moonctl("-a", agent, "up", "--merge-backend", "cpu", check=False)
    if done.returncode == 0 and team.is_alive(agent):
        team.moonctl("-a", agent, "down")
        raise Failure(f"{agent} starts with {why}")


def files_that_others_may_write(team, scale):
    """Another user of the machine may write the team file, its folder, the clients' list, a public key or the data folder."""
    with stopped(team) as data:
        for path in (team.folder, team.folder / "team.yaml", team.folder / "rover3.pub", team.folder / "rover1.sec",
                     team.folder / "rover1.sign"):
            mode = path.stat().st_mode
            path.chmod(mode | 0o022)
            try:
                refuses_to_start(team, "rover1", f"{path.name} that other users may write")
            finally:
                path.chmod(mode)
        data.chmod(0o777)
    if data.stat().st_mode & 0o077:
        raise Failure("rover1 leaves its data folder to other users")


def links_in_the_data_folder(team, scale):
    """An attacker left links in the data folder, to files that do not belong to the agent."""
    victim = team.folder / "victim"
    victim.write_text(VICTIM_TEXT)
    names = ("trace.txt", "agent.pid", "agent.endpoint", "agent.log", "moondb.reserve")
    kept = {}
    try:
        with stopped(team) as data:
            for name in names:
                path = data / name
                kept[path] = path.read_bytes() if path.is_file() and name == "agent.log" else None
                path.unlink(missing_ok=True)
                path.symlink_to(victim)
            team.moonctl("-a", "rover1", "up", "--merge-backend", "cpu", check=False)
            with contextlib.suppress(OSError, ValueError):
                os.kill(team.pid("rover1"), 6)
            time.sleep(0.5)
            if victim.read_text() != VICTIM_TEXT:
                raise Failure("rover1 wrote through a link into a file that is not its own")
            for path in kept:
                if path.is_symlink():
                    path.unlink()
    finally:
        victim.unlink()


HOSTILE_SQL = {
    "a trigger that empties the maps": """
        CREATE TRIGGER hostile AFTER INSERT ON pose_graph_node BEGIN DELETE FROM local_traversability_map; END""",
    "a trigger that never ends": """
        CREATE TRIGGER hostile AFTER INSERT ON pose_graph_node BEGIN
          INSERT INTO agent_event SELECT * FROM agent_event WHERE row_id IN (
            WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT x FROM c); END""",
    "a view in a table's place": """
        ALTER TABLE temperature RENAME TO hidden;
        CREATE VIEW temperature AS SELECT * FROM hidden WHERE (
          WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT max(x) FROM c) > 0""",
    "an index on an expression that loads a library": """
        CREATE TABLE own(x); CREATE TRIGGER hostile AFTER INSERT ON pose_graph_node BEGIN
          INSERT INTO own VALUES(load_extension('/tmp/hostile.so')); END""",
}


def hostile_stores(team, scale):
    """An attacker left triggers and views in rover1's store, which empty tables or never end."""
    store = team.data_folder("rover1") / "moondb.sqlite"
    copy = team.folder / "store.before"
    team.moonctl("-a", "rover1", "down")
    shutil.copy(store, copy)
    maps = 0
    try:
        for what, sql in HOSTILE_SQL.items():
            shutil.copy(copy, store)
            with contextlib.closing(sqlite3.connect(store)) as written:
                maps = written.execute("SELECT count(*) FROM local_traversability_map").fetchone()[0]
                written.executescript(sql)
            if team.moonctl("-a", "rover1", "up", "--merge-backend", "cpu", check=False).returncode != 0:
                continue  # An agent may refuse to start with such a store.
            begin = time.monotonic()
            with contextlib.suppress(Failure):
                team.insert_node("rover1")
            if time.monotonic() - begin > READ_LIMIT_S:
                raise Failure(f"rover1 hangs with {what}")
            is_set_aside = any(store.parent.glob("moondb.sqlite.*damaged*"))
            with team.store("rover1") as read:
                if not is_set_aside and read.execute("SELECT count(*) FROM local_traversability_map").fetchone()[0] < maps:
                    raise Failure(f"rover1 ran {what}")
            team.moonctl("-a", "rover1", "down", check=False)
    finally:
        team.moonctl("-a", "rover1", "down", check=False)
        for path in store.parent.glob("moondb.sqlite*"):
            path.unlink()  # Also removes damaged stores that the agent has renamed.
        shutil.copy(copy, store)
        copy.unlink()
        team.moonctl("-a", "rover1", "up", "--merge-backend", "cpu")
        team.settle()


def expect_refused(team, what, program, *words):
    """Runs a program that reads the file. Checks that it soon exits with a regular error and uses little memory."""
    process = subprocess.Popen([sys.executable, "-c", MEASURED, str(team.programs / program), *map(str, words)],
                               env=team.environment, cwd=team.folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                               stderr=subprocess.DEVNULL, text=True, start_new_session=True)
    try:
        code, kilobytes = map(int, process.communicate(timeout=READ_LIMIT_S)[0].split())
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        raise Failure(f"{program} did not end within {READ_LIMIT_S} s: {what}") from None
    if code <= 0:
        raise Failure(f"{program} ended with {code}: {what}")
    if kilobytes / 1024 > READ_MB_MAX:
        raise Failure(f"{program} took {kilobytes / 1024:.0f} MB: {what}")


def png(width, height, data):
    """Returns a gray picture whose header claims this size."""
    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))


class Mission:
    """A mission folder that is valid except for one file from an attacker."""

    def __init__(self, folder):
        self.folder = folder
        (folder / "maps").mkdir(parents=True)
        head = ("agent_id,name,kind,key,start_x_m,start_y_m,start_z_m,start_yaw_rad,start_sigma_m,start_sigma_rad,"
                "antenna_x_m,antenna_y_m,antenna_z_m")
        rows = [f"{number},{name},{'base_station' if name == 'base' else 'rover'},{'abcd'[number - 1]},0,0,0,0,0.1,0.1,0,0,1"
                for number, name in enumerate(NAMES, 1)]
        self.write("agents.csv", "\n".join([head, *rows, ""]).encode())
        covariance = " ".join("1e-4" if i in (0, 6, 11, 15, 18, 20) else "0" for i in range(21))
        self.write("graph.pyfg", f"EDGE_SE3:QUAT 1 a0 a1 1 0 0 0 0 0 1 {covariance}\n".encode())
        self.write("maps.csv", b"map_id,agent_id,stamp_s,node,node_from_map_x_m,node_from_map_y_m,node_from_map_yaw_rad,"
                   b"layers,cells_per_side,finest_resolution_m,file\n1,1,1,0,0,0,0,1,40,0.05,maps/1.png\n")
        self.write("maps/1.png", png(40, 40, (b"\0" + b"\xfe" * 40) * 40))

    def write(self, name, data):
        path = self.folder / name
        path.unlink(missing_ok=True)
        path.write_bytes(data)

    def replace(self, name, make):
        """Replaces the file `name` by the object that `make` creates."""
        path = self.folder / name
        path.unlink(missing_ok=True)
        make(path)


def sparse(megabytes):
    """Returns a maker of a sparse file with this many zeros."""
    def make(path):
        with open(path, "wb") as file:
            file.truncate(megabytes << 20)
    return make


def written(data):
    return lambda path: path.write_bytes(data)


NO_FILES = {
    "a fifo": os.mkfifo,
    "a folder": lambda path: path.mkdir(),
    "a link to /dev/zero": lambda path: path.symlink_to("/dev/zero"),
    "a link to itself": lambda path: path.symlink_to(path.name),
    "a link to a file elsewhere": lambda path: path.symlink_to("/etc/passwd"),
    "one line of 30 MB": written(b"1," * (15 << 20)),
    "what is not a number": written(b"EDGE_SE3:QUAT nan a99999999999999999999 a1 nan\n1,1,nan,0,inf,0,0,1,40,0,maps/1.png\n"),
}
PICTURES = {
    "a picture of 60,000 by 60,000": written(png(60_000, 60_000, bytes(1000))),
    "a picture that becomes 300 MB": written(png(40, 40, bytes(300 << 20))),
    "a picture that ends early": written(png(40, 40, b"")[:60]),
}


def hostile_missions(team, scale):
    """A mission folder holds a fifo, a device, a link, hundreds of megabytes or a huge picture where a file should be."""
    with tempfile.TemporaryDirectory(prefix="moondb-hostile-mission-") as name:
        cases = [(file, what, make) for file in ("agents.csv", "graph.pyfg", "maps.csv", "maps/1.png")
                 for what, make in (NO_FILES | (PICTURES if file.endswith("png") else {})).items()]
        for i, (file, what, make) in enumerate(cases):
            mission = Mission(pathlib.Path(name) / str(i))
            mission.replace(file, make)
            expect_refused(team, f"{file} is {what}", "moondb_replay", "feed", "--mission", mission.folder)
            shutil.rmtree(mission.folder)


def yaml_files():
    """Returns invalid replacements for a team file."""
    levels = [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" if i else "a0: &a0 [x, x, x, x, x]" for i in range(12)]
    return NO_FILES | {
        "aliases of aliases": written("\n".join(levels).encode()),
        "lists 200,000 deep": written(b"[" * 200_000),
        "maps 200,000 deep": written(b"{a: " * 200_000),
        "40 MB of agents": written(b"agents:\n" + b"  - {id: 1, name: a}\n" * (2 << 20)),
        "bytes of no text": written(bytes(range(256)) * 100),
        "a name with escapes": written(b'team: "\\x1b[2J"\nagents: []\n'),
    }


def hostile_yaml(team, scale):
    """A team file, and the clients' list beside it, are a fifo, a device, lists without an end or megabytes of them."""
    with tempfile.TemporaryDirectory(prefix="moondb-hostile-yaml-") as name:
        path = pathlib.Path(name) / "team.yaml"
        for what, make in yaml_files().items():
            make(path)
            expect_refused(team, f"the team file is {what}", "moonctl", "-t", path, "config", "check")
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def hostile_bundles(team, scale):
    """A bundle, a graph or a record's body that somebody sent is a fifo, a device, or says that it is larger than it is."""
    body = b"\xff" * 1000
    bundles = {
        "a head alone": written(b"moondb bundle 1\n"),
        "a wrong hash": written(b"moondb bundle 1\n" + bytes(8) + body),
        "no bundle behind a right hash": written(
            b"moondb bundle 1\n" + struct.pack("<Q", messages.xxh64(body)) + body),
        "100,000 empty parts behind a right hash": written(
            b"moondb bundle 1\n" + struct.pack("<Q", messages.xxh64(b"\x32\x00" * 100_000)) + b"\x32\x00" * 100_000),
    }
    with tempfile.TemporaryDirectory(prefix="moondb-hostile-bundle-") as name:
        path = pathlib.Path(name) / "file"
        for what, make in (NO_FILES | bundles).items():
            for words in (("downlink", "show", path), ("graph", "import", path), ("graph", "solve", path),
                          ("-a", "rover1", "record", "insert", "temperature", f"@{path}")):
                make(path)
                expect_refused(team, f"{' '.join(map(str, words[:-1]))}: {what}", "moonctl", *words)
                shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


AT_REST = True  # While these attackers run, the other agents do not share, because the attackers stop an agent.
def huge_files(team, scale):
    """300 MB of zeros, which take no room on the disk, stand in place of a team file, a mission's, a graph or a bundle."""
    with tempfile.TemporaryDirectory(prefix="moondb-hostile-huge-") as name:
        mission, path = Mission(pathlib.Path(name) / "mission"), pathlib.Path(name) / "file"
        sparse(300)(path)
        for words in (("-t", path, "config", "check"), ("downlink", "show", path), ("graph", "import", path),
                      ("-a", "rover1", "record", "insert", "temperature", f"@{path}")):
            expect_refused(team, f"{' '.join(map(str, words))} with 300 MB", "moonctl", *words)
        for file in ("agents.csv", "graph.pyfg", "maps.csv", "maps/1.png"):
            before = (mission.folder / file).read_bytes()
            mission.replace(file, sparse(300))
            expect_refused(team, f"{file} has 300 MB", "moondb_replay", "feed", "--mission", mission.folder)
            mission.write(file, before)


@contextlib.contextmanager
def copied_team(team):
    """Yields a folder with a copy of the team file and its keys, in which no agent runs."""
    with tempfile.TemporaryDirectory(prefix="moondb-hostile-") as name:
        folder = pathlib.Path(name) / "copy"
        folder.mkdir(mode=0o755)
        for path in team.folder.iterdir():
            if path.suffix in (".yaml", ".pub", ".sec", ".sign"):
                shutil.copy(path, folder)
        yield folder


def planted_links(team, scale):
    """Another user plants links at the names of moonctl's temporary files. The umask is 000."""
    umask = os.umask(0)
    try:
        with copied_team(team) as folder:
            victim, robot = folder.parent / "victim", folder.parent / "robot" / "moondb"
            victim.write_text(VICTIM_TEXT)
            victim.chmod(0o600)
            for name in ("clients.yaml", "team.yaml", "rover5.pub", "rover5.sec", "rover5.sign", "anna.sec"):
                for end in (".part", ".new", ".new.part", ".tmp"):
                    (folder / (name + end)).symlink_to(victim)
            before = set(folder.iterdir())
            file, pack = ("-t", str(folder / "team.yaml")), str(folder / "rover1.pack")
            team.moonctl(*file, "clients", "add", "anna", "--rights", "view", "--out", str(folder / "anna.sec"))
            team.moonctl(*file, "clients", "revoke", "watcher")
            team.moonctl(*file, "config", "add-agent", "rover5", "--address", "tcp://127.0.0.1:7499")
            team.moonctl(*file, "config", "pack", "rover1", pack)
            team.moonctl("config", "unpack", pack, str(robot))
            if victim.read_text() != VICTIM_TEXT or victim.stat().st_mode & 0o777 != 0o600:
                raise Failure("moonctl wrote through a planted link")
            written = [path for path in {*folder.iterdir()} - before if not path.is_symlink()]
            for path in [*written, folder / "team.yaml", folder / "clients.yaml", robot.parent, *robot.parent.rglob("*")]:
                if path.stat().st_mode & 0o022:
                    raise Failure(f"moonctl lets other users write {path.name} if the umask is 000")
    finally:
        os.umask(umask)


def damaged_packs(team, scale):
    """A pack arrives with one flipped bit, or without its end."""
    with copied_team(team) as folder:
        pack, robot = folder / "rover1.pack", folder.parent / "robot"
        team.moonctl("-t", str(folder / "team.yaml"), "config", "pack", "rover1", str(pack))
        good = pack.read_bytes()
        for i in range(int(100 * scale)):
            at, bit = random.randrange(len(good)), random.randrange(8)
            pack.write_bytes(good[:at] + bytes([good[at] ^ 1 << bit]) + good[at + 1:] if i % 4 else good[:at])
            expect_refused(team, f"bit {bit} of byte {at}", "moonctl", "config", "unpack", pack, robot)
        if robot.exists():
            raise Failure("moonctl wrote files of a damaged pack")


# Makes a call of the Python client. Ends with exit code 3 if the client refuses the agent's answer.
PYTHON_CALL = """
import sys
sys.path.insert(0, sys.argv[1])
from moondb import client
try:
    getattr(client.Client(sys.argv[2], "00" * 16, timeout_s=5), sys.argv[3])()
except (client.AnswerError, TimeoutError):
    sys.exit(3)
"""


def python_client_bombs(team, scale):
    """An agent that was taken over answers the Python client with zstd bombs, tiles, rows and bytes without end."""
    import zmq
    import zstandard
    from moondb import messages as types
    compressor = zstandard.ZstdCompressor()
    bomb = compressor.compress(bytes(1 << 30)) if scale >= 1 else compressor.compress(bytes(1 << 29))
    node = types.Record(pose_graph_node={"node": {"agent_id": 1, "index": 1}}).SerializeToString()
    many = [{"x": x} for x in range(10_000)]
    attacks = [
        ("a map that decompresses to 1 GB", "merged_map", {"merge": {"width_cells": 8, "height_cells": 8,
                                                                     "zstd_cells": bomb}}),
        ("a tile that decompresses to 1 GB", "map_tiles", {"map_tiles": {"tile_cells": 64, "is_complete": True,
                                                                         "tiles": [{"zstd_cells": bomb}]}}),
        ("tiles without end", "map_tiles", {"map_tiles": {"tile_cells": 64, "tiles": many}}),
        ("the same row without end", "next_node_index", {"status": {"agent_id": 1}, "read": {
            "row_ids": [1], "records": [{"content": node}]}}),
        ("an answer of 300 MB", "status", {"merge": {"zstd_cells": bytes(300 << 20)}}),
    ]
    with tempfile.TemporaryDirectory(prefix="moondb-hostile-") as name, zmq.Context.instance().socket(zmq.ROUTER) as router:
        router.linger = 0
        endpoint = f"ipc://{name}/agent"
        router.bind(endpoint)
        for what, call, reply in attacks:
            with answering(router, types, reply):
                expect_refused(team, f"the Python client is sent {what}", sys.executable, "-c", PYTHON_CALL,
                               team.programs.parent / "python", endpoint, call)


@contextlib.contextmanager
def answering(router, types, reply):
    """Answers each request with this reply until the end of the block. A reply has one field, as control.proto has it.
    If there are several, a request gets the field of its own name, or else the last one."""
    is_over = threading.Event()

    def run():
        while not is_over.is_set():
            if not router.poll(10):
                continue
            to, frame = router.recv_multipart()
            request = types.ClientMessage.FromString(frame)
            field = request.control_request.WhichOneof("request")
            field = field if field in reply else [*reply][-1]
            answer = types.ControlReply(team_id=bytes(16), **{field: reply[field]})
            router.send_multipart([to, types.ClientMessage(request_id=request.request_id,
                                                           control_reply=answer).SerializeToString()])

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()


ATTACKERS = [files_that_others_may_write, links_in_the_data_folder, hostile_stores, hostile_missions, hostile_yaml,
             hostile_bundles, huge_files, planted_links, damaged_packs, python_client_bombs]

# These attackers run only in a long test, because each starts hundreds of programs in sequence.
ONLY_AT_LENGTH = [hostile_missions, hostile_bundles]

NOT_YET = {huge_files: "`graph import` and `moondb_replay feed` read a file whole before they look at it: 535 MB of memory"}
