// `moonctl map why`, `map stats` and `map quarantine`: show which maps a cell of the merged map comes from, and exclude
// maps.
#pragma once

#include <cstdint>
#include <string>

#include "apps/moonctl/command_context.h"
#include "proto/map.pb.h"

namespace moondb {

class Command;

// Returns the name of a cell's value in an answer to `map why`: "hazard".
const char* CellValueName(std::uint32_t value);
// Returns why an observation is special: "it stood there", "quarantined, clock suspect". Empty: it is not.
std::string RemarkOn(const proto::MapObservation& said);

void AddMapQuestions(Command& group, CommandContext& context);
// Adds `moonctl map overlap`, which draws two local maps over each other.
void AddMapOverlap(Command& group, CommandContext& context);

}  // namespace moondb
