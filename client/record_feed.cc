#include "client/record_feed.h"

#include <algorithm>
#include <chrono>

#include "proto/control.pb.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;

// Longest wait of one request. Agents accept up to a minute, but a shorter wait detects a hung agent sooner.
constexpr milliseconds kWaitMax(20'000);

}  // namespace

Result<void> RecordFeed::SkipToNow() {
  proto::ReadRequest newest;
  newest.set_is_newest_first(true);
  newest.set_records_max(1);
  const auto page = client_.Read(newest);
  if (!page) return tl::unexpected(page.error());
  request_.set_after_row_id(page->row_ids().empty() ? 0 : page->row_ids(0));
  return {};
}

Result<proto::ReadReply> RecordFeed::Next(Client::Duration timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (true) {
    const auto left = std::chrono::ceil<milliseconds>(deadline - std::chrono::steady_clock::now());
    const milliseconds wait = std::clamp(left, milliseconds(0), kWaitMax);
    proto::ControlRequest request;
    *request.mutable_read() = request_;
    request.mutable_read()->set_is_newest_first(false);
    request.mutable_read()->set_wait_s(std::chrono::duration<double>(wait).count());
    auto reply = client_.Call(request);
    if (!reply) return tl::unexpected(reply.error());
    proto::ReadReply& page = *reply->mutable_read();
    if (page.records_size() != page.row_ids_size()) {
      return Fail(ErrorCode::kCorrupt, "the agent's answer does not have one row id for each record");
    }
    if (!page.row_ids().empty()) {
      request_.set_after_row_id(page.row_ids(page.row_ids_size() - 1));
      return std::move(page);
    }
    if (std::chrono::steady_clock::now() >= deadline) return std::move(page);
  }
}

}  // namespace moondb
