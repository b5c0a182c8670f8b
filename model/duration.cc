#include "model/duration.h"

#include <array>
#include <cstdint>

#include "model/text.h"

namespace moondb {

namespace {

struct Unit {
  std::string_view name;
  std::int64_t milliseconds;
};

// Sorted from the largest unit. If a unit has two names, FormatDuration writes the first.
constexpr std::array<Unit, 6> kUnits = {
    {{"d", 86'400'000}, {"h", 3'600'000}, {"m", 60'000}, {"min", 60'000}, {"s", 1000}, {"ms", 1}}};

}  // namespace

std::optional<std::chrono::milliseconds> ParseDuration(std::string_view text, std::chrono::milliseconds longest) {
  const std::size_t unit_at = text.find_first_not_of("0123456789.");
  const std::string_view unit = unit_at == std::string_view::npos ? "s" : text.substr(unit_at);
  const std::optional<double> number = ParseDouble(text.substr(0, unit_at));
  if (!number) return std::nullopt;
  for (const Unit& known : kUnits) {
    if (unit != known.name) continue;
    const double milliseconds = *number * static_cast<double>(known.milliseconds);
    if (milliseconds < 1 || milliseconds > static_cast<double>(longest.count())) return std::nullopt;
    return std::chrono::milliseconds(static_cast<std::int64_t>(milliseconds));
  }
  return std::nullopt;
}

std::string FormatDuration(std::chrono::milliseconds duration) {
  for (const Unit& unit : kUnits) {
    if (duration.count() % unit.milliseconds != 0) continue;
    return std::to_string(duration.count() / unit.milliseconds) + std::string(unit.name);
  }
  return std::to_string(duration.count()) + "ms";
}

}  // namespace moondb
