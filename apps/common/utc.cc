#include "apps/common/utc.h"

#include <cstdio>

namespace moondb {

std::optional<std::chrono::sys_seconds> ParseUtc(const std::string& text) {
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, second = 0, end = 0;
  if (std::sscanf(text.c_str(), "%4d-%2d-%2dT%2d:%2d%n", &year, &month, &day, &hour, &minute, &end) != 5) return {};
  std::string rest = text.substr(static_cast<std::size_t>(end));
  if (std::sscanf(rest.c_str(), ":%2d%n", &second, &end) == 1) rest = rest.substr(static_cast<std::size_t>(end));
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  const bool is_time = hour >= 0 && hour < 24 && minute >= 0 && minute < 60 && second >= 0 && second < 60;
  const bool is_near = year > 1677 && year < 2262;  // The years that 64-bit nanoseconds since 1970 can represent.
  if (rest != "Z" || !date.ok() || !is_time || !is_near) return {};
  return std::chrono::sys_days(date) + std::chrono::hours(hour) + std::chrono::minutes(minute) +
         std::chrono::seconds(second);
}

std::int64_t UtcNowNs() {
  const auto since_epoch = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(since_epoch).count();
}

}  // namespace moondb
