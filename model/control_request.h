// What a client and its agent's gateway both have to know of a ControlRequest. Plain functions, any thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

#include "proto/control.pb.h"

namespace moondb {

inline constexpr double kReadWaitMax_s = 60;             // Also of ShareProgressRequest.
inline constexpr double kOrderWaitMax_s = 24 * 60 * 60;  // Until an order to share, or a change of roles, is done.

// A request at a client_address has so many at most; over ipc it may be larger. What is on its way there takes memory
// before anybody knows what it is.
inline constexpr std::size_t kKeyedRequestBytesMax = 12 * 1024 * 1024;

// As proto/control.proto says of each request; of REQUEST_NOT_SET, and of one that says nothing, the defaults.
const proto::CommandOptions& CommandOptionsOf(proto::ControlRequest::RequestCase request);

// As proto/control.proto names it: "role_set"; empty for REQUEST_NOT_SET.
std::string RequestName(proto::ControlRequest::RequestCase request);

// Its answer may take minutes: a solve, a merge (which all questions about the map may begin with), a whole file read,
// a bundle made.
bool TakesLong(const proto::ControlRequest& request);

// A field wait_s as a duration: at most `max_s`, and 0 for what is negative or no number.
std::chrono::milliseconds BoundedWait(double wait_s, double max_s);

// How long the agent may wait before it answers a request with a field wait_s; 0 for all else.
std::chrono::milliseconds WaitOf(const proto::ControlRequest& request);

}  // namespace moondb
