#!/usr/bin/env python3
"""Runs the clients in Python and C++ that are examples against a real team, and looks whether docs/SHARING.md shows them.

Usage: python_example_test.py PROGRAMS SOURCE    the folder of moonctl, and the source tree.
Exit codes: 0 passed, 1 failed, 77 skipped (Python's packages are missing, or a port is taken; it says which).
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time

from snippets_test import SKIPPED, in_own_network, taken_port

MODULES = ["google.protobuf", "zmq", "zstandard", "yaml"]
SAID = re.compile(r"""rover2 of team moon, moondb [\d.]+
stored 3 records, the first as (2\.[\da-f]{16}\.1\.1)
read \1 -40\.5
merged map of 1: 80 x 80 cells of 0\.05 m, lower left corner at \(3\.00, 0\.00\), 5760 free, 640 hazard
""")
SAID_IN_CPP = r"""stored 3 records, the first as 3\.[\da-f]{16}\.1\.1
merged map: 80 x 80 cells
"""


# Expected output of the sync examples while rover2 drives and rover3 is off.
MISSING = re.compile(r"""not complete
2 to 1: rover2 drives for \d+ s more
1 to 2: rover2 drives for \d+ s more
3 to 1: is out of reach
1 to 3: is out of reach
""")


def python_with(modules):
    """Returns the first interpreter that has the packages. The first one in PATH may lack Debian's packages."""
    for python in (sys.executable, "/usr/bin/python3"):
        if subprocess.run([python, "-c", "import " + ", ".join(modules)], capture_output=True).returncode == 0:
            return python
    return None


def go_on_with(modules):
    """Runs this program on with an interpreter that has the packages. Returns False, and says so, if there is none."""
    python = python_with(modules)
    if python is None:
        print(f"skipped: Python lacks one of {', '.join(modules)}")
        return False
    if python != sys.executable:
        os.execv(python, [python, *sys.argv])
    return True


def run(command, environment, folder):
    done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, timeout=60)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout


def survey(python, programs, source, folder):
    environment = dict(os.environ, PATH=f"{programs}:{os.environ['PATH']}", MOONDB_RUN_DIR=f"{folder}/run",
                       MOONDB_TEAM=f"{folder}/team/team.yaml", PYTHONPATH=str(programs.parent / "python"))
    run(["moonctl", "config", "init", "--agents", "4", "--name", "moon", "team/team.yaml"], environment, folder)
    try:
        run(["moonctl", "up"], environment, folder)
        survey_program = str(source / "examples/python/survey.py")
        out = run([python, survey_program, "team/team.yaml", "rover2", "2"], environment, folder)
        check_calls(folder, environment, python)
        again = run([python, survey_program, "team/team.yaml", "rover2", "2"], environment, folder)
        if "stored 3 records" not in again:
            raise RuntimeError(f"a second run printed:\n{again}")
        endpoint = next(pathlib.Path(folder, "run").glob("moon-*/rover3.sock"))
        in_cpp = run(["survey_example", f"ipc://{endpoint}", "rover3", "3"], environment, folder)
        if not re.fullmatch(SAID_IN_CPP, in_cpp):
            raise RuntimeError(f"the C++ client printed:\n{in_cpp}")
        maps = run(["moonctl", "-a", "rover2", "record", "list", "local_traversability_map"], environment, folder)
        check_factors(folder, environment, python)
        return out, maps, sync_while_not_all_can(python, source, folder, environment)
    finally:
        subprocess.run(["moonctl", "down"], env=environment, capture_output=True, timeout=60)


def check_calls(folder, environment, python):
    """Checks the calls of the Python client for tiles, leases, roles, feeds and errors."""
    program = """
import time
from moondb import AgentError, Client, TeamError, endpoint_of, messages, team_of
endpoint, team_id = endpoint_of("team/team.yaml", "rover2"), team_of("team/team.yaml")[1]
with Client(endpoint, team_id) as client:
    tiles = client.map_tiles(wait_s=10)
    assert tiles.is_everything and tiles.resolution_m == 0.05, tiles
    assert sum(cells.count(2) for cells in tiles.tiles.values()) == 640, tiles
    assert client.map_tiles().tiles == {} and not client.map_tiles().is_everything
    leases = client.set_lease(messages.LEASE_KIND_DRIVING, 30)
    assert [lease.agent_id for lease in leases] == [2] and client.set_lease(messages.LEASE_KIND_DRIVING, 0) == []
    assert client.roles().leader == 1
    row_id, key, record = next(client.feed([messages.TEMPERATURE]))
    assert row_id > 0 and key.origin_agent == 2 and record.temperature.celsius == -40.5
    try:
        client.insert([messages.Record()])
        raise SystemExit("an empty record was stored")
    except AgentError as error:
        assert str(error) == "records[0].body: is missing or of an unknown type", error
for other, expected in ((Client(endpoint, "00" * 16), TeamError), (Client("ipc:///nobody", team_id, 0.1), TimeoutError)):
    try:
        other.status()
        raise SystemExit(f"no {expected.__name__}")
    except expected:
        pass
"""
    run([python, "-c", program], environment, folder)


