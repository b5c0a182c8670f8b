#!/usr/bin/env python3
"""The Python client accepts and refuses the team files that `moonctl config check` does (tests/team_files), and finds agents.

Usage: team_file_test.py PYTHON MOONCTL    the folder of the package moondb, and the program
Exit codes: 0 passed, 1 failed, 77 skipped (a package of Python is missing; it says which).
"""
import os
import pathlib
import socket
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "apps"))
from python_example_test import MODULES, go_on_with  # noqa: E402
from snippets_test import SKIPPED  # noqa: E402

FILES = pathlib.Path(__file__).resolve().parents[2] / "team_files"


class TeamFileTest(unittest.TestCase):
    def test_reads_name_and_id_of_each_accepted_file(self):
        names = {"yes_name": "yes", "num_name": "007", "quoted_null": "null"}
        for file in self.files("accepted"):
            with self.subTest(file.name):
                name, team_id = team_of(file)
                self.assertEqual(name, names.get(file.stem, "moon"))
                self.assertEqual(team_id[:16], "0011223344556677")
                self.assertEqual(len(team_id), 32)

    def test_names_file_and_line_of_each_refused_file(self):
        for file in self.files("refused"):
            with self.subTest(file.name):
                with self.assertRaisesRegex(TeamFileError, rf"^{file}:\d+:\d+: \w"):
                    team_of(file)

    def test_agrees_with_config_check(self):
        for kind, code in (("accepted", 0), ("refused", 2)):
            for file in self.files(kind):
                with self.subTest(file.name):
                    done = subprocess.run([MOONCTL, "config", "check", file], capture_output=True, timeout=60)
                    self.assertEqual(done.returncode, code, done.stderr)

    def test_says_where_a_file_is_wrong(self):
        with self.assertRaises(TeamFileError) as error:
            team_of(FILES / "refused/dup_team.yaml")
        self.assertTrue(str(error.exception).endswith("dup_team.yaml:7:1: team: given twice"), error.exception)

    def test_aliases_take_bounded_time(self):
        lines = ["a0: &a0 [x, x]"] + [f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]" for i in range(1, 60)]
        good = (FILES / "accepted/good.yaml").read_text()
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / "team.yaml"
            file.write_text(good + "\n".join(lines) + "\n")
            self.assertEqual(team_of(file)[0], "moon")
            file.write_bytes(b"#" * 1_000_001)
            with self.assertRaises(TeamFileError):
                team_of(file)

    def test_a_missing_file_is_an_os_error(self):
        with self.assertRaises(FileNotFoundError):
            team_of(FILES / "missing.yaml")

    def files(self, kind):
        files = sorted((FILES / kind).glob("*.yaml"))
        self.assertGreater(len(files), 20)
        return files


class EndpointTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory(prefix="moondb-")
        self.addCleanup(self.folder.cleanup)
        self.root = pathlib.Path(self.folder.name)
        self.team = self.root / "team.yaml"
        self.team.write_text((FILES / "accepted/good.yaml").read_text())
        os.environ["MOONDB_RUN_DIR"] = str(self.root / "run")
        self.addCleanup(os.environ.pop, "MOONDB_RUN_DIR")
        self.path = self.root / "run/moon-00112233/rover1.sock"

    def listen(self, path, mode=0o700):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.parent.chmod(mode)
        listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.addCleanup(listener.close)
        listener.bind(str(path))
        listener.listen(1)

    def report(self, path):
        data = self.root / "moondb-data/rover1"
        data.mkdir(parents=True)
        (data / "agent.endpoint").write_text(f"ipc://{path}\n")

    def test_nobody_listens(self):
        self.assertEqual(endpoint_of(self.team, "rover1"), f"ipc://{self.path}")

    def test_the_data_folder_names_a_socket_elsewhere(self):
        self.listen(self.root / "elsewhere/a.sock")
        self.report(self.root / "elsewhere/a.sock")
        self.assertEqual(endpoint_of(self.team, "rover1"), f"ipc://{self.root}/elsewhere/a.sock")
        self.assertEqual(endpoint_of(self.team, "rover2"), f"ipc://{self.root}/run/moon-00112233/rover2.sock")

    def test_an_outdated_data_folder_does_not_hide_the_run_folder(self):
        self.report(self.root / "gone/a.sock")
        self.listen(self.path)
        self.assertEqual(endpoint_of(self.team, "rover1"), f"ipc://{self.path}")

    def test_ignores_a_socket_in_a_folder_that_others_may_write(self):
        self.listen(self.root / "open/a.sock", mode=0o777)
        self.report(self.root / "open/a.sock")
        self.assertEqual(endpoint_of(self.team, "rover1"), f"ipc://{self.path}")


def main():
    global MOONCTL, TeamFileError, endpoint_of, team_of  # Only importable with PYTHON in the path.
    if not go_on_with(MODULES):
        return SKIPPED
    sys.path.insert(0, sys.argv.pop(1))
    MOONCTL = sys.argv.pop(1)
    from moondb import TeamFileError, endpoint_of, team_of
    unittest.main()
    return 0


if __name__ == "__main__":
    sys.exit(main())
