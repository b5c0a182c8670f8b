// Prints the results of runtime_bench.
#pragma once

#include <string>
#include <vector>

#include "bench/measure.h"

namespace moondb {

// Returns a table of medians, minima, maxima, processor time, and the ratio of moondb to each other contender.
std::string TableOf(const Section& section);

// Returns one JSON object with one object per section: its unit, each contender's median under the contender's name,
// all samples, and the median processor time if it was measured.
std::string Json(const std::vector<Section>& sections);

}  // namespace moondb
