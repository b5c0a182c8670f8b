// `moonctl map quarantine` and `moonctl graph quarantine`.
#pragma once

#include <string>

#include "apps/moonctl/command_context.h"
#include "proto/record.pb.h"
#include "proto/team.pb.h"

namespace moondb {

class Command;

void AddMapQuarantine(Command& group, CommandContext& context);
void AddGraphQuarantine(Command& group, CommandContext& context);

// Describes what a quarantine leaves out: "maps", "node rover3:500", "range rover1:9 rover2:9", "prior rover2:4 gnss",
// "loop closures and priors of apriltag".
std::string QuarantinedText(const proto::TeamConfig& team, const proto::MapQuarantine& quarantine);

}  // namespace moondb
