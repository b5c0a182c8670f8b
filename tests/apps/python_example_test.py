#!/usr/bin/env python3
"""Runs the client in Python against a real team: a program that is not moondb's own speaks its protocol.

Usage: python_example_test.py PROGRAMS SOURCE    the folder of moonctl, and the source tree.
Exit codes: 0 passed, 1 failed, 77 skipped (protoc or Python's packages are missing, or a port is taken; it says which).
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

from snippets_test import SKIPPED, in_own_network, taken_port

MODULES = ["google.protobuf", "zmq", "zstandard"]
SAID = re.compile(r"""rover2 of team moon, moondb [\d.]+
stored 3 records, the first as (2\.[\da-f]{16}\.1\.1)
read \1 -40\.5
merged map of 1: 80 x 80 cells of 0\.05 m, lower left corner at \(3\.00, 0\.00\), 5760 free, 640 hazard
""")


def python_with(modules):
    """The first interpreter that has the packages: an own one in front of Debian's may lack them."""
    for python in (sys.executable, "/usr/bin/python3"):
        if subprocess.run([python, "-c", "import " + ", ".join(modules)], capture_output=True).returncode == 0:
            return python
    return None


def run(command, environment, folder):
    done = subprocess.run(command, env=environment, cwd=folder, capture_output=True, text=True, timeout=60)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout


def survey(python, programs, source, folder):
    environment = dict(os.environ, PATH=f"{programs}:{os.environ['PATH']}", MOONDB_RUN_DIR=f"{folder}/run",
                       MOONDB_TEAM=f"{folder}/team/team.yaml", PYTHONPATH=folder)
    protos = sorted(str(path) for path in (source / "proto").glob("*.proto"))
    run(["protoc", f"--python_out={folder}", "-I", str(source / "proto"), *protos], environment, folder)
    run(["moonctl", "config", "init", "--agents", "4", "--name", "moon", "team/team.yaml"], environment, folder)
    try:
        run(["moonctl", "up"], environment, folder)
        survey_program = str(source / "examples/python/survey.py")
        out = run([python, survey_program, "team/team.yaml", "rover2", "2"], environment, folder)
        again = run([python, survey_program, "team/team.yaml", "rover2", "2"], environment, folder)
        if "stored 3 records" not in again:
            raise RuntimeError(f"a second run printed:\n{again}")
        maps = run(["moonctl", "-a", "rover2", "record", "list", "local_traversability_map"], environment, folder)
        return out, maps
    finally:
        subprocess.run(["moonctl", "down"], env=environment, capture_output=True, timeout=60)


def main():
    if len(sys.argv) != 3:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    in_own_network()
    python = python_with(MODULES)
    if python is None or shutil.which("protoc") is None:
        print("skipped: needs protoc, python3-zmq, python3-protobuf and python3-zstandard")
        return SKIPPED
    if taken_port() is not None:
        print(f"skipped: port {taken_port()} is taken")
        return SKIPPED
    with tempfile.TemporaryDirectory(prefix="moondb-py-") as folder:
        out, maps = survey(python, pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve(), folder)
    if not SAID.fullmatch(out) or "rover2" not in maps:
        print(f"failed: it printed\n{out}{maps}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
