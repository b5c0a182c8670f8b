// How runtime_bench prints what it measured.
#pragma once

#include <string>
#include <vector>

#include "bench/measure.h"

namespace moondb {

// One line a section: medians, the least and the greatest, and moondb's ratio to each of the others.
std::string TableLine(const Section& section);

// One object with an object for each section: its unit, and each contender's median under its name.
std::string Json(const std::vector<Section>& sections);

}  // namespace moondb
