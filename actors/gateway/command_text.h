// A request in words, for the story of what an agent was told to do. Plain function.
#pragma once

#include <string>

#include "proto/control.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// "role set: leader rover2 (sun is low)". Empty for questions, and for what is told many times a minute by robots'
// software or writes its own record: insert, and that a robot drives or sleeps.
std::string CommandText(const proto::TeamConfig& team, const proto::ControlRequest& request);

}  // namespace moondb
