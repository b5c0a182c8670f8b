// Prints the results of merge_bench.
#pragma once

#include <string>
#include <vector>

#include "bench/merge_contest.h"

namespace moondb {

// Returns a table of times, and of the ratio of the naive merger's time to each contender's time.
std::string TableOf(const std::vector<MergeRun>& runs);

// Returns one JSON object: `runs` by number of maps and `growth` by side of the square. Each entry has the fields of
// MergeRun, null if not measured.
std::string JsonOf(const std::vector<MergeRun>& runs, const std::vector<MergeRun>& growth);

}  // namespace moondb
