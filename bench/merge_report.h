// Prints the results of merge_bench.
#pragma once

#include <string>
#include <vector>

#include "bench/merge_contest.h"

namespace moondb {

// Returns a table of times, and of the naive merger's time divided by each contender's time.
std::string TableOf(const std::vector<MergeRun>& runs);

// Returns one JSON object. `runs` has one entry for each number of maps, `growth` one for each side length of the
// world. Each entry has the fields of MergeRun; null for a value that was not measured.
std::string JsonOf(const std::vector<MergeRun>& runs, const std::vector<MergeRun>& growth);

}  // namespace moondb
