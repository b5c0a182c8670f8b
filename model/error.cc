#include "model/error.h"

namespace moondb {

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
