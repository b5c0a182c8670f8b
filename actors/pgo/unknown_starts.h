// Where rovers are whose start nobody has given.
//
// Ranges to the rest of the team say it, often in more than one way: a rover that ranges one other from a straight line
// may be on either side of it. So several beginnings are offered, and whoever solves from each compares the ends. That
// goes on after the first solve: a rover is only ever as certain as its ranges, and what tells the sides comes later.
// Pure functions.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "actors/pgo/initial_values.h"

namespace moondb {

// Places in `rovers` of those without a configured start that ranges join with others.
std::vector<std::size_t> FindUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                           const std::vector<StartPrior>& starts);

// Initial values with the unknown rovers set down by their ranges (arrangement.h), each as a body that stands upright,
// as gravity has it: the best arrangements, best first. Of rovers that ranges join with each other and with nothing
// whose place and yaw are known, the one with the most ranges stands where `initial` has it; with a base station alone
// it does so from the second solve on, when it stands right but for the yaw that nobody knows.
//
// Where `initial` holds poses of an unknown rover's last solution, only arrangements elsewhere are given, and only
// those that fit the ranges nearly as well as what is there, or better: none while the places are settled.
std::vector<InitialValues> ArrangeUnknownRovers(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                                const std::vector<StartPrior>& starts,
                                                const std::vector<std::size_t>& unknown, const AgentFactsMap& agents,
                                                const InitialValues& initial,
                                                const std::function<bool()>& stop_requested);

// Whether the last solution had a node of the rover.
bool HasWarmNode(const Rover& rover, const InitialValues& initial);

}  // namespace moondb
