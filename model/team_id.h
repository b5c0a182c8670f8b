// A team's id: 128 random bits, which tell it from every other team, one of the same name included.
//
// Team files hold it as 32 hexadecimal digits, messages as its 16 bytes. Plain functions, any thread.
#pragma once

#include <string>
#include <string_view>

#include "model/error.h"

namespace moondb {

inline constexpr std::size_t kTeamIdDigits = 32;
inline constexpr std::size_t kTeamIdBytes = 16;

// 32 lower-case hexadecimal digits.
bool IsTeamId(std::string_view text);

// A new one, from the system's source of randomness; kInternal where it gives none.
Result<std::string> MakeTeamId();

// As messages carry it; empty for what is no team id.
std::string TeamIdBytes(std::string_view team_id);

// The first eight digits, for people and for paths: two teams on one machine hardly share these. "none" for no bytes;
// what a stranger sent may have any length.
std::string TeamIdStart(std::string_view bytes);

}  // namespace moondb
