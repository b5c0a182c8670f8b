"""Drives a mission slowly with the page of moondb_view open (see tools/demo --view).

Records flow by themselves. Once the mission is driven, the team stays, until Ctrl-C ends it. Kill an agent, swap roles
or fill a disk from another terminal, and watch the page; the demo prints what to set there.
"""
import argparse
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import demo_lost_rover
from demo_team import DemoError, free_port_run, make_empty, run_and_report

AGENT_COUNT = 4
LIMIT_S = 300


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--view", action="store_true", help="this demo")
    parser.add_argument("--mission", metavar="DIR", help="a recorded mission, instead of a generated one")
    parser.add_argument("--seed", type=int, default=7, help="of the generated mission (7)")
    parser.add_argument("--minutes", type=int, default=10, help="length of the generated mission (10)")
    parser.add_argument("--speed", type=float, default=4, help="this many times as fast as the robots drove (4)")
    parser.add_argument("--port", type=int, default=8600, help="port of the page (8600)")
    parser.add_argument("--out", default="out", help="folder of the results (out)")
    return parser.parse_args()


def run(programs, environment, *command):
    done = subprocess.run([programs / command[0], *command[1:]], env=environment, capture_output=True, text=True,
                          timeout=LIMIT_S, check=False)
    if done.returncode != 0:
        raise DemoError(f"{' '.join(map(str, command))}: {(done.stderr or done.stdout).strip()}")


def open_browser(address):
    """Opens the page, if this computer has a screen. Otherwise the user opens the address."""
    opener = shutil.which("xdg-open")
    if opener and (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        subprocess.run([opener, address], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)


def drive(options, out, run_folder):
    programs = pathlib.Path(options.bin)
    environment = dict(os.environ, MOONDB_TEAM=str(out / "team/team.yaml"), MOONDB_RUN_DIR=run_folder)
    mission = pathlib.Path(options.mission).resolve() if options.mission else out / "mission"
    if not options.mission:
        run(programs, environment, "moondb_mission", "generate", "--seed", str(options.seed), "--minutes",
            str(options.minutes), "--out", mission)
    run(programs, environment, "moonctl", "config", "init", "--mission", mission, out / "team/team.yaml", "--first-port",
        str(free_port_run(AGENT_COUNT)))
    demo_lost_rover.let_records_flow(out / "team/team.yaml")
    view = None
    try:
        run(programs, environment, "moonctl", "up")
        view = subprocess.Popen([programs / "moonctl", "-a", "rover1", "view", "--port", str(options.port)], env=environment,
                                stdout=subprocess.PIPE, text=True)
        said = view.stdout.readline().strip()
        if not said:
            raise DemoError("the page does not start; see above")
        print(f"{said}\nin another terminal: export MOONDB_TEAM={out}/team/team.yaml PATH={programs}:$PATH", flush=True)
        open_browser(said.split()[-1])
        subprocess.run([programs / "moondb_replay", "feed", "--mission", mission, "--speed", str(options.speed)],
                       env=environment, check=False)
        print("the mission is driven; Ctrl-C ends the team", flush=True)
        view.wait()
    finally:
        if view is not None:
            view.terminate()
        run(programs, environment, "moonctl", "down")


def main():
    options = parse_arguments()
    out = pathlib.Path(options.out).resolve()
    make_empty(out)
    with tempfile.TemporaryDirectory(prefix="moondb-view-") as run_folder:
        drive(options, out, run_folder)


if __name__ == "__main__":
    sys.exit(run_and_report(main))
