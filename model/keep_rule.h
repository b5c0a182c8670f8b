// KeepRule: how long a robot's own disk keeps states that newer ones have superseded (TeamConfig.keep). Plain values.
#pragma once

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

namespace moondb {

struct KeepRule {
  // By their stamps. Zero: none is kept.
  std::chrono::milliseconds at_most = std::chrono::milliseconds::max();

  bool KeepsAny() const { return at_most > std::chrono::milliseconds::zero(); }
  bool IsOfAnyAge() const { return at_most == std::chrono::milliseconds::max(); }
  friend bool operator==(const KeepRule&, const KeepRule&) = default;
};

// "all", "latest", or whole seconds in d, h, m or s, up to 36500 d: "7d", "12h". Nothing for anything else.
std::optional<KeepRule> ParseKeepRule(std::string_view text);
std::string ToString(const KeepRule& rule);

}  // namespace moondb
