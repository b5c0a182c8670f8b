#include "apps/moonctl/time_span_option.h"

#include <chrono>

#include "apps/common/utc.h"
#include "model/duration.h"

namespace moondb {
namespace {

using std::chrono::nanoseconds;

constexpr std::chrono::hours kAgeMax(24 * 365 * 100);

}  // namespace

Result<std::int64_t> ParseTimeOrAge(const std::string& text, std::int64_t now_ns, const char* option) {
  if (const auto time = ParseUtc(text))
    return std::chrono::duration_cast<nanoseconds>(time->time_since_epoch()).count();
  if (const auto age = ParseDuration(text, kAgeMax)) return now_ns - nanoseconds(*age).count();
  return Fail(ErrorCode::kInvalid,
              "expected a time in UTC such as 2026-11-22T06:00Z, or an age such as 10m or 12h, got \"" + text + "\"",
              option);
}

void AddTimeSpanOptions(Command& command, TimeSpanArguments& arguments, Option& follow) {
  command
      .AddOption("--since", arguments.since,
                 "Show only timestamps since an age (10m) or a UTC time (2026-11-22T06:00Z)")
      .TypeName("TIME")
      .Excludes(follow);
  command.AddOption("--until", arguments.until, "Show only timestamps up to an age or a UTC time")
      .TypeName("TIME")
      .Excludes(follow);
}

Result<TimestampRange> ParseTimestampRange(const TimeText& from, const TimeText& to, std::int64_t now_ns,
                                           const TimestampRange& by_default) {
  TimestampRange range = by_default;
  if (!from.text.empty()) {
    const Result<std::int64_t> time = ParseTimeOrAge(from.text, now_ns, from.option);
    if (!time) return tl::unexpected(time.error());
    range.from_ns = *time;
  }
  if (!to.text.empty()) {
    const Result<std::int64_t> time = ParseTimeOrAge(to.text, now_ns, to.option);
    if (!time) return tl::unexpected(time.error());
    range.to_ns = *time;
  }
  if (range.from_ns > range.to_ns) {
    return Fail(ErrorCode::kInvalid, std::string("is later than ") + to.option, from.option);
  }
  return range;
}

Result<void> SetTimes(const TimeSpanArguments& arguments, std::int64_t now_ns, proto::ReadRequest& request) {
  const Result<TimestampRange> range =
      ParseTimestampRange({arguments.since, "--since"}, {arguments.until, "--until"}, now_ns);
  if (!range) return tl::unexpected(range.error());
  if (!arguments.since.empty()) request.set_from_ns(range->from_ns);
  if (!arguments.until.empty()) request.set_to_ns(range->to_ns);
  return {};
}

}  // namespace moondb
