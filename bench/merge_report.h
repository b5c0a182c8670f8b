// How merge_bench prints what it measured.
#pragma once

#include <string>
#include <vector>

#include "bench/merge_contest.h"

namespace moondb {

// Times, and the ratio of the naive merger's to each.
std::string TableOf(const std::vector<MergeRun>& runs);

// One object: `runs` by number of maps, `growth` by side of the square, each as MergeRun; null for what is not there.
std::string JsonOf(const std::vector<MergeRun>& runs, const std::vector<MergeRun>& growth);

}  // namespace moondb
