"""check_requirements must report each kind of name (test, suite, script, path) that does not exist."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent
HEAD = "| Demand | Where | Shown by |\n|---|---|---|\n"


def run(root):
    return subprocess.run([sys.executable, ROOT / "tools/check_requirements", root], capture_output=True, text=True)


class CheckRequirementsTest(unittest.TestCase):
    def check(self, rows):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for name in ("docs", "tests", "model"):
                (root / name).mkdir()
            (root / "tests/a_test.cc").write_text("TEST(ATest, Works) {}\nTEST_P(BTest,\n       WorksForEach) {}\n")
            (root / "tests/CMakeLists.txt").write_text("add_test(NAME ScriptTest COMMAND a)\n")
            (root / "docs/REQUIREMENTS.md").write_text(HEAD + rows)
            return run(folder)

    def test_knows_cases_suites_and_scripts(self):
        result = self.check("| Works | `model/` | `ATest.Works`, `BTest`, `BTest.WorksForEach`, `ScriptTest`\\* |\n")
        self.assertEqual(result.returncode, 0, result.stdout)

    def test_refuses_names_that_are_not_there(self):
        for shown_by in ("`ATest.Worked`", "`CTest`", "`OtherScriptTest`", "`ATest.Works`, `ATest.WorksForEach`"):
            result = self.check(f"| Works | `model` | {shown_by} |\n")
            self.assertEqual(result.returncode, 1, shown_by)
            self.assertIn("docs/REQUIREMENTS.md:3: there is no test", result.stdout)

    def test_refuses_a_path_that_is_not_there(self):
        result = self.check("| Works | `model/gone.h` | `ATest.Works` |\n")
        self.assertEqual(result.returncode, 1)
        self.assertIn("there is no model/gone.h", result.stdout)

    def test_fails_where_no_test_is_named(self):
        self.assertEqual(self.check("").returncode, 1)


if __name__ == "__main__":
    unittest.main()
