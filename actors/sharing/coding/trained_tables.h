// What a run's model knows at its beginning: learnt by bench/learn_map_tables from generated maps, and part of the wire
// format. The text lies in trained_tables_data.cc.
#pragma once

#include <string>
#include <string_view>

#include "actors/sharing/coding/bit_model.h"

namespace moondb {

// Read once, on the first call. Safe from any thread.
const BitModel& TrainedModel();

// A model's slots, weights and rare probabilities as text, some precision less, and into a new model. For the tool that
// learns and for TrainedModel; the text is the project's own, and Check stops on any other.
std::string WriteTables(BitModel& model);
BitModel ReadTables(std::string_view text);

// The committed text; empty: nothing is learnt yet.
extern const std::string_view kTrainedTables;

}  // namespace moondb
