"""check_links must report each kind of broken link, and accept intact links."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent
OTHER = "# Title\n\n## What `--wait` waits for\n\n## Again\n\n## Again\n\n```\n# no heading\n[no](link.md)\n```\n"


def run(root):
    return subprocess.run([sys.executable, ROOT / "tools/check_links", root], capture_output=True, text=True)


class CheckLinksTest(unittest.TestCase):
    def check(self, text):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for name in ("docs", "build"):
                (root / name).mkdir()
            (root / "docs/other.md").write_text(OTHER)
            (root / "docs/picture.png").write_text("")
            (root / "build/of_others.md").write_text("[broken](gone.md)\n")
            (root / "page.md").write_text("# Page\n\n" + text)
            return run(folder)

    def test_takes_files_folders_pictures_headings_and_addresses(self):
        for link in ("[a](docs/other.md)", "[a](docs/)", "![a](docs/picture.png)", "[a](#page)", "[over\ntwo](docs/other.md#title)",
                     "[a](docs/other.md#what---wait-waits-for)", "[a](docs/other.md#again-1)"):
            result = self.check(link + " [b](https://example.org/gone#x)\n")
            self.assertEqual(result.returncode, 0, (link, result.stdout))

    def test_refuses_what_is_not_there(self):
        for link in ("[a](docs/gone.md)", "[a](other.md)", "![a](docs/gone.png)", "[a](#gone)", "[a](docs/other.md#again-2)",
                     "[a](docs/other.md#no-heading)", "[over\ntwo](docs/gone.md)"):
            result = self.check("One.\n" + link + "\n")
            self.assertEqual(result.returncode, 1, link)
            self.assertIn("page.md:", result.stdout)

    def test_does_not_read_code(self):
        self.assertEqual(self.check("[a](#page) `[b](gone.md)`\n\n```\n[c](gone.md)\n```\n").returncode, 0)

    def test_reads_paths_in_code(self):
        self.assertEqual(self.check("[a](#page) `docs/other.md` `docs/*.png` `docs/other` `tea/pot`\n").returncode, 0)
        result = self.check("[a](#page) `docs/gone.md`\n")
        self.assertEqual(result.returncode, 1)
        self.assertIn("page.md:3: no docs/gone.md", result.stdout)

    def test_fails_where_there_are_no_links(self):
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(run(folder).returncode, 1)


if __name__ == "__main__":
    unittest.main()
