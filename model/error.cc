#include "model/error.h"

#include "proto/error.pb.h"

namespace moondb {

namespace {

constexpr bool HasNumberOf(ErrorCode code, proto::ErrorCode number) {
  return static_cast<int>(code) == static_cast<int>(number);
}
static_assert(HasNumberOf(ErrorCode::kInvalid, proto::ERROR_CODE_INVALID));
static_assert(HasNumberOf(ErrorCode::kNotFound, proto::ERROR_CODE_NOT_FOUND));
static_assert(HasNumberOf(ErrorCode::kRefused, proto::ERROR_CODE_REFUSED));
static_assert(HasNumberOf(ErrorCode::kUnavailable, proto::ERROR_CODE_UNAVAILABLE));
static_assert(HasNumberOf(ErrorCode::kTimedOut, proto::ERROR_CODE_TIMED_OUT));
static_assert(HasNumberOf(ErrorCode::kCorrupt, proto::ERROR_CODE_CORRUPT));
static_assert(HasNumberOf(ErrorCode::kFull, proto::ERROR_CODE_FULL));
static_assert(HasNumberOf(ErrorCode::kInternal, proto::ERROR_CODE_INTERNAL));
static_assert(HasNumberOf(ErrorCode::kInternal, proto::ErrorCode_MAX));

}  // namespace

bool IsError(const proto::Error& error) { return error.code() != proto::ERROR_CODE_NONE; }

std::string ToString(const Error& error) { return error.field.empty() ? error.text : error.field + ": " + error.text; }

proto::Error ToProto(const Error& error) {
  proto::Error result;
  result.set_code(static_cast<proto::ErrorCode>(error.code));
  result.set_field(error.field);
  result.set_text(error.text);
  return result;
}

Error FromProto(const proto::Error& error) {
  const bool is_known = proto::ErrorCode_IsValid(error.code()) && IsError(error);
  return Error{is_known ? static_cast<ErrorCode>(error.code()) : ErrorCode::kInternal, error.text(), error.field()};
}

}  // namespace moondb
