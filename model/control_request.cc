#include "model/control_request.h"

#include <algorithm>

namespace moondb {

const proto::CommandOptions& CommandOptionsOf(proto::ControlRequest::RequestCase request) {
  const auto* field = proto::ControlRequest::descriptor()->FindFieldByNumber(request);
  if (field == nullptr) return proto::CommandOptions::default_instance();
  return field->options().GetExtension(proto::command);
}

std::string RequestName(proto::ControlRequest::RequestCase request) {
  const auto* field = proto::ControlRequest::descriptor()->FindFieldByNumber(request);
  return field == nullptr ? "" : field->name();
}

bool TakesLong(const proto::ControlRequest& request) {
  return CommandOptionsOf(request.request_case()).is_long() || request.downlink().bytes_max() > 0 ||
         request.verify().part() == proto::VERIFY_PART_FILE;
}

std::chrono::milliseconds WaitOf(const proto::ControlRequest& request) {
  const double wait_s = request.read().wait_s();
  if (!(wait_s > 0)) return {};  // NaN too.
  return std::chrono::milliseconds(static_cast<int>(1000 * std::min(wait_s, kReadWaitMax_s)));
}

}  // namespace moondb
