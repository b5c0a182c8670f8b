// TUM: the text format of trajectories for evaluation tools (evo, rpg_trajectory_evaluation), with one agent per file.
//
//   timestamp x y z qx qy qz qw
//
// Timestamps are in seconds, lengths in metres. Empty lines and lines that begin with '#' are skipped. Writing and
// reading back is lossless, bit for bit.
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

// Parses a TUM file. `name` is the file's name in errors. Fails with kInvalid and the field "file:line" for:
//   - a line with too few or too many fields, or more than kGraphLineBytesMax bytes;
//   - a number that is not finite, an invalid timestamp, or a position beyond 1e9 m;
//   - a quaternion whose length is not 1 (within 1 %).
Result<std::vector<TumPose>> ParseTum(std::string_view text, const std::string& name);

// Like ParseTum, but reads the text from a file, block by block. Also fails with the errors of TextLines.
Result<std::vector<TumPose>> ReadTum(const std::filesystem::path& file);

// Returns the text of a TUM file. The notes precede the poses as comments, which evo and rpg_trajectory_evaluation
// skip.
std::string FormatTum(const std::vector<TumPose>& poses, const FileNotes& notes = {});

}  // namespace moondb
