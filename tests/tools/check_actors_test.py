"""check_actors must name an actor that is missing in one of the places that list all actors."""
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent
FILES = ["runtime/address.h", "apps/moondb_agent/standard_actors.cc", "ARCHITECTURE.md", "proto/message.proto",
         *(f"runtime/{name}.{suffix}" for name in ("record_reader", "derived_reader", "record_writer") for suffix in ("h", "cc"))]


class CheckActorsTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        for file in FILES + [path.relative_to(ROOT).as_posix() for path in (ROOT / "actors").rglob("*.*")]:
            (self.root / file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / file, self.root / file)

    def check(self, *options):
        return subprocess.run([sys.executable, ROOT / "tools/check_actors", *options, self.root], capture_output=True,
                              text=True)

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
        self.remove_line("ARCHITECTURE.md", "| LeaseActor | Tracks")
        result = self.check()
        self.assertEqual(result.returncode, 1)
        self.assertIn("LeaseActor has no row in the table of actors in ARCHITECTURE.md", result.stdout)

    def test_misses_an_actor_that_is_gone(self):
        (self.root / "ARCHITECTURE.md").open("a").write("| SeismographActor | listens | pool |\n")
        self.assertIn("SeismographActor, a row in ARCHITECTURE.md, has none", self.check().stdout)

    def test_keeps_the_table_of_messages_up_to_date(self):
        source = self.root / "actors/lease/lease_actor.cc"
        source.write_text(source.read_text() + "void F() {\n  proto::Message note;\n  note.mutable_peer_clock();\n}\n")
        self.assertIn('the table "Messages" of ARCHITECTURE.md is out of date', self.check().stdout)
        self.assertEqual(self.check("--write").returncode, 0)
        page = (self.root / "ARCHITECTURE.md").read_text()
        row = next(line for line in page.split("\n") if line.startswith("| LeaseActor | Timer"))
        self.assertIn("PeerClock", row.split("|")[3])
        self.assertEqual(self.check().returncode, 0)

    def test_does_not_take_a_field_of_another_message_for_a_body(self):
        source = self.root / "actors/lease/lease_actor.cc"
        source.write_text(source.read_text() + "void F() {\n  proto::EpochReport note;\n  note.mutable_have();\n}\n")
        self.assertEqual(self.check().returncode, 0, self.check().stdout)


if __name__ == "__main__":
    unittest.main()
