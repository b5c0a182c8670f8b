// The ids of g2o vertices, which are 64-bit integers. Programs for several robots use the two layouts of GTSAM:
//
//   Symbol          letter of the robot (8 bits), index of the node (56 bits)
//   LabeledSymbol   kind of variable: a letter or 0 (8 bits), letter of the robot (8 bits), index of the node (48 bits)
//
// A plain id is the index of a node, and names no robot. Thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "model/ids.h"

namespace moondb {

// The largest index in a symbol. The next 8 bits of a Symbol are 0, because a LabeledSymbol has its label there.
inline constexpr std::uint64_t kSymbolIndexMax = (std::uint64_t{1} << 48) - 1;
// The largest plain id. Larger integers are other layouts, such as timestamps. As the index of a node, such an integer
// would permanently be the one from which the robot counts its own nodes.
inline constexpr std::uint64_t kPlainIdMax = (std::uint64_t{1} << 32) - 1;

// Returns the Symbol of a node. NodeKey::agent is the letter's position in the alphabet (AgentOfLetter in
// model/pyfg.h). Requires: the agent has a letter, and the index is at most kSymbolIndexMax.
std::uint64_t SymbolOf(const NodeKey& key);

// Returns the node of a Symbol or a LabeledSymbol. The agent of a plain id is 0. Returns nullopt for other ids.
std::optional<NodeKey> NodeOfId(std::uint64_t id);

// Returns the vertex as error texts name it: "b1 (id 7061644215716937729)", or "17" for an id without a robot.
std::string NameOfId(std::uint64_t id);

}  // namespace moondb
