// KeepRule: how long an agent keeps superseded states of its own robot on its disk (TeamConfig.keep). Value type.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

namespace moondb {

struct KeepRule {
  // Maximum age of a superseded state, by its timestamp. Zero: no superseded state is kept. max(): all are kept.
  std::chrono::milliseconds at_most = std::chrono::milliseconds::max();

  bool KeepsAny() const { return at_most > std::chrono::milliseconds::zero(); }
  bool IsOfAnyAge() const { return at_most == std::chrono::milliseconds::max(); }
  friend bool operator==(const KeepRule&, const KeepRule&) = default;
};

// Parses "all", "latest", or a duration with a unit (d, h, m or s): "7d", "12h". A duration is a whole number of
// seconds and at most 36500 d. Returns nullopt for other text.
std::optional<KeepRule> ParseKeepRule(std::string_view text);
std::string ToString(const KeepRule& rule);

}  // namespace moondb
