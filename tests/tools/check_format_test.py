"""check_format must report tracked files that clang-format would change, and ignore untracked files."""
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent
SKIPPED = 77


def run(root):
    return subprocess.run([sys.executable, ROOT / "tools/check_format", root], capture_output=True, text=True)


class CheckFormatTest(unittest.TestCase):
    def check(self, tracked, untracked="int b;\n"):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            shutil.copy(ROOT / ".clang-format", root)
            (root / "a.h").write_text(tracked)
            subprocess.run(["git", "init", "-q", root], check=True)
            subprocess.run(["git", "-C", root, "add", "a.h"], check=True)
            (root / "b.h").write_text(untracked)
            result = run(root)
        if result.returncode == SKIPPED:
            self.skipTest(result.stdout)
        return result

    def test_refuses_what_clang_format_would_change(self):
        result = self.check("int  a;\n")
        self.assertEqual(result.returncode, 1)
        self.assertIn("a.h:1:", result.stdout)

    def test_takes_what_is_formatted_and_does_not_look_at_untracked_files(self):
        self.assertEqual(self.check("int a;\n", untracked="int  b;\n").returncode, 0)

    def test_fails_or_skips_where_there_is_nothing_to_check(self):
        with tempfile.TemporaryDirectory() as folder:
            self.assertNotEqual(run(folder).returncode, 0)


if __name__ == "__main__":
    unittest.main()
