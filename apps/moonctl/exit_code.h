// The exit codes of moonctl, for scripts.
#pragma once

#include "model/error.h"

namespace moondb {

enum class ExitCode {
  kDone = 0,
  kFailed = 1,
  kUsage = 2,        // The command line, the team file or other input is wrong.
  kUnreachable = 3,  // Some agents do not answer.
  kRefused = 4,      // Examples: a role conflict, outdated state, an agent that is not the leader.
  kTimedOut = 5,     // Waiting for an acknowledgment or an answer took too long.
};

constexpr ExitCode ExitCodeOf(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalid:
      return ExitCode::kUsage;
    case ErrorCode::kUnavailable:
      return ExitCode::kUnreachable;
    case ErrorCode::kRefused:
      return ExitCode::kRefused;
    case ErrorCode::kTimedOut:
      return ExitCode::kTimedOut;
    default:
      return ExitCode::kFailed;
  }
}

// Returns `error` as kInvalid. Call this if a file that the operator named is missing or damaged, because the command
// line is then wrong.
inline Error InputError(Error error) {
  error.code = ErrorCode::kInvalid;
  return error;
}

}  // namespace moondb
