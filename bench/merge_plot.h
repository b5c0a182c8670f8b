// Plots merge_bench's runs as in the paper's figure 7: time over number of maps, both axes logarithmic.
#pragma once

#include <vector>

#include "bench/merge_contest.h"
#include "model/png.h"

namespace moondb {

Image PlotOf(const std::vector<MergeRun>& runs);

}  // namespace moondb
