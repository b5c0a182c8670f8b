"""build_times must print the last time of each step, largest first, and name files that are compiled as one unit."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent
UNITY = "model/CMakeFiles/moondb_model.dir/Unity/unity_0_cxx.cxx"
LOG = f"""# ninja log v5
0\t9000\t1\tactors/pgo/CMakeFiles/moondb_pgo.dir/factors.cc.o\tabc
0\t2000\t1\t{UNITY}.o\tabc
100\t4100\t1\tactors/pgo/CMakeFiles/moondb_pgo.dir/factors.cc.o\tabc
0\t1000\t1\tactors/pgo/CMakeFiles/moondb_pgo.dir/ground.cc.o\tabc
0\t500\t1\tbin/moonctl\tabc
"""


def run(*arguments):
    return subprocess.run([sys.executable, ROOT / "tools/build_times", *arguments], capture_output=True, text=True)


class BuildTimesTest(unittest.TestCase):
    def test_prints_the_last_time_of_each_step(self):
        with tempfile.TemporaryDirectory() as folder:
            build = pathlib.Path(folder)
            (build / ".ninja_log").write_text(LOG)
            (build / UNITY).parent.mkdir(parents=True)
            (build / UNITY).write_text('#include "/src/model/ids.cc"\n\n#include "/src/model/term.cc"\n')
            result = run("--build", folder, "--count", "2")
        self.assertEqual(result.stdout, """files:
     4.0 s  actors/pgo: factors.cc
     2.0 s  model: ids.cc term.cc
folders:
     5.0 s  actors/pgo
     2.0 s  model
all steps: 8 s
""")

    def test_says_how_to_build_if_there_is_no_build(self):
        result = run("--build", "/nonexistent")
        self.assertEqual(result.returncode, 1)
        self.assertIn("build first: tools/build dev", result.stderr)


if __name__ == "__main__":
    unittest.main()
