#!/usr/bin/env python3
"""Runs the snippets of the guides, in the order in which they stand, and holds what is printed against what they say.

A fenced block ```sh holds commands. In a block ```console lines that begin with "$ " are commands, and the lines below
one are what it prints, standard error too: each must come in this order, numbers, sizes, users and teams' ids aside; more
lines may come in between. A command must end with 0, or with N where it ends in "# exits with N". The blocks of one guide
share one shell, in an empty folder with its own sockets; other blocks are not run.

Usage: snippets_test.py PROGRAMS GUIDE...    PROGRAMS is the folder of moonctl and the others.
Exit codes: 0 passed, 1 failed, 77 skipped (the ports of a team on loopback are taken; it says which).
"""
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile

SKIPPED = 77
PORTS = range(7400, 7404)  # Default ports of `moonctl config init`.
HOME = "/home/anna"  # In the guides, this path stands for the folder of the snippets.
FENCE = re.compile(r"^```(sh|console)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
EXITS = re.compile(r"# exits with (\d+)\s*$")
NUMBER = re.compile(r"(?<![A-Za-z_\d])-?\d[\da-fx.:]*( ?(?:[kMG]?B|[kM]?bit/s|[kMG]?B/s|ms|s|min|h|m|rad)\b)?")


USER = re.compile(r"\w+@[\w.-]+")
# A team's id, in full or shortened in a socket path, or the hash of a team file.
TEAM_ID = re.compile(r"\b[0-9a-f]{32}\b|(?<=-)[0-9a-f]{8}(?=/\w+\.sock)|(?<=hash )[0-9a-f]{16}|(?<=here )[0-9a-f]{16}")


class Failure(Exception):
    pass


def commands_of(kind, block):
    """Returns pairs of a command and its expected output lines (None if the guide shows no output)."""
    commands = []
    for line in block.splitlines():
        if kind == "sh" and line.strip() and not line.startswith("#"):
            commands.append((line, None))
        elif kind == "console" and line.startswith("$ "):
            commands.append((line[2:], []))
        elif kind == "console" and commands:
            commands[-1][1].append(line)
    return commands


def shape(line):
    return re.sub(r"\s+", " ", NUMBER.sub("#", TEAM_ID.sub("#", USER.sub("@", line)))).strip()


def missing_line(said, printed):
    """Returns the first expected line that is missing in the output or out of order, or None."""
    shapes, at = [shape(line) for line in printed], 0
    for line in said:
        if line.strip() in ("", "..."):
            continue
        if shape(line) not in shapes[at:]:
            return line
        at = shapes.index(shape(line), at) + 1
    return None


class Shell:
    def __init__(self, folder, environment):
        self.process = subprocess.Popen(["bash"], cwd=folder, env=environment, stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def run(self, command):
        """Runs a command and returns its exit code and output lines."""
        limited = f"{{ {command}\n}} < /dev/null; echo \"@@ended $?\"\n"
        self.process.stdin.write(limited)
        self.process.stdin.flush()
        lines = []
        for line in self.process.stdout:
            if line.startswith("@@ended "):
                return int(line.split()[1]), lines
            lines.append(line.rstrip("\n"))
        raise Failure(f"the shell ended at: {command}")

    def end(self):
        self.process.stdin.close()
        self.process.wait(timeout=60)


def check(guide, line_number, command, said, code, printed):
    exits = EXITS.search(command)
    expected = int(exits.group(1)) if exits else 0
    where = f"{guide.name}:{line_number}: $ {command}"
    if code != expected:
        raise Failure(f"{where}\nended with {code}, not {expected}:\n" + "\n".join(printed))
    missing = missing_line(said or [], printed)
    if missing is not None:
        raise Failure(f"{where}\ndid not print\n{missing}\nbut\n" + "\n".join(printed))


def run_guide(guide, programs):
    text = guide.read_text(encoding="utf-8")
    count = 0
    with tempfile.TemporaryDirectory(prefix="moondb-doc-") as folder:
        environment = dict(os.environ, PATH=f"{programs}:{os.environ['PATH']}", MOONDB_RUN_DIR=f"{folder}/run",
                           HOME=folder, NO_COLOR="1", COLUMNS="120")
        for name in ("MOONDB_TEAM", "XDG_CONFIG_HOME"):
            environment.pop(name, None)
        shell = Shell(folder, environment)
        try:
            for match in FENCE.finditer(text):
                line_number = text.count("\n", 0, match.start()) + 1
                for command, said in commands_of(match.group(1), match.group(2)):
                    code, printed = shell.run(command)
                    printed = [line.replace(folder, HOME) for line in printed]
                    check(guide, line_number, command, said, code, printed)
                    count += 1
        finally:
            shell.run("moonctl down > /dev/null 2>&1")
            shell.end()
    print(f"{guide.name}: {count} commands")
    return count


def taken_port():
    for port in PORTS:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                return port
    return None


def in_own_network():
    """Runs this program again in a new network namespace, if this machine allows it."""
    if os.geteuid() != 0 or os.environ.get("MOONDB_OWN_NETWORK") or not shutil.which("unshare"):
        return
    if subprocess.run(["unshare", "-n", "ip", "link", "set", "lo", "up"], capture_output=True).returncode != 0:
        return
    os.environ["MOONDB_OWN_NETWORK"] = "1"
    os.execvp("unshare", ["unshare", "-n", "bash", "-c", 'ip link set lo up; exec "$@"', "bash", sys.executable,
                          *sys.argv])


def main():
    if len(sys.argv) < 3:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    in_own_network()
    if taken_port() is not None:
        print(f"skipped: port {taken_port()} is taken")
        return SKIPPED
    try:
        count = sum(run_guide(pathlib.Path(guide), pathlib.Path(sys.argv[1]).resolve()) for guide in sys.argv[2:])
    except Failure as failure:
        print(f"failed: {failure}")
        return 1
    return 0 if count > 0 else 1


if __name__ == "__main__":
    sys.exit(main())
