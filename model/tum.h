// TUM: the text format of trajectories that evaluation tools read (evo, rpg_trajectory_evaluation), one agent a file.
//
//   stamp x y z qx qy qz qw
//
// Stamps are seconds, lengths metres. Empty lines and lines that begin with '#' are skipped. What was read is written
// so that it reads back the same, bit for bit.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/file_notes.h"
#include "model/geometry.h"

namespace moondb {

struct TumPose {
  std::int64_t timestamp_ns = 0;
  Pose map_from_body;
};

// kInvalid with field "file:line": too few or too many fields, a number that is not finite, a stamp that is none, a
// quaternion not of length 1 (within 1 %), a position beyond 1e9 m, a line longer than kGraphLineBytesMax. `name`
// stands for the file in errors.
Result<std::vector<TumPose>> ParseTum(std::string_view text, const std::string& name);

// The same from a file, which is read block by block; also the errors of TextLines.
Result<std::vector<TumPose>> ReadTum(const std::filesystem::path& file);

// The notes stand above the poses as comments, which evo and rpg_trajectory_evaluation skip too.
std::string FormatTum(const std::vector<TumPose>& poses, const FileNotes& notes = {});

}  // namespace moondb
