"""check_logs must name a file that has more log lines without rate limit than its list allows."""
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent


class CheckLogsTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        for name in ("actors", "runtime"):
            shutil.copytree(ROOT / name, self.root / name)

    def check(self):
        return subprocess.run([sys.executable, ROOT / "tools/check_logs", self.root], capture_output=True, text=True)

    def test_takes_this_tree(self):
        self.assertEqual(self.check().returncode, 0, self.check().stdout)

    def test_names_a_file_that_logs_by_itself(self):
        with (self.root / "actors/sharing/sync_actor.cc").open("a") as file:
            file.write('void Flood() { spdlog::warn("a peer sent something"); }\n')
        result = self.check()
        self.assertEqual(result.returncode, 1)
        self.assertIn("actors/sharing/sync_actor.cc logs 1 line(s) by itself, and 0 are known", result.stdout)

    def test_names_a_line_that_is_gone(self):
        file = self.root / "actors/storage/bundle_shelf.cc"
        file.write_text(file.read_text().replace("spdlog::error(", "Ignore("))
        self.assertIn("actors/storage/bundle_shelf.cc logs 0 line(s) by itself, and 1 are known", self.check().stdout)


if __name__ == "__main__":
    unittest.main()