def check_factors(folder, environment, python):
    """Inserts a loop closure and a prior by the Python client, and checks that the agent lists them."""
    program = """
import sys
from moondb import Client, endpoint_of, map_position, team_of
client = Client(endpoint_of("team/team.yaml", "rover2"), team_of("team/team.yaml")[1])
client.insert_loop_closure((2, 1), (1, 17), (1.2, -0.3, 0), [0.05, 0.05, 0.1, 0.1, 0.1, 0.02], "apriltag")
fix = map_position({"lat_deg": 0, "lon_deg": 10, "alt_m": 100}, 0, 10 + 1 / 3600, 101)
assert abs(fix[1] + 30.922) < 0.001 and abs(fix[2] - 1) < 0.001, fix
client.insert_prior((2, 1), fix, [0.02, 0.02, 0.04], "gnss", point_m=(-0.2, 0, 0.9))
client.insert_prior((2, 1), fix, [0.02, 0.02, 0.04, 0.1], "total_station", yaw_rad=0.5)
client.insert_prior((2, 1), fix, [0.02, 0.02, 0.04, 0.1, 0.1, 0.1], "apriltag", orientation=(0, 0, 0, 1))
"""
    run([python, "-c", program], environment, folder)
    listed = run(["moonctl", "-a", "rover2", "record", "list", "pose_prior"], environment, folder)
    edges = run(["moonctl", "-a", "rover2", "record", "list", "pose_graph_edge"], environment, folder)
    if listed.count("pose_prior") != 3 or "pose_graph_edge" not in edges:
        raise RuntimeError(f"the agent lists\n{listed}{edges}")


def sync_while_not_all_can(python, source, folder, environment):
    """Checks the output of the two programs that sync, wait and report missing records."""
    run(["moonctl", "-a", "rover2", "drive", "on", "--for", "300"], environment, folder)
    run(["moonctl", "-a", "rover3", "down"], environment, folder)
    endpoint = next(pathlib.Path(folder, "run").glob("moon-*/rover1.sock"))
    programs = [[python, str(source / "examples/python/sync.py"), "team/team.yaml", "rover1"],
                ["sync_example", f"ipc://{endpoint}", "rover1"]]
    deadline = time.monotonic() + 60
    while "out of reach" not in run(programs[0], environment, folder) and time.monotonic() < deadline:
        pass  # Wait until the leader notices that rover3 is off.
    return [run(program, environment, folder) for program in programs]


def shows_examples(source):
    shown = (source / "docs/SHARING.md").read_text()
    return all((source / file).read_text() in shown for file in ("examples/python/sync.py", "examples/client/sync.cc"))


def main():
    if len(sys.argv) != 3:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    in_own_network()
    python = python_with(MODULES)
    if python is None:
        print("skipped: needs python3-zmq, python3-protobuf and python3-zstandard")
        return SKIPPED
    if taken_port() is not None:
        print(f"skipped: port {taken_port()} is taken")
        return SKIPPED
    with tempfile.TemporaryDirectory(prefix="moondb-py-") as folder:
        out, maps, missing = survey(python, pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve(), folder)
    if not SAID.fullmatch(out) or "rover2" not in maps:
        print(f"failed: it printed\n{out}{maps}")
        return 1
    for text in missing:
        if not MISSING.fullmatch(text):
            print(f"failed: a program that syncs printed\n{text}")
            return 1
    if not shows_examples(pathlib.Path(sys.argv[2])):
        print("failed: docs/SHARING.md does not show examples/python/sync.py and examples/client/sync.cc as they are")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
