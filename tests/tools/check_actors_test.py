"""check_actors must name an actor that is missing in one of the places that list all actors."""
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent
FILES = ["runtime/address.h", "apps/moondb_agent/standard_actors.cc", "ARCHITECTURE.md"]


class CheckActorsTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        for file in FILES + [path.relative_to(ROOT).as_posix() for path in (ROOT / "actors").rglob("*_actor.h")]:
            (self.root / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / file, self.root / file)

    def check(self):
        return subprocess.run([sys.executable, ROOT / "tools/check_actors", self.root], capture_output=True, text=True)

    def remove_line(self, file, part):
        lines = (self.root / file).read_text().split("\n")
        left = [line for line in lines if part not in line]
        self.assertEqual(len(lines), len(left) + 1, part)
        (self.root / file).write_text("\n".join(left))

    def test_takes_this_tree(self):
        self.assertEqual(self.check().returncode, 0, self.check().stdout)

    def test_misses_a_row_among_the_standard_actors(self):
        self.remove_line("apps/moondb_agent/standard_actors.cc", "Make<LeaseActor>")
        result = self.check()
        self.assertEqual(result.returncode, 1)
        self.assertIn("actor_name::kLease of runtime/address.h has no row", result.stdout)
        self.assertIn("LeaseActor (actors/lease/lease_actor.h) has no row", result.stdout)

    def test_misses_a_row_of_the_page(self):
        self.remove_line("ARCHITECTURE.md", "| LeaseActor |")
        result = self.check()
        self.assertEqual(result.returncode, 1)
        self.assertIn("LeaseActor has no row in the table of actors in ARCHITECTURE.md", result.stdout)

    def test_misses_an_actor_that_is_gone(self):
        (self.root / "ARCHITECTURE.md").open("a").write("| SeismographActor | listens | pool |\n")
        self.assertIn("SeismographActor, a row in ARCHITECTURE.md, has none", self.check().stdout)


if __name__ == "__main__":
    unittest.main()
