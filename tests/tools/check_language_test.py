"""check_language must report one planted example of each rule, and nothing in plain text."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent


class CheckLanguageTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        subprocess.run(["git", "init", "-q", self.root], check=True)

    def check(self, name, text):
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        result = subprocess.run([sys.executable, ROOT / "tools/check_language", self.root], capture_output=True, text=True)
        path.unlink()
        lines = result.stdout.splitlines()[:-1]
        self.assertEqual(result.returncode, 1 if lines else 0, result.stdout + result.stderr)
        return lines

    def assert_finds(self, finding, name, text):
        lines = self.check(name, text)
        self.assertEqual(len(lines), 1, lines)
        self.assertTrue(lines[0].startswith(f"{name}:{finding}"), lines[0])

    def test_lists_printed_texts(self):
        path = self.root / "a.cc"
        path.write_text('// "a comment of five words"\nFail("cannot read " + path + ": " +\n     "is it a file?");\n'
                        'Check(a, "a batch has records");\n')
        result = subprocess.run([sys.executable, ROOT / "tools/check_language", "--texts", self.root], capture_output=True,
                                text=True)
        self.assertEqual(result.stdout, "a.cc:2: cannot read {}: is it a file?\n")

    def test_finds_faults_of_printed_texts(self):
        self.assert_finds("1: word: ", "a.cc", 'Fail("it leaves out the maps");\n')
        self.assert_finds("1: word: ", "a.cc", 'Fail("Stray rows are removed");\n')
        self.assert_finds("1: verb: ", "a.cc", 'return Fail("the agent of this machine");\n')
        self.assert_finds("1: word: ", "a.h", "void NoteSent(int count);\n")
        self.assertEqual(self.check("tests/a.cc", 'Fail("the agent of this machine");\n'), [])

    def test_takes_plain_text(self):
        self.assertEqual(self.check("a.cc", "// The receiver drops the batch.\nint a = 1;  // Bytes.\n"), [])
        self.assertEqual(self.check("a.md", "# Words\n\nThe leader sends records. Where do they go?\n"), [])

    def test_finds_openings(self):
        for opening in ("What is refused there goes.", "Who leads decides.", "Whoever reads it waits.", "That of the peer.",
                        "Of the last answer.", "As with peers, it waits.", "Where it fails, the batch goes."):
            with self.subTest(opening):
                lines = self.check("a.cc", f"// {opening}\n")
                self.assertTrue(any(line.startswith("a.cc:1: opening: ") for line in lines), lines)
        self.assert_finds("2: opening: ", "a.cc", "// The receiver drops it.\n// Of the batch.\n")
        self.assert_finds("3: opening: ", "a.md", "Text.\n\nWhat a peer lacks is sent.\n")

    def test_takes_questions_and_quoted_text(self):
        self.assertEqual(self.check("a.md", 'Print "What is told" and `is_told`.\n\n```\ntold\n```\n\n    told\n'), [])
        self.assertEqual(self.check("a.md", "| Instead of | Write |\n|---|---|\n| told | notified |\n"), [])

    def test_finds_private_words_in_comments_pages_printed_texts_and_names(self):
        self.assert_finds("1: word: ", "a.cc", "// The actor is made anew.\n")
        self.assert_finds("1: word: ", "a.md", "The actor is made anew.\n")
        self.assert_finds("1: word: ", "a.cc", 'Print("the actor is made anew");\n')
        self.assert_finds("1: word: ", "a.py", 'print("the actor is made anew")\n')
        self.assert_finds("1: word: ", "a.cc", "TEST(ActorTest, IsMadeAnewAfterAFailure) {}\n")
        self.assert_finds("1: word: ", "a.cc", "class PeerDoor;\n")
        self.assert_finds("1: word: ", "a.proto", "sfixed64 stamp_ns = 1;\n")

    def test_finds_some_words_in_some_folders_only(self):
        self.assert_finds("1: word: ", "proto/a.proto", "// A piece of the batch.\n")
        self.assertEqual(self.check("model/a.h", "// A piece of the batch.\n"), [])

    def test_finds_short_comments_without_a_noun(self):
        self.assert_finds("1: noun: ", "a.cc", "// Otherwise none.\nint a = 1;\n")
        self.assertEqual(self.check("a.cc", "int a = 1;  // Optional.\n"), [])

    def test_finds_long_sentences(self):
        self.assert_finds("1: length: 36 words", "a.cc", "// " + "Word " * 20 + "\n// " + "word " * 15 + "word.\n")
        self.assertEqual(self.check("a.cc", "// " + "Word " * 34 + "word.\n"), [])


if __name__ == "__main__":
    unittest.main()
