"""check_snippets must report each kind of wrong snippet, and find none in this tree."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent
SOURCE = "class Actor {\n  void OnStart() {\n    Read();\n  }\n\n  void OnMessage() {\n    Write();\n  }\n};\n"


def run(root):
    return subprocess.run([sys.executable, ROOT / "tools/check_snippets", root], capture_output=True, text=True)


class CheckSnippetsTest(unittest.TestCase):
    def check(self, snippet, file="a.h"):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "docs").mkdir()
            (root / "a.h").write_text(SOURCE)
            (root / "README.md").write_text("")
            (root / "docs/guide.md").write_text(f"Text.\n\n```cpp {file}\n{snippet}```\n")
            return run(folder)

    def test_takes_what_the_file_says_with_less_indentation_and_with_gaps(self):
        for snippet in [SOURCE, "void OnStart() {\n  Read();\n}\n", "void OnStart() {\n// ...\n  Write();\n}\n"]:
            self.assertEqual(self.check(snippet).returncode, 0, snippet)

    def test_refuses_other_words_other_order_and_other_indentation(self):
        for snippet in ["void OnStart() {\n  Reads();\n}\n", "Write();\n...\nRead();\n", "void OnStart() {\nRead();\n"]:
            result = self.check(snippet)
            self.assertEqual(result.returncode, 1, snippet)
            self.assertIn("docs/guide.md:3: a.h does not say", result.stdout)

    def test_refuses_a_file_that_is_not_there_and_a_guide_without_snippets(self):
        self.assertIn("there is no file b.h", self.check(SOURCE, file="b.h").stdout)
        with tempfile.TemporaryDirectory() as folder:
            (pathlib.Path(folder) / "README.md").write_text("")
            self.assertEqual(run(folder).returncode, 1)

    def test_this_tree_has_none(self):
        result = run(ROOT)
        self.assertEqual(result.returncode, 0, result.stdout)


if __name__ == "__main__":
    unittest.main()
