// Properties of control requests, shared by clients and the gateway of an agent. Thread-safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>

#include "proto/control.pb.h"

namespace moondb {

inline constexpr double kReadWaitMax_s = 60;             // Longest wait_s of ReadRequest and ShareProgressRequest.
inline constexpr double kRegistrationWaitMax_s = 600;    // Longest wait_s of RegistrationRequest.
inline constexpr double kOrderWaitMax_s = 24 * 60 * 60;  // Longest wait_s of ShareRequest and RoleSetRequest.

// Size limit of a request over the network (client_address), because an agent must buffer a request before it can check
// it. Requests over ipc may be larger.
inline constexpr std::size_t kKeyedRequestBytesMax = 12 * 1024 * 1024;

// Returns the CommandOptions of the request's field in proto/control.proto. Returns the default options if the field
// has none, and for REQUEST_NOT_SET.
const proto::CommandOptions& CommandOptionsOf(proto::ControlRequest::RequestCase request);

// Returns the name of the request's field in proto/control.proto: "role_set". Empty for REQUEST_NOT_SET.
std::string RequestName(proto::ControlRequest::RequestCase request);

// Returns whether the reply may take minutes: for a solve, a merge, a request about the merged map (which may start a
// merge), a check of the whole store file, or a new bundle.
bool TakesLong(const proto::ControlRequest& request);

// Converts a field wait_s to a duration of at most `max_s`. Returns 0 for negative values and NaN.
std::chrono::milliseconds BoundedWait(double wait_s, double max_s);

// Returns how long the agent may wait before it answers this request; 0 for requests without a field wait_s.
std::chrono::milliseconds WaitOf(const proto::ControlRequest& request);

}  // namespace moondb
