// Options of commands that select records by their timestamps.
#pragma once

#include <cstdint>
#include <string>

#include "apps/moonctl/command.h"
#include "model/error.h"
#include "model/timestamp_range.h"
#include "proto/storage.pb.h"

namespace moondb {

// Parses a time in UTC such as 2026-11-22T06:00Z, or an age before `now_ns` such as 10m. Returns nanoseconds since
// 1970. Fails with kInvalid, in the field `option`, for any other text.
Result<std::int64_t> ParseTimeOrAge(const std::string& text, std::int64_t now_ns, const char* option);

// The text of an option, which may be empty, and the option's name for errors.
struct TimeText {
  const std::string& text;
  const char* option;
};

// Parses both ends of a range; an empty text leaves the end of `by_default`. Fails with kInvalid for a text that is no
// time, and if `from` is later than `to`.
Result<TimestampRange> ParseTimestampRange(const TimeText& from, const TimeText& to, std::int64_t now_ns,
                                           const TimestampRange& by_default = {});

struct TimeSpanArguments {
  std::string since;
  std::string until;
};

// Adds --since and --until, which cannot be combined with `follow`.
void AddTimeSpanOptions(Command& command, TimeSpanArguments& arguments, Option& follow);

// Sets from_ns and to_ns of the request. Errors are those of ParseTimestampRange.
Result<void> SetTimes(const TimeSpanArguments& arguments, std::int64_t now_ns, proto::ReadRequest& request);

}  // namespace moondb
