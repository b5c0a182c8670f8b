#!/usr/bin/env python3
"""The Python client accepts and refuses the team files that `moonctl config check` does (tests/team_files).

Usage: team_file_test.py PYTHON MOONCTL    the folder of the package moondb, and the program
Exit codes: 0 passed, 1 failed, 77 skipped (a package of Python is missing; it says which).
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "apps"))
from python_example_test import MODULES, python_with  # noqa: E402
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


def main():
    global MOONCTL, TeamFileError, team_of  # Only importable with PYTHON in the path.
    python = python_with(MODULES)
    if python is None:
        print(f"skipped: Python lacks one of {', '.join(MODULES)}")
        return SKIPPED
    if python != sys.executable:
        os.execv(python, [python, *sys.argv])
    sys.path.insert(0, sys.argv.pop(1))
    MOONCTL = sys.argv.pop(1)
    from moondb import TeamFileError, team_of
    unittest.main()
    return 0


if __name__ == "__main__":
    sys.exit(main())
