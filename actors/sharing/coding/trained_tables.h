// The initial model of each run, trained by bench/learn_map_tables on generated maps. The model is part of the wire
// format. It is stored as text in trained_tables_data.cc.
#pragma once

#include <string>
#include <string_view>

#include "actors/sharing/coding/bit_model.h"

namespace moondb {

// Returns the initial model. The first call parses it from kTrainedTables. Thread-safe.
const BitModel& TrainedModel();

// WriteTables converts a model's slots, weights and rare probabilities to text, with reduced precision. ReadTables
// makes a new model from this text. ReadTables ends the program (Check) on text that WriteTables did not write.
std::string WriteTables(BitModel& model);
BitModel ReadTables(std::string_view text);

// The initial model as text, from trained_tables_data.cc. Empty if no model has been trained yet.
extern const std::string_view kTrainedTables;

}  // namespace moondb
