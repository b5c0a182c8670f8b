"""tools/tidy must accept names in the project's spelling, and report faults and names in other spellings."""
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent
SKIPPED = 77
RIGHT = """
constexpr int kDay_s = 86400;
class Motor {
 public:
  bool is_running() const { return speed_ > 0; }
  int Speed() const { return speed_; }

 private:
  int speed_ = kDay_s;
};
int Twice(const Motor& one_motor) {
  const int own_speed = one_motor.Speed();
  return 2 * own_speed;
}
"""


class TidyTest(unittest.TestCase):
    def check(self, text):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            shutil.copy(ROOT / ".clang-tidy", root)
            (root / "a.cc").write_text(text)
            command = {"directory": folder, "file": f"{folder}/a.cc", "command": f"c++ -std=c++20 -c {folder}/a.cc"}
            (root / "compile_commands.json").write_text(json.dumps([command]))
            result = subprocess.run([sys.executable, ROOT / "tools/tidy", "--build", root, root / "a.cc"],
                                    capture_output=True, text=True)
        if result.returncode == SKIPPED:
            self.skipTest(result.stdout)
        return result

    def test_takes_accessors_and_constants_as_the_project_spells_them(self):
        result = self.check(RIGHT)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

    def test_refuses_other_spellings(self):
        for right, wrong in [("speed_", "speed"), ("own_speed", "ownSpeed"), ("kDay_s", "day_s"), ("Motor", "motor_type"),
                             ("Twice", "twiceAs")]:
            result = self.check(RIGHT.replace(right, wrong))
            self.assertEqual(result.returncode, 1, wrong)
            self.assertIn("readability-identifier-naming", result.stdout, wrong)

    def test_refuses_faults(self):
        for fault, name in [("int Fault(int a) { if (a == 1 || a == 1) return 1; return 0; }\n", "misc-redundant-expression"),
                            ("int Fault() { int* p = nullptr; return *p; }\n", "clang-analyzer-core.NullDereference"),
                            ("int Fault() { return sizeof(sizeof(int)); }\n", "bugprone-sizeof-expression")]:
            result = self.check(RIGHT + fault)
            self.assertEqual(result.returncode, 1, fault)
            self.assertIn(name, result.stdout)


if __name__ == "__main__":
    unittest.main()
