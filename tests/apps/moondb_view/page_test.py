#!/usr/bin/env python3
"""Runs a team of four with moondb_view. Reads it with clients of Foxglove's protocol (foxglove_checks.mjs), and checks
the page in Chromium (page_checks.mjs).

Usage: page_test.py PROGRAMS FOLDER [PICTURES]    FOLDER gets the npm packages of package-lock.json.
Exit codes: 0 passed, 1 failed, 77 skipped (Chromium, node or npm is missing; with MOONDB_NEEDS_BROWSER, that fails).
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[2] / "tools"))
from demo_team import free_port_run

SKIPPED = 77
LIMIT_S = 300


def run(command, **options):
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT_S, **options)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout


def install_packages(folder):
    """Returns why the packages cannot be installed, or None."""
    for program in ("node", "npm", "chromium"):
        if shutil.which(program) is None:
            return f"there is no {program}: tools/bootstrap view installs it"
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("package.json", "package-lock.json", "page_checks.mjs", "foxglove_checks.mjs"):
        shutil.copy(HERE / name, folder)
    done = subprocess.run(["npm", "ci", "--no-audit", "--no-fund"], cwd=folder, capture_output=True, text=True,
                          timeout=LIMIT_S, check=False)
    return None if done.returncode == 0 else "npm ci failed: " + done.stderr[-500:]


def start_team(environment, folder):
    run(["moondb_mission", "generate", "--seed", "7", "--minutes", "3", "--out", "mission"], env=environment, cwd=folder)
    run(["moonctl", "config", "init", "--mission", "mission", "team/team.yaml", "--first-port",
         str(free_port_run(4))], env=environment, cwd=folder)
    team = folder / "team/team.yaml"
    text = team.read_text(encoding="utf-8").replace("sync_period_s: 0", "sync_period_s: 2")
    team.write_text(text, encoding="utf-8")
    run(["moonctl", "up"], env=environment, cwd=folder)
    run(["moondb_replay", "feed", "--mission", "mission"], env=environment, cwd=folder)
    end = time.monotonic() + LIMIT_S
    while "\nsettled" not in run(["moonctl", "status"], env=environment, cwd=folder):
        if time.monotonic() > end:
            raise RuntimeError("the team does not settle")
        time.sleep(1)


def check_page(environment, folder, packages, programs, pictures):
    with open(folder / "view.log", "w", encoding="utf-8") as log:
        view = subprocess.Popen(["moonctl", "-a", "rover1", "view", "--port", "0"], env=environment, cwd=folder, text=True,
                                stdout=subprocess.PIPE, stderr=log)
    try:
        address = re.search(r"http://\S+", view.stdout.readline()).group(0)
        layout = HERE.parents[2] / "configs/foxglove_layout.json"
        print(run(["node", "foxglove_checks.mjs", address, programs, layout], env=environment, cwd=packages))
        print(run(["node", "page_checks.mjs", address, programs, *pictures], env=environment, cwd=packages))
    finally:
        view.terminate()
        if view.wait(timeout=60) != 0:
            raise RuntimeError("moondb_view ended with " + str(view.returncode))


def main():
    programs, packages = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    pictures = [str(pathlib.Path(folder).resolve()) for folder in sys.argv[3:]]
    if why := install_packages(packages):
        print("not tested:", why)
        return 1 if os.environ.get("MOONDB_NEEDS_BROWSER") else SKIPPED
    with tempfile.TemporaryDirectory(prefix="moondb-view-") as folder:
        folder = pathlib.Path(folder)
        environment = dict(os.environ, PATH=f"{programs}:{os.environ['PATH']}", MOONDB_RUN_DIR=f"{folder}/run",
                           MOONDB_TEAM=f"{folder}/team/team.yaml")
        try:
            start_team(environment, folder)
            check_page(environment, folder, packages, programs, pictures)
        finally:
            subprocess.run(["moonctl", "down"], env=environment, cwd=folder, capture_output=True, timeout=60, check=False)
    print("passed")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except RuntimeError as failure:
        print(f"failed: {failure}")
        sys.exit(1)
