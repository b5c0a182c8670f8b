// Plots merge_bench's runs as in the paper's figure 7: time over number of maps, both axes logarithmic.
#pragma once

#include <filesystem>
#include <vector>

#include "bench/merge_contest.h"
#include "model/error.h"

namespace moondb {

// Writes a PNG or an SVG file, depending on the extension of `file`. Returns the errors of WriteDrawing
// (apps/picture/drawing.h).
Result<void> WritePlot(const std::vector<MergeRun>& runs, const std::filesystem::path& file);

}  // namespace moondb
