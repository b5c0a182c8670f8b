// The paper's figure 7, of merge_bench's runs: time over number of maps, both logarithmic.
#pragma once

#include <vector>

#include "bench/merge_contest.h"
#include "model/png.h"

namespace moondb {

Image PlotOf(const std::vector<MergeRun>& runs);

}  // namespace moondb
