#include "actors/sharing/sharing_receiver.h"

#include <algorithm>
#include <utility>

#include "model/have_set.h"
#include "model/team_id.h"
#include "model/wire_version.h"

namespace moondb {
namespace {

// The session ids of a sender count up. A Hello is late, and ignored, if its id is below the current id by less than
// this number.
constexpr std::uint64_t kStaleSessions = 1024;
constexpr std::chrono::seconds kStorageAnswersWithin(10);  // After this time an answer of storage counts as lost.

constexpr int kEveryonesTypesMax = 256;

// Size of two batches with their overhead, in bytes. A sender that uses its granted rate is never silent for longer
// than these bytes take at that rate. IsMoving allows a silence of this time or of `sending_after`, whichever is
// longer.
constexpr double kBatchesBytes = 2 * 4500;

SharingActions Refuse(AgentId sender, std::uint64_t session_id, Error error) {
  SharingAction action{sender, {}};
  action.message.set_ms_type(proto::CONTROL);
  action.message.mutable_refusal()->set_session_id(session_id);
  *action.message.mutable_refusal()->mutable_error() = ToProto(error);
  return {std::move(action)};
}

SharingActions RefuseUnknown(AgentId sender, std::uint64_t session_id) {
  return Refuse(sender, session_id, Error{ErrorCode::kNotFound, "this agent has no open session with this id", ""});
}

Result<void> CheckDropped(const proto::Batch& batch) {
  proto::HaveSet dropped;
  *dropped.mutable_streams() = batch.dropped();
  Result<HaveSet> checked = FromProto(dropped);
  if (!checked) return Fail(ErrorCode::kCorrupt, checked.error().text, "dropped." + checked.error().field);
  return {};
}

// Returns the acknowledgment of a batch, without its have-set. The acknowledgment names the batch's first record, or,
// if `records` is empty, only the agent and data type of `message`.
proto::Message AcknowledgmentOf(const proto::Message& message, const proto::RecordBatch& records) {
  proto::Message result;
  result.set_ms_type(proto::ACKNOWLEDGMENT);
  result.set_remaining(message.remaining());
  result.set_agent_id(message.agent_id());
  result.set_data_type(message.data_type());
  if (!records.records().empty()) {
    const RecordKey key = FromProto(records.records(0).key());
    result.set_agent_id(key.stream.origin);
    result.set_data_type(key.stream.type);
    result.set_record_id(ToString(key));
  }
  result.mutable_have()->set_session_id(message.batch().session_id());
  result.mutable_have()->set_batch_number(message.batch().batch_number());
  return result;
}

}  // namespace

SharingReceiver::SharingReceiver(Options options, std::uint64_t first_request_id)
    : options_(std::move(options)),
      next_request_id_(first_request_id),
      runs_(options_.run_places_max, options_.idle_after),
      schema_hash_(HashSchemas(options_.schemas)) {}

SharingActions SharingReceiver::OnHello(AgentId sender, const proto::Hello& hello, Time now) {
  if (Result<void> checked = CheckHello(hello); !checked) return RefuseHello(sender, hello, checked.error());
  if (hello.config_hash() == options_.config_hash) {
    other_configs_.erase(sender);
  } else {
    other_configs_.insert(sender);
  }
  const RecordKey have_from = FromProto(hello.have_from());
  const auto known = incoming_.find(sender);
  const bool is_known = known != incoming_.end();
  const std::uint64_t age = is_known ? known->second.session_id - hello.session_id() : 0;
  if (is_known) {
    const bool is_repeated = age == 0 && known->second.have_request_id != 0 && known->second.have_from == have_from;
    const bool is_late = age > 0 && age < kStaleSessions && now - known->second.last_heard < options_.idle_after;
    if (is_repeated || is_late) return {};
  }
  // The Hello requests a later page, but the session is unknown here. The sender may have received the earlier pages
  // before this agent's disk was lost, so the session must start over.
  if (have_from != RecordKey() && !(is_known && age == 0)) return RefuseUnknown(sender, hello.session_id());
  if (!is_known && !MakeRoom(now)) {
    return RefuseHello(sender, hello, Error{ErrorCode::kFull, "this agent has too many open sessions", ""});
  }
  Incoming& incoming = incoming_[sender];
  // Each sender has at most one HaveRequest at storage, however many Hellos it sends.
  if (incoming.have_request_id != 0 && now - incoming.have_asked_at < kStorageAnswersWithin) {
    incoming.next_hello = hello;
    return {};
  }
  if (incoming.session_id != hello.session_id()) incoming = Incoming();
  incoming.have_asked_at = now;
  incoming.session_id = hello.session_id();
  incoming.last_heard = now_ = now;
  incoming.is_at_end = false;
  incoming.is_other_schema = hello.schema_hash() != schema_hash_;
  incoming.have_from = have_from;
  return RequestPage(incoming, hello);
}

SharingActions SharingReceiver::RequestPage(Incoming& incoming, const proto::Hello& hello) {
  if (++next_request_id_ == 0) ++next_request_id_;
  incoming.have_request_id = next_request_id_;
  SharingAction action;
  action.message.set_ms_type(proto::CONTROL);
  action.message.set_request_id(incoming.have_request_id);
  proto::HaveRequest& request = *action.message.mutable_have_request();
  request.set_is_for_peer(true);
  *request.mutable_origin_agents() = hello.origin_agents();
  *request.mutable_everyones_types() = hello.everyones_types();
  if (incoming.have_from != RecordKey()) *request.mutable_from() = ToProto(incoming.have_from);
  request.set_bytes_max(static_cast<std::uint32_t>(options_.have_page_bytes_max));
  return {std::move(action)};
}

Result<SharingActions> SharingReceiver::OnBatch(AgentId sender, const proto::Message& message, Time now) {
  const proto::Batch& batch = message.batch();
  const auto it = incoming_.find(sender);
  if (it == incoming_.end() || it->second.session_id != batch.session_id()) {
    return RefuseUnknown(sender, batch.session_id());
  }
  Incoming& incoming = it->second;
  incoming.last_heard = now_ = now;
  incoming.is_at_end = message.remaining() == 0;
  Heard& heard = heard_[sender];
  heard.coded_bytes += static_cast<double>(batch.coded().size() + message.sql().size());
  heard.remaining = message.remaining();
  ++heard.batches;
  if (incoming.waiting_stores.size() >= options_.waiting_stores_per_sender_max) {
    ++counts_.dropped_messages;
    return SharingActions();
  }
  std::optional<std::string> whole;
  if (batch.has_fragment()) {
    // Ignore a late copy of a fragment. A copy that belongs to an earlier record would replace the fragments of the
    // current record.
    if (batch.batch_number() <= incoming.last_fragment_batch) return SharingActions();
    incoming.last_fragment_batch = batch.batch_number();
    Result<std::optional<std::string>> taken = fragments_.Take(sender, batch);
    if (!taken && taken.error().code == ErrorCode::kNotFound) return Refuse(sender, batch.session_id(), taken.error());
    if (!taken) {
      ++counts_.damaged_messages;
      return tl::unexpected(taken.error());
    }
    if (!*taken) return AnswerWithoutRecords(sender, message, incoming);
    whole = **std::move(taken);
  }
  DecodeBudget& budget = decode_budgets_[sender];
  const std::size_t coded_bytes = whole ? whole->size() : batch.coded().size() + message.sql().size();
  if (!budget.Takes(coded_bytes, now)) {
    ++counts_.dropped_messages;
    return SharingActions();
  }
  const bool is_late = batch.batch_number() <= incoming.last_run_batch;
  Result<proto::RecordBatch> records = Decode(sender, message, whole, is_late);
  // kNotFound: earlier batches of the run are missing.
  const bool lacks_run = !records && records.error().code == ErrorCode::kNotFound;
  budget.Charge(records ? records->ByteSizeLong() : lacks_run ? coded_bytes : DecodeBudget::kDamagedBytes);
  if (lacks_run) {
    if (is_late) return SharingActions();
    SharingActions answer = AnswerWithoutRecords(sender, message, incoming);
    answer.front().message.mutable_have()->set_needs_new_run(true);
    return answer;
  }
  if (records && batch.run() != 0) incoming.last_run_batch = std::max(incoming.last_run_batch, batch.batch_number());
  const Result<void> dropped = CheckDropped(batch);
  if (!records || !dropped) {
    ++counts_.damaged_messages;
    return tl::unexpected(records ? dropped.error() : records.error());
  }
  if (++next_request_id_ == 0) ++next_request_id_;
  WaitingStore& waiting = incoming.waiting_stores[next_request_id_];
  waiting.acknowledgment = AcknowledgmentOf(message, *records);
  if (batch.has_order_end()) {
    waiting.order_end = batch.order_end();
    for (const proto::StoredRecord& record : records->records()) waiting.keys.push_back(FromProto(record.key()));
  }
  SharingAction action;
  action.message.set_ms_type(proto::CONTROL);
  action.message.set_request_id(next_request_id_);
  proto::StoreRequest& request = *action.message.mutable_store_request();
  request.set_sender(sender);
  *request.mutable_records() = std::move(*records->mutable_records());
  *request.mutable_dropped() = batch.dropped();
  SharingActions actions;
  actions.push_back(std::move(action));
  return actions;
}

SharingActions SharingReceiver::AnswerWithoutRecords(AgentId sender, const proto::Message& message,
                                                     Incoming& incoming) const {
  SharingAction answer{sender, AcknowledgmentOf(message, proto::RecordBatch())};
  Grant(incoming, *answer.message.mutable_have());
  return {std::move(answer)};
}

SharingActions SharingReceiver::OnHaveReply(std::uint64_t request_id, const proto::HaveReply& reply) {
  for (auto& [sender, incoming] : incoming_) {
    if (request_id == 0 || incoming.have_request_id != request_id) continue;
    incoming.have_request_id = 0;
    if (const auto next = std::exchange(incoming.next_hello, std::nullopt)) return OnHello(sender, *next, now_);
    SharingAction action{sender, {}};
    action.message.set_ms_type(proto::ACKNOWLEDGMENT);
    proto::Have& have = *action.message.mutable_have();
    have.set_session_id(incoming.session_id);
    *have.mutable_have() = reply.have();
    have.set_is_whole(true);
    if (incoming.have_from != RecordKey()) *have.mutable_have_from() = ToProto(incoming.have_from);
    Grant(incoming, have);
    if (reply.has_next()) {
      *have.mutable_have_next() = reply.next();
    } else {
      CompleteAnswer(sender, incoming, have);
    }
    return {std::move(action)};
  }
  return {};
}

void SharingReceiver::CompleteAnswer(AgentId sender, const Incoming& incoming, proto::Have& have) {
  have.set_keeps_runs(runs_.TakePlace(sender, now_));
  const PartOfWhole part = fragments_.PartFrom(sender);
  have.set_part_hash(part.hash);
  have.set_part_bytes(part.bytes);
  if (incoming.is_other_schema) *have.mutable_schemas() = options_.schemas;
}

SharingActions SharingReceiver::OnStoreReply(std::uint64_t request_id, const proto::StoreReply& reply) {
  for (auto& [sender, incoming] : incoming_) {
    const auto waiting = incoming.waiting_stores.find(request_id);
    if (waiting == incoming.waiting_stores.end()) continue;
    WaitingStore stored = std::move(waiting->second);
    incoming.waiting_stores.erase(waiting);
    if (IsError(reply.error())) {
      return RefuseBatch(sender, incoming.session_id, Error{ErrorCode::kUnavailable, reply.error().text(), ""});
    }
    ObserveStored(sender, stored, reply);
    SharingAction action{sender, std::move(stored.acknowledgment)};
    counts_.received_records += reply.stored_count();
    counts_.rejected_records += reply.rejected_count() - reply.untrusted_count();
    *action.message.mutable_have()->mutable_have() = reply.covered();
    Grant(incoming, *action.message.mutable_have());
    return {std::move(action)};
  }
  return {};
}

SharingActions SharingReceiver::RefuseBatch(AgentId sender, std::uint64_t session_id, Error error) {
  Heard& heard = heard_[sender];
  ++heard.refusals;
  heard.refusal = error.text;
  return Refuse(sender, session_id, std::move(error));
}

void SharingReceiver::ObserveStored(AgentId sender, const WaitingStore& stored, const proto::StoreReply& reply) {
  Heard& heard = heard_[sender];
  heard.refusals = 0;
  if (stored.order_end.order() == 0) return;
  heard.order_end = stored.order_end;
  const Result<HaveSet> covered = FromProto(reply.covered());
  const auto is_taken = [&covered](const RecordKey& key) {
    return covered && covered->Get(key.stream).Covered().Contains(key.seq);
  };
  const auto taken = std::count_if(stored.keys.begin(), stored.keys.end(), is_taken);
  const std::uint64_t not_taken = stored.keys.size() - static_cast<std::uint64_t>(taken);
  heard.order_end.set_not_taken(std::max(stored.order_end.not_taken(), stored.order_end.not_taken() + not_taken));
  if (heard.order_end.not_taken() == 0 && !heard.order_end.is_limited()) {
    heard.completed_order = heard.order_end.order();
  }
}

const SharingReceiver::Heard& SharingReceiver::heard(AgentId sender) const {
  static const Heard kNothing;
  const auto heard = heard_.find(sender);
  return heard == heard_.end() ? kNothing : heard->second;
}

Result<void> SharingReceiver::CheckHello(const proto::Hello& hello) const {
  if (hello.wire_version() != kWireVersion) {
    return Fail(ErrorCode::kRefused,
                "this agent uses protocol version " + std::to_string(kWireVersion) + ", the sender uses version " +
                    std::to_string(hello.wire_version()) + ": install the same moondb on both",
                "wire_version");
  }
  if (hello.team_id() != options_.team_id) {
    return Fail(ErrorCode::kRefused,
                "this agent belongs to another team: " + options_.team + " with the team id " +
                    TeamIdStart(options_.team_id) + "; the sender's team id is " + TeamIdStart(hello.team_id()),
                "team_id");
  }
  if (hello.kind() != options_.kind)
    return Fail(ErrorCode::kRefused, "is not the kind of sharing that this actor does", "kind");
  if (hello.session_id() == 0) return Fail(ErrorCode::kRefused, "is missing", "session_id");
  if (hello.origin_agents().size() > static_cast<int>(kAgentIdMax))
    return Fail(ErrorCode::kRefused, "has too many entries", "origin_agents");
  if (hello.everyones_types().size() > kEveryonesTypesMax)
    return Fail(ErrorCode::kRefused, "has too many entries", "everyones_types");
  return {};
}

SharingActions SharingReceiver::RefuseHello(AgentId sender, const proto::Hello& hello, Error error) {
  ++counts_.refused_hellos;
  return Refuse(sender, hello.session_id(), std::move(error));
}

Result<proto::RecordBatch> SharingReceiver::Decode(AgentId sender, const proto::Message& message,
                                                   const std::optional<std::string>& whole, bool is_late) {
  const proto::Batch& batch = message.batch();
  if (batch.codec() == proto::CODEC_PAPER_SQL) {
    if (batch.record_count() != 1) return Fail(ErrorCode::kCorrupt, "is not 1", "record_count");
    return DecodePaperSql(options_.paper_sql, whole ? *whole : message.sql(), message.record_id());
  }
  const std::string& coded = whole ? *whole : batch.coded();
  // Decode a late copy separately, since it would reset the run's decoder to an earlier state.
  return is_late ? DecodeBatch(batch.codec(), coded, batch.record_count()) : runs_.Decode(sender, batch, coded, now_);
}

// Grants the sender its part of the credit and of the budget. All senders share this agent's radio, so together they
// may have only as many bytes in flight as a single sender may have.
void SharingReceiver::Grant(Incoming& incoming, proto::Have& have) const {
  const std::size_t moving = std::max<std::size_t>(MovingSessions(now_), 1);
  have.set_unacked_bytes_max(options_.unacked_bytes_max / static_cast<std::uint32_t>(moving));
  if (options_.bytes_per_second_max <= 0) return;
  const double part = options_.bytes_per_second_max / static_cast<double>(moving + moving_elsewhere_);
  incoming.bytes_per_second = std::clamp(part, 1.0, 4e9);
  have.set_bytes_per_second_max(static_cast<std::uint32_t>(incoming.bytes_per_second));
}

bool SharingReceiver::IsMoving(const Incoming& incoming, Time now) const {
  std::chrono::nanoseconds silence_max = options_.sending_after;
  if (incoming.bytes_per_second > 0) {
    const std::chrono::duration<double> between_batches(kBatchesBytes / incoming.bytes_per_second);
    silence_max = std::max(silence_max, std::chrono::duration_cast<std::chrono::nanoseconds>(between_batches));
  }
  return !incoming.is_at_end && now - incoming.last_heard < silence_max;
}

std::size_t SharingReceiver::MovingSessions(Time now) const {
  return static_cast<std::size_t>(std::count_if(
      incoming_.begin(), incoming_.end(), [this, now](const auto& entry) { return IsMoving(entry.second, now); }));
}

bool SharingReceiver::MakeRoom(Time now) {
  if (incoming_.size() < options_.sessions_max) return true;
  const auto oldest = std::min_element(incoming_.begin(), incoming_.end(), [](const auto& a, const auto& b) {
    return a.second.last_heard < b.second.last_heard;
  });
  if (oldest == incoming_.end() || now - oldest->second.last_heard < options_.idle_after) return false;
  incoming_.erase(oldest);
  return true;
}

}  // namespace moondb
