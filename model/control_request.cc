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

std::chrono::milliseconds BoundedWait(double wait_s, double max_s) {
  if (!(wait_s > 0)) return std::chrono::milliseconds(0);  // True for NaN, too.
  return std::chrono::milliseconds(static_cast<std::int64_t>(1000 * std::min(wait_s, max_s)));
}

std::chrono::milliseconds WaitOf(const proto::ControlRequest& request) {
  switch (request.request_case()) {
    case proto::ControlRequest::kRead:
      return BoundedWait(request.read().wait_s(), kReadWaitMax_s);
    case proto::ControlRequest::kShareProgress:
      return BoundedWait(request.share_progress().wait_s(), kReadWaitMax_s);
    case proto::ControlRequest::kShare:
      return BoundedWait(request.share().wait_s(), kOrderWaitMax_s);
    case proto::ControlRequest::kRoleSet:
      return BoundedWait(request.role_set().wait_s(), kOrderWaitMax_s);
    case proto::ControlRequest::kRegistration:
      return BoundedWait(request.registration().wait_s(), kRegistrationWaitMax_s);
    default:
      return std::chrono::milliseconds(0);
  }
}

}  // namespace moondb
