// Error: a failure with a cause outside of the program (radio, disk, GL, operator, a peer's bytes). Returned as a
// value, never thrown.
//
// `text` is one line that explains what happened and, where useful, what to do. `field` is the path of the offending
// input in its message or file ("layers[1].cells").
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
  kRefused = 3,      // The request is well-formed, but not allowed in this state.
  kUnavailable = 4,  // A peer, driver or service is temporarily absent.
  kTimedOut = 5,
  kCorrupt = 6,   // Bytes do not decode.
  kFull = 7,      // A mailbox, an outbox or the disk is full.
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

// Returns "field: text", or only the text if there is no field. One line, for people.
std::string ToString(const Error& error);

proto::Error ToProto(const Error& error);

// Converts an error from a message. A code that is 0 or unknown becomes kInternal.
Error FromProto(const proto::Error& error);

// Returns whether the message holds an error: its code is not ERROR_CODE_NONE.
bool IsError(const proto::Error& error);

}  // namespace moondb
