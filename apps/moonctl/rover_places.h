// Texts about what the matching of maps says about the places of rovers. Thread-safe.
#pragma once

#include <map>
#include <string>

#include "model/ids.h"
#include "proto/registration.pb.h"
#include "proto/team.pb.h"

namespace moondb {

// Says in one line for each two rovers how far the search for their relative pose came, and what would help; then in
// one line for each rover what FindContradicted says.
std::string PlacesText(const proto::TeamConfig& team, const proto::RegistrationReply& state);

// Says how far the search for a rover that is not placed came: the search with the most evidence, and what would help.
// Empty if the rover was not searched for.
std::string SearchText(const proto::TeamConfig& team, const proto::RegistrationReply& state, AgentId rover);

// Returns a text about each rover whose maps contradict those of others where the last solve placed it. If two
// rovers contradict each other, it names that one which more of the others contradict, or both if these are as many.
std::map<AgentId, std::string> FindContradicted(const proto::TeamConfig& team, const proto::RegistrationReply& state);

}  // namespace moondb
