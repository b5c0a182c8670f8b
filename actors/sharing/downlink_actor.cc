#include "actors/sharing/downlink_actor.h"

#include <utility>

#include "actors/sharing/sync_actor.h"

namespace moondb {
namespace {

constexpr std::uint32_t kTimedOut = 1;
constexpr std::uint32_t kContentBytesAtATime = 32 * 1024;  // A few maps, which take about 50 ms to encode.
constexpr std::uint32_t kRecordsAtATime = 512;

}  // namespace

void DownlinkActor::OnStart(Context& context) {
  // The first id is random, so an answer to a request from before a restart does not match a new request.
  question_ = context.rng()() | 1;
}

void DownlinkActor::OnMessage(Context& context, const proto::Message& message) {
  if (context.sender().agent != options_.self) return;
  if (message.has_downlink_request()) return OnOrder(context, message);
  if (orders_.empty()) return;
  if (message.has_timer()) {
    if (message.timer().value() != question_) return;
    EndWithError(context, {ErrorCode::kTimedOut, "storage did not answer in time", {}});
    return;
  }
  if (message.request_id() != question_ || context.sender().actor != actor_name::kStorage) return;
  switch (message.body_case()) {
    case proto::Message::kAckBundleReply:
      if (IsError(message.ack_bundle_reply().error())) {
        return EndWithError(context, FromProto(message.ack_bundle_reply().error()));
      }
      return Load(context);
    case proto::Message::kLoadBundlesReply:
      return OnLoaded(context, message.load_bundles_reply());
    case proto::Message::kMissingReply:
      return OnMissing(context, message.missing_reply());
    case proto::Message::kSaveBundleReply:
      return OnSaved(context, message.save_bundle_reply());
    default:
      return;
  }
}

void DownlinkActor::OnOrder(Context& context, const proto::Message& message) {
  const proto::DownlinkRequest& request = message.downlink_request();
  Result<void> checked;
  if (orders_.size() >= options_.orders_max) {
    checked = Fail(ErrorCode::kFull, "too many orders wait for bundles; try again later");
  } else if (request.bytes_max() != 0 && request.acknowledge() != 0) {
    checked = Fail(ErrorCode::kInvalid, "cannot be combined with bytes_max: either make a bundle or acknowledge one",
                   "acknowledge");
  } else if (request.bytes_max() != 0 &&
             (request.bytes_max() < kBundleBytesMin || request.bytes_max() > kBundleBytesMax)) {
    checked = Fail(ErrorCode::kInvalid, "must lie between 1 KiB and 16 MiB", "bytes_max");
  } else if (GroundRecords(options_.team).data_types().empty()) {
    checked = Fail(ErrorCode::kRefused, "the team file's `ground` selects no data type: set a policy there");
  }
  if (!checked) {
    proto::Message reply;
    *reply.mutable_downlink_reply()->mutable_error() = ToProto(checked.error());
    (void)context.Reply(std::move(reply));
    return;
  }
  orders_.push_back({context.sender(), message.request_id(), request});
  if (orders_.size() == 1) BeginNext(context);
}

void DownlinkActor::BeginNext(Context& context) {
  const proto::DownlinkRequest& request = orders_.front().request;
  if (request.acknowledge() == 0) return Load(context);
  proto::Message message;
  message.mutable_ack_bundle_request()->set_number(request.acknowledge());
  Ask(context, std::move(message));
}

void DownlinkActor::Load(Context& context) {
  proto::Message message;
  message.mutable_load_bundles_request();
  Ask(context, std::move(message));
}

void DownlinkActor::OnLoaded(Context& context, const proto::LoadBundlesReply& reply) {
  if (IsError(reply.error())) return EndWithError(context, FromProto(reply.error()));
  Result<HaveSet> taken = FromProto(reply.taken());
  if (!taken) return EndWithError(context, taken.error());
  taken_ = *std::move(taken);
  *reply_.mutable_waiting() = reply.waiting();
  const std::uint64_t bytes_max = orders_.front().request.bytes_max();
  if (bytes_max == 0) return RequestRecords(context);
  if (reply.waiting_size() >= kBundlesWaitingMax) {
    return EndWithError(context, {ErrorCode::kRefused,
                                  std::to_string(reply.waiting_size()) +
                                      " bundles already wait for the ground station's acknowledgment",
                                  {}});
  }
  bundle_.set_number(reply.last_number() + 1);
  bundle_.set_made_ns(context.utc_now_ns());
  proto::BundleFile head;
  head.set_team(options_.team.team());
  head.set_agent_id(options_.self);
  head.set_number(bundle_.number());
  head.set_made_ns(bundle_.made_ns());
  writer_.emplace(std::move(head), bytes_max);
  RequestRecords(context);
}

void DownlinkActor::RequestRecords(Context& context) {
  proto::Message message;
  proto::MissingRequest& request = *message.mutable_missing_request();
  *request.mutable_destination_have() = ToProto(taken_);
  *request.mutable_filter() = GroundRecords(options_.team);
  request.set_content_bytes_max(kContentBytesAtATime);
  request.set_records_max(kRecordsAtATime);
  Ask(context, std::move(message));
}

void DownlinkActor::OnMissing(Context& context, const proto::MissingReply& reply) {
  if (reply.records().empty() && reply.remaining() > 0) {
    return EndWithError(context,
                        {ErrorCode::kUnavailable, "storage cannot read the records that the ground station lacks", {}});
  }
  if (writer_) return Fill(context, reply);
  reply_.set_left_count(static_cast<double>(reply.remaining()) + reply.records_size());
  End(context);
}

void DownlinkActor::Fill(Context& context, const proto::MissingReply& reply) {
  proto::RecordBatch records;
  *records.mutable_records() = reply.records();
  const int added = writer_->Add(records);
  const bool is_full = added < reply.records_size();
  if (!is_full && reply.remaining() > 0) {
    taken_.Merge(writer_->have());
    return RequestRecords(context);
  }
  if (writer_->record_count() == 0 && is_full) {
    return EndWithError(context, {ErrorCode::kInvalid,
                                  "is too small: the next record alone has " +
                                      std::to_string(reply.records(0).content().size()) + " bytes before coding",
                                  "bytes_max"});
  }
  reply_.set_left_count(static_cast<double>(reply.remaining()) + reply.records_size() - added);
  if (writer_->record_count() == 0) return End(context);
  Save(context);
}

void DownlinkActor::Save(Context& context) {
  proto::Message message;
  proto::SaveBundleRequest& request = *message.mutable_save_bundle_request();
  request.set_file(writer_->Finish());
  *request.mutable_have() = ToProto(writer_->have());
  bundle_.set_record_count(static_cast<double>(writer_->record_count()));
  bundle_.set_bytes(static_cast<double>(request.file().size()));
  bundle_.set_hash(HashOfBundle(request.file()));
  *request.mutable_bundle() = bundle_;
  Ask(context, std::move(message));
}

void DownlinkActor::OnSaved(Context& context, const proto::SaveBundleReply& reply) {
  if (IsError(reply.error())) return EndWithError(context, FromProto(reply.error()));
  *reply_.mutable_made() = bundle_;
  *reply_.add_waiting() = bundle_;
  End(context);
}

void DownlinkActor::Ask(Context& context, proto::Message message) {
  context.Cancel(timer_);
  message.set_request_id(++question_);
  message.set_ms_type(proto::CONTROL);
  if (context.Send({options_.self, actor_name::kStorage}, std::move(message)) != SendResult::kAccepted) {
    return EndWithError(context, {ErrorCode::kFull, "storage is busy; try again later", {}});
  }
  timer_ = context.AfterTimer(options_.timeout, kTimedOut, question_);
}

void DownlinkActor::EndWithError(Context& context, const Error& error) {
  reply_.Clear();
  *reply_.mutable_error() = ToProto(error);
  End(context);
}

void DownlinkActor::End(Context& context) {
  context.Cancel(timer_);
  ++question_;  // A late answer then matches no request.
  writer_.reset();
  taken_ = {};
  bundle_.Clear();
  const Order order = std::move(orders_.front());
  orders_.pop_front();
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(order.request_id);
  *message.mutable_downlink_reply() = std::exchange(reply_, {});
  (void)context.Send(order.requester, std::move(message));
  if (!orders_.empty()) BeginNext(context);
}

}  // namespace moondb
