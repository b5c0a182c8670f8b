#include "model/keep_rule.h"

#include "model/duration.h"

namespace moondb {

namespace {

constexpr std::string_view kAll = "all";
constexpr std::string_view kLatest = "latest";
constexpr std::chrono::milliseconds kLongest = std::chrono::hours(24 * 36'500);

}  // namespace

std::optional<KeepRule> ParseKeepRule(std::string_view text) {
  if (text == kAll) return KeepRule{};
  if (text == kLatest) return KeepRule{std::chrono::milliseconds::zero()};
  // Reject a bare number: in a team file, readers could take it for days or for a number of records.
  if (text.empty() || (text.back() >= '0' && text.back() <= '9') || text.ends_with("ms")) return std::nullopt;
  const std::optional<std::chrono::milliseconds> duration = ParseDuration(text, kLongest);
  if (!duration || *duration % std::chrono::seconds(1) != std::chrono::milliseconds::zero()) return std::nullopt;
  return KeepRule{*duration};
}

std::string ToString(const KeepRule& rule) {
  if (rule.IsOfAnyAge()) return std::string(kAll);
  return rule.KeepsAny() ? FormatDuration(rule.at_most) : std::string(kLatest);
}

}  // namespace moondb
