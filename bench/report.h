// How runtime_bench prints what it measured.
#pragma once

#include <string>
#include <vector>

#include "bench/measure.h"

namespace moondb {

// Medians, the least and the greatest, the processor's time, and moondb's ratio to each of the others.
std::string TableOf(const Section& section);

// One object with an object for each section: its unit, each contender's median under its name,
// all samples, and the medians of the processor's time where it was measured.
std::string Json(const std::vector<Section>& sections);

}  // namespace moondb
