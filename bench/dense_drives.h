// Matches the maps of rovers that store one each 0.2 m in one building, in passes as RegisterActor does.
#pragma once

#include <string>
#include <vector>

namespace moondb {

struct DensePass {
  std::size_t map_count = 0;
  std::size_t pair_count = 0;
  std::size_t accepted_count = 0;
  std::size_t left_out_count = 0;
  double error_m = 0;  // Median error of the accepted matches.
  double seconds = 0;  // CPU time, with the plan and the fields of the maps.
};

// Runs passes until one has no pair, at most 5: three rovers, 798 maps each, and poses that drift by 1 % of the
// distance.
std::vector<DensePass> MatchDenseDrives();

std::string TextOf(const std::vector<DensePass>& passes);

}  // namespace moondb
