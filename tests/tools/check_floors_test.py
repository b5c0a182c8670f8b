"""check_floors must report each kind of wrong include, and find none in this tree."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent


def run(root):
    return subprocess.run([sys.executable, ROOT / "tools/check_floors", root], capture_output=True, text=True)


class CheckFloorsTest(unittest.TestCase):
    def check(self, path, include):
        with tempfile.TemporaryDirectory() as folder:
            file = pathlib.Path(folder) / path
            file.parent.mkdir(parents=True)
            file.write_text(f"#pragma once\n#include {include}\n")
            return run(folder)

    def test_refuses_arrows_up_and_sideways(self):
        for path, include in [
            ("model/a.h", '"runtime/actor.h"'),
            ("runtime/a.h", '"actors/pgo/b.h"'),
            ("runtime/a.h", '"runtime/simulation/simulated_team.h"'),
            ("actors/pgo/a.h", '"actors/merge/b.h"'),
            ("actors/pgo/pgo_actor.h", '"client/client.h"'),
            ("actors/pgo/solver.h", '"runtime/actor.h"'),
            ("client/client.h", '"runtime/actor.h"'),
            ("client/client.h", '"actors/pgo/b.h"'),
            ("actors/pgo/a.h", "<sqlite3.h>"),
            ("apps/a.h", "<ceres/ceres.h>"),
        ]:
            result = self.check(path, include)
            self.assertEqual(result.returncode, 1, (path, include, result.stdout))
            self.assertIn(f"{path}:2: includes", result.stdout)

    def test_accepts_arrows_down(self):
        for path, include in [
            ("runtime/a.h", '"model/error.h"'),
            ("actors/pgo/pgo_actor.h", '"runtime/actor.h"'),
            ("actors/pgo/solver.h", "<ceres/ceres.h>"),
            ("client/client.h", '"model/error.h"'),
            ("apps/a/a.h", '"client/client.h"'),
        ]:
            self.assertEqual(self.check(path, include).returncode, 0, (path, include))

    def test_fails_where_there_is_nothing_to_check(self):
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(run(folder).returncode, 1)


if __name__ == "__main__":
    unittest.main()
