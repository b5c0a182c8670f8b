// Events: one line each of what people will ask about later, told by the agent that saw it and shared like any record.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "proto/record.pb.h"

namespace moondb {

inline constexpr std::size_t kEventTextBytesMax = 512;
inline constexpr std::size_t kEventByBytesMax = 64;

// Texts become one line of UTF-8 and are cut to the limits.
proto::Record MakeEvent(proto::EventKind kind, std::string_view text, std::string_view by, std::int64_t stamp_ns);

// "started": as people and scripts read it.
std::string EventKindName(proto::EventKind kind);

}  // namespace moondb
