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
  command.AddOption("--since", arguments.since, "Only timestamps from this time on: 10m ago, or 2026-11-22T06:00Z")
      .TypeName("TIME")
      .Excludes(follow);
  command.AddOption("--until", arguments.until, "Only timestamps up to this time").TypeName("TIME").Excludes(follow);
}

Result<void> SetTimes(const TimeSpanArguments& arguments, std::int64_t now_ns, proto::ReadRequest& request) {
  if (!arguments.since.empty()) {
    const Result<std::int64_t> since = ParseTimeOrAge(arguments.since, now_ns, "--since");
    if (!since) return tl::unexpected(since.error());
    request.set_from_ns(*since);
  }
  if (!arguments.until.empty()) {
    const Result<std::int64_t> until = ParseTimeOrAge(arguments.until, now_ns, "--until");
    if (!until) return tl::unexpected(until.error());
    request.set_to_ns(*until);
  }
  if (!arguments.since.empty() && !arguments.until.empty() && request.from_ns() > request.to_ns()) {
    return Fail(ErrorCode::kInvalid, "is later than --until", "--since");
  }
  return {};
}

}  // namespace moondb
