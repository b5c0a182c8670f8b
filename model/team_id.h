// Team ids: 128 random bits that distinguish a team from all others, including one with the same name.
//
// A team id has 32 hexadecimal digits in team files, and 16 bytes in messages. Thread-safe.
#pragma once

#include <string>
#include <string_view>

#include "model/error.h"

namespace moondb {

inline constexpr std::size_t kTeamIdDigits = 32;
inline constexpr std::size_t kTeamIdBytes = 16;

// Returns whether the text consists of 32 lower-case hexadecimal digits.
bool IsTeamId(std::string_view text);

// Returns a new id from the system's random generator. Fails with kInternal if the generator fails.
Result<std::string> MakeTeamId();

// Converts an id from its digits to the bytes in messages. Returns an empty string for text that is not a team id.
std::string TeamIdBytes(std::string_view team_id);

// Returns the first eight digits of a team id given as bytes, for people and for paths. Two teams on one machine are
// unlikely to have the same eight digits. Returns "none" for an empty id. `bytes` may come from an untrusted sender and
// have any length.
std::string TeamIdStart(std::string_view bytes);

}  // namespace moondb
