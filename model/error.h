// Error: the world is wrong (radio, disk, GL, operator, a peer's bytes). Returned as a value, never thrown.
//
// `text` is one line that says what happened and, where it helps, what to do. `field` names the offending input, in
// the form of its place in the message or file ("layers[1].cells").
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace moondb::proto {
class Error;
}  // namespace moondb::proto

namespace moondb {

// The numbers are those of proto::ErrorCode (proto/error.proto).
enum class ErrorCode {
  kInvalid = 1,  // The caller's input is wrong.
  kNotFound = 2,
  kRefused = 3,      // Right in form, not allowed in this state.
  kUnavailable = 4,  // Absent for now: a peer, a driver, a service.
  kTimedOut = 5,
  kCorrupt = 6,   // Bytes that do not decode.
  kFull = 7,      // A mailbox, an outbox, the disk.
  kInternal = 8,  // A library or the operating system failed.
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

// True if the code is not ERROR_CODE_NONE.
bool IsError(const proto::Error& error);

}  // namespace moondb
