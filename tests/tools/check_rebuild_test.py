"""check_rebuild must count the files that includes and imports reach, and find no exceeded limit in this tree."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).parent.parent.parent
PROTOS = {"proto/types.proto": "", "proto/status.proto": "", "proto/share_status.proto": "", "proto/control.proto": 'import "status.proto";\n'}
OTHERS = {f"model/other{i}.cc": "" for i in range(9)}


def run(files):
    with tempfile.TemporaryDirectory() as folder:
        for path, text in files.items():
            file = pathlib.Path(folder) / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
        return subprocess.run([sys.executable, ROOT / "tools/check_rebuild", folder], capture_output=True, text=True)


class CheckRebuildTest(unittest.TestCase):
    def test_counts_includes_through_headers_and_imports(self):
        files = PROTOS | OTHERS | {"model/a.h": '#include "proto/control.pb.h"\n', "model/a.cc": '#include "model/a.h"\n'}
        result = run(files)
        self.assertEqual(result.returncode, 0, result.stdout)
        self.assertIn("proto/status.proto: 10.0% of 10 .cc files depend on it", result.stdout)
        self.assertIn("proto/share_status.proto: 0.0% of 10 .cc files depend on it", result.stdout)

    def test_refuses_a_status_that_many_files_reach(self):
        result = run(PROTOS | OTHERS | {f"actors/{i}.cc": '#include "proto/status.pb.h"\n' for i in range(2)})
        self.assertEqual(result.returncode, 1, result.stdout)
        self.assertIn("too many: proto/status.proto: 18.2% of 11 .cc files depend on it", result.stdout)

    def test_refuses_message_that_imports_a_status(self):
        files = PROTOS | OTHERS | {"proto/message.proto": 'import "share_status.proto";\n'}
        files |= {f"runtime/{i}.cc": '#include "proto/message.pb.h"\n' for i in range(2)}
        self.assertEqual(run(files).returncode, 1)

    def test_refuses_types_proto_in_most_files(self):
        files = PROTOS | OTHERS | {f"actors/{i}.cc": '#include "proto/types.pb.h"\n' for i in range(7)}
        result = run(files)
        self.assertEqual(result.returncode, 1, result.stdout)
        self.assertIn("too many: proto/types.proto: 43.8% of 16 .cc files depend on it", result.stdout)

    def test_refuses_eigen_in_folders_that_compute_no_poses(self):
        for folder, expected in (("sharing", 1), ("role", 1), ("storage", 1), ("gateway", 1), ("pgo", 0)):
            files = PROTOS | OTHERS | {"model/pose.h": "#include <Eigen/Core>\n"}
            files[f"actors/{folder}/a.cc"] = '#include "model/pose.h"\n'
            result = run(files)
            self.assertEqual(result.returncode, expected, folder + result.stdout)
            self.assertEqual(f"actors/{folder}/a.cc: includes Eigen" in result.stdout, expected == 1)

    def test_refuses_cli11_in_three_files(self):
        files = PROTOS | OTHERS
        for i, expected in ((1, 0), (2, 0), (3, 1)):
            files[f"apps/{i}.cc"] = "#include <CLI/CLI.hpp>\n"
            self.assertEqual(run(files).returncode, expected)

    def test_fails_where_there_is_nothing_to_check(self):
        self.assertEqual(run({}).returncode, 1)
        self.assertEqual(run(OTHERS).returncode, 1)


if __name__ == "__main__":
    unittest.main()
