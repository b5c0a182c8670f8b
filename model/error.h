// Error: the world is wrong (radio, disk, GL, operator, a peer's bytes). Returned as a value, never thrown.
//
// `text` is one line that says what happened and, where it helps, what to do. `field` names the offending input, in
// the form of its place in the message or file ("layers[1].cells").
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

#include "proto/types.pb.h"

namespace moondb {

enum class ErrorCode {
  kInvalid = proto::ERROR_CODE_INVALID,  // The caller's input is wrong.
  kNotFound = proto::ERROR_CODE_NOT_FOUND,
  kRefused = proto::ERROR_CODE_REFUSED,          // Right in form, not allowed in this state.
  kUnavailable = proto::ERROR_CODE_UNAVAILABLE,  // Absent for now: a peer, a driver, a service.
  kTimedOut = proto::ERROR_CODE_TIMED_OUT,
  kCorrupt = proto::ERROR_CODE_CORRUPT,    // Bytes that do not decode.
  kFull = proto::ERROR_CODE_FULL,          // A mailbox, an outbox, the disk.
  kInternal = proto::ERROR_CODE_INTERNAL,  // A library or the operating system failed.
};

struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string text;
  std::string field;
};

template <typename T>
using Result = tl::expected<T, Error>;

inline tl::unexpected<Error> Fail(ErrorCode code, std::string text, std::string field = {}) {
  return tl::unexpected<Error>(Error{code, std::move(text), std::move(field)});
}

// "field: text", or the text alone. One line, for people.
std::string ToString(const Error& error);

proto::Error ToProto(const Error& error);

// An Error from a message's; a code of 0 or an unknown one becomes kInternal.
Error FromProto(const proto::Error& error);

inline bool IsError(const proto::Error& error) { return error.code() != proto::ERROR_CODE_NONE; }

}  // namespace moondb
