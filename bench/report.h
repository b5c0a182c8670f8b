// Prints the results of runtime_bench.
#pragma once

#include <string>
#include <vector>

#include "bench/measure.h"

namespace moondb {

// Returns a table with the median, minimum, maximum and processor time of each contender, and moondb's median divided
// by the contender's median.
std::string TableOf(const Section& section);

// Returns one JSON object with one object per section: its unit, each contender's median under the contender's name,
// all samples, and the median processor time if it was measured.
std::string Json(const std::vector<Section>& sections);

}  // namespace moondb
