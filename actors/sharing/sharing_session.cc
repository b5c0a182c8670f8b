#include "actors/sharing/sharing_session.h"

#include <algorithm>
#include <utility>

#include "model/text.h"
#include "proto/share_status.pb.h"

namespace moondb {
namespace {

// Limits of the content bytes of one MissingRequest, for any compression ratio. The limits bound the memory and the
// coding time of one batch: at most 300,000 map cells, about 15 ms at both agents. With more cells per batch, decoding
// the two batches that fit into the credit would take longer than sending them, and the radio would idle.
constexpr double kContentBytesMin = 512;
constexpr double kContentBytesMax = 72 * 1024;
constexpr std::uint32_t kRecordsMax = 1024;
// Smaller batches would cost more time for headers and commits than they save in waiting.
constexpr std::size_t kBatchBytesMin = 1024;
// Bytes on the radio besides a batch's own bytes: its frame headers and its acknowledgment.
constexpr std::size_t kBatchOverheadBytes = 300;

}  // namespace

SharingSession::SharingSession(Options options, proto::SharingKind kind, AgentId destination, std::uint64_t first_id)
    : options_(std::move(options)),
      kind_(kind),
      destination_(destination),
      session_id_(first_id),
      request_id_(first_id),
      order_(options_.state_types, first_id),
      maker_(destination, options_.codec, options_.paper_sql, static_cast<std::uint32_t>(first_id)),
      notes_(kind, destination, first_id),
      pacer_(options_.unacked_bytes_max),
      resend_delay_(options_.resend_after, options_.resend_after_max) {}

SharingActions SharingSession::Order(proto::RecordFilter filter, Time now, std::uint64_t bytes_max, ShareOrderId id) {
  SharingActions actions;
  if (!is_ordered()) last_error_.clear();
  is_limit_reported_ = false;
  resend_delay_.ForgetRefusals();
  order_.Set(std::move(filter), bytes_max, id, /*is_added=*/is_ordered());
  EvaluateAgain(now, actions);
  return actions;
}

SharingActions SharingSession::SharePeriodic(const proto::RecordFilter& filter, bool is_for_states, Time now) {
  SharingActions actions;
  // States do not replace all records, unless these wait for the window to open.
  const bool is_replaced = order_.is_periodic() && (!is_for_states || order_.is_waiting_for_states());
  if (!is_open() || is_replaced) {
    order_.SetPeriodic(filter, is_for_states);
    EvaluateAgain(now, actions);
    return actions;
  }
  // Ask storage again only in two cases: the session is sending batches, or the order has been held back and the window
  // to the destination admits only states.
  const bool is_sending = is_answered() && phase_ != Phase::kAsking && !maker_.has_reported_end();
  if (order_.is_waiting() ? order_.is_waiting_for_states() : is_sending) EvaluateAgain(now, actions);
  return actions;
}

void SharingSession::EvaluateAgain(Time now, SharingActions& actions) {
  const bool was_waiting = order_.is_waiting();
  order_.EvaluateAgain();
  if (!is_open()) {
    last_progress_ = now;
    Start(now, actions);
  } else if (was_waiting || order_.NeedsNewStart()) {
    Start(now, actions);
  } else if (phase_ == Phase::kAwaitingHave) {
    // If the destination is silent and the delay has grown, do not let the new order wait until the delay has passed.
    if (resend_delay_.has_grown()) GoOn(now, actions);
  } else {
    RequestAgain();
    Fill(now, actions);
  }
}

SharingActions SharingSession::Close() {
  SharingActions actions;
  if (!is_open()) return actions;
  End(Ending::kClosed, actions);
  // Free the run's memory (some megabytes), since there may never be another session to the destination.
  maker_.EndRun();
  return actions;
}

void SharingSession::End(Ending ending, SharingActions& actions) {
  if (!order_.is_periodic()) counts_.ObserveEnd(ending, last_progress_);
  order_.End(ending);
  phase_ = Phase::kClosed;
  pages_.Clear();
  ForgetInFlight();
  maker_.ForgetMissing();
  notes_.ObserveClosed(actions);
}

SharingActions SharingSession::OnHave(const proto::Have& have, Time now) {
  SharingActions actions;
  if (!is_open() || have.session_id() != session_id_) return actions;
  if (phase_ == Phase::kAwaitingHave && !have.is_whole()) return actions;
  const Result<void> taken =
      phase_ == Phase::kAwaitingHave ? TakePage(have, now, actions) : TakeTouchedStreams(have, actions);
  if (!taken) {
    counts_.ObserveRefusedHave();
    KeepError("the destination's have-set was refused: " + ToString(taken.error()));
  }
  if (!taken || phase_ == Phase::kAwaitingHave) return actions;
  TakeGrant(have, now);
  if (have.needs_new_run()) {
    if (const auto run = in_flight_.GiveUpBroken(have.batch_number())) {
      maker_.DropRun(*run);
      GiveUp(1);
    }
  } else {
    TakeAcknowledgment(have.batch_number(), now);
  }
  Fill(now, actions);
  return actions;
}

Result<void> SharingSession::CheckBatchNumber(const proto::Have& have) const {
  const bool is_of_a_batch = have.batch_number() != 0 || !have.is_whole();
  if (is_of_a_batch && (have.batch_number() == 0 || have.batch_number() >= maker_.next_number())) {
    return Fail(ErrorCode::kInvalid, "is above that of the last batch sent", "batch_number");
  }
  return {};
}

Result<void> SharingSession::TakePage(const proto::Have& have, Time now, SharingActions& actions) {
  if (const Result<void> checked = CheckBatchNumber(have); !checked) return checked;
  const Result<HaveCollector::Taken> taken = pages_.Take(have);
  if (!taken) return tl::unexpected(taken.error());
  if (*taken == HaveCollector::Taken::kLastPage) TakeAnswer(have, now, actions);
  if (*taken == HaveCollector::Taken::kPage) {
    last_progress_ = now;
    resend_delay_.ObserveProgress(/*has_records=*/false);
    RequestPage(now, actions);
  }
  return {};
}

void SharingSession::TakeAnswer(const proto::Have& have, Time now, SharingActions& actions) {
  in_flight_.SetHave(pages_.TakeWhole());
  notes_.ObserveAnswer(in_flight_.have(), order_.asked_origins(), actions);
  order_.SetOtherSchemaTypes(TypesNotFor(options_.schemas, have.schemas()));
  maker_.TakeAnswer(have);
  counts_.ObserveAnswer(now);
  phase_ = Phase::kSending;
  last_progress_ = now;
  SetDeadline(now);
}

Result<void> SharingSession::TakeTouchedStreams(const proto::Have& have, SharingActions& actions) {
  if (const Result<void> checked = CheckBatchNumber(have); !checked) return checked;
  const Result<HaveSet> heard = FromProto(have.have());
  if (!heard) return tl::unexpected(heard.error());
  if (const Result<void> joins = in_flight_.have().CheckJoins(*heard); !joins) return joins;
  notes_.ObserveAcknowledged(*heard, in_flight_.have(), actions);
  in_flight_.Join(*heard);
  return {};
}

void SharingSession::TakeGrant(const proto::Have& have, Time now) {
  in_flight_.SetCredit(std::min<std::size_t>(options_.unacked_bytes_max, have.unacked_bytes_max()));
  granted_rate_ = have.bytes_per_second_max();
  SetPace(now);
}

void SharingSession::TakeAcknowledgment(std::uint32_t batch_number, Time now) {
  const InFlightBatches::Acknowledged acknowledged = in_flight_.Acknowledge(batch_number);
  if (acknowledged.batches > 0) {
    counts_.ObserveAcknowledged(acknowledged.records, acknowledged.bytes);
    last_progress_ = now;
    resend_delay_.ObserveProgress(/*has_records=*/acknowledged.records > 0);
    SetDeadline(now);
  }
  GiveUp(in_flight_.GiveUpBefore(batch_number));
}

SharingActions SharingSession::OnRefusal(const proto::Refusal& refusal, Time now) {
  SharingActions actions;
  if (!is_open() || refusal.session_id() != session_id_) return actions;
  const Error error = FromProto(refusal.error());
  pages_.Clear();  // After any refusal the next Hello requests the first page again.
  // kNotFound: the receiver has restarted or forgotten the session.
  if (error.code == ErrorCode::kNotFound && resend_delay_.TakeStartAtOnce()) {
    Restart(now, actions);
    return actions;
  }
  resend_delay_.ObserveRefusal();
  KeepError("the destination refused: " + OneLine(ToString(error)));
  if (error.code == ErrorCode::kRefused || error.code == ErrorCode::kInvalid) return Close();
  return actions;
}

SharingActions SharingSession::OnMissingReply(std::uint64_t request_id, const proto::MissingReply& reply, Time now) {
  SharingActions actions;
  if (phase_ != Phase::kAsking || request_id != request_id_) return actions;
  if (reply.records().empty() && reply.remaining() > 0) {
    KeepError(
        "storage cannot list the missing records");  // The phase stays kAsking; at the deadline the session restarts.
    return actions;
  }
  const bool is_all = maker_.Make(reply, BatchBytesMax(), /*is_part_of_order=*/order_.is_for_states());
  phase_ = is_all ? Phase::kEnding : Phase::kSending;
  Fill(now, actions);
  return actions;
}

SharingActions SharingSession::OnPeerHaveRequest(std::uint64_t request_id) {
  SharingActions actions;
  notes_.ObserveAllAgain(request_id, in_flight_.have(), in_flight_.Keys(), actions);
  return actions;
}

void SharingSession::SetRate(double bytes_per_second, Time now) {
  own_rate_ = bytes_per_second;
  SetPace(now);
}

SharingActions SharingSession::SetWindow(Window window, Time now) {
  SharingActions actions;
  if (order_.SetWindow(window) && is_open() && !order_.is_waiting()) GoOn(now, actions);
  return actions;
}

SharingActions SharingSession::OnConnected(Time now) {
  SharingActions actions;
  if (is_open()) GoOn(now, actions);
  return actions;
}

SharingActions SharingSession::OnTimer(Time now) {
  SharingActions actions;
  if (!is_open() || order_.is_waiting()) return actions;
  Fill(now, actions);
  if (!is_open() || order_.is_waiting() || now < deadline_) return actions;
  resend_delay_.Grow();
  if (IsCollecting()) {
    counts_.ObserveResends(1);
    RequestPage(now, actions);
  } else {
    Restart(now, actions);
  }
  return actions;
}

std::optional<SharingSession::Time> SharingSession::deadline() const {
  if (!is_open() || order_.is_waiting()) return std::nullopt;
  return paced_until_ ? std::min(*paced_until_, deadline_) : deadline_;
}

proto::ShareSession SharingSession::Status(Time now) const {
  proto::ShareSession status;
  status.set_destination(destination_);
  status.set_kind(kind_);
  status.set_is_open(is_open());
  status.set_is_periodic(is_open() && order_.is_periodic());
  status.set_remaining(static_cast<double>(maker_.RemainingCount() + in_flight_.RecordCount()));
  status.set_seconds_since_progress(std::chrono::duration<double>(now - last_progress_).count());
  status.set_last_error(last_error_);
  status.set_bytes_per_second_max(pacer_.rate());
  order_.AddTo(status);
  maker_.AddTo(status);
  counts_.AddTo(status, now);
  if (is_answered()) counts_.AddSinceAnswerTo(status, now);
  return status;
}

void SharingSession::Start(Time now, SharingActions& actions) {
  resend_delay_.Reset();
  Restart(now, actions);
}

void SharingSession::GoOn(Time now, SharingActions& actions) {
  if (!IsCollecting() || order_.NeedsNewStart()) return Start(now, actions);
  resend_delay_.Reset();
  RequestPage(now, actions);
}

void SharingSession::RequestPage(Time now, SharingActions& actions) {
  SetDeadline(now);
  if (!order_.is_waiting()) SendHello(actions);
}

void SharingSession::Restart(Time now, SharingActions& actions) {
  if (is_open() && !order_.is_waiting()) counts_.ObserveResends(1);
  phase_ = Phase::kAwaitingHave;
  ++session_id_;
  if (session_id_ == 0) ++session_id_;
  pages_.Clear();
  ForgetInFlight();
  is_limit_reported_ = false;
  order_.StartOver();
  notes_.StartOver();
  RequestPage(now, actions);
}

void SharingSession::SendHello(SharingActions& actions) {
  SharingAction action{destination_, {}};
  action.message.set_ms_type(proto::CONTROL);
  proto::Hello& hello = *action.message.mutable_hello();
  hello.set_session_id(session_id_);
  hello.set_kind(kind_);
  hello.set_schema_hash(HashSchemas(options_.schemas));
  order_.FillRequest(hello);
  if (pages_.is_begun()) *hello.mutable_have_from() = ToProto(pages_.next());
  actions.push_back(std::move(action));
}

void SharingSession::Complete(SharingActions& actions) {
  if (order_.is_for_states() && !order_.is_periodic()) return order_.HoldBackTheRest();
  phase_ = Phase::kClosed;
  const std::uint64_t refused = in_flight_.RefusedCount();
  has_refused_ = refused != 0;
  if (!order_.is_periodic()) {
    counts_.ObserveEnd(Ending::kCompleted, last_progress_);
    // If records were refused, report the order as closed, so its client does not assume that all records are
    // acknowledged.
    order_.End(refused == 0 ? Ending::kCompleted : Ending::kClosed);
    last_error_ = refused == 0 ? "" : "the destination did not accept " + std::to_string(refused) + " records";
  }
  notes_.ObserveClosed(actions);
}

void SharingSession::Fill(Time now, SharingActions& actions) {
  if (!is_answered()) return;
  SendWhatMayLeave(now, actions);
  const bool is_idle = !maker_.ready() && in_flight_.is_empty();
  const bool is_all_made = phase_ == Phase::kEnding && !maker_.ready();
  if (order_.is_used_up() && !is_all_made) {
    if (in_flight_.is_empty()) EndLimited(now, actions);
    return;
  }
  if (phase_ == Phase::kSending && !maker_.ready()) RequestMissing(actions);
  if (phase_ == Phase::kEnding && is_idle) Complete(actions);
}

void SharingSession::EndLimited(Time now, SharingActions& actions) {
  if (order_.NumberFor(destination_) != 0 && !is_limit_reported_) {
    if (order_.is_waiting()) return;
    is_limit_reported_ = true;
    maker_.MakeEmpty(BatchBytesMax());
    return SendReady(now, actions);
  }
  KeepError("stopped at its order's byte limit; more records remain to be sent");
  End(Ending::kLimited, actions);
}

void SharingSession::SendWhatMayLeave(Time now, SharingActions& actions) {
  paced_until_.reset();
  while (!order_.is_waiting() && maker_.ready() && MayLeave(*maker_.ready())) {
    if (const Time next = pacer_.Next(now); next > now) {
      paced_until_ = next;
      if (in_flight_.is_empty()) SetDeadline(next);
      return;
    }
    SendReady(now, actions);
    maker_.MakeNextFragment(BatchBytesMax());
  }
}

void SharingSession::SendReady(Time now, SharingActions& actions) {
  const std::uint32_t number = maker_.next_number();
  MadeBatch batch = maker_.Take();
  const std::size_t bytes = batch.contents.bytes;
  const std::uint64_t ended_order = order_.NumberFor(destination_);
  if (ended_order != 0 && (batch.message.remaining() == 0 || is_limit_reported_)) {
    proto::OrderEnd& end = *batch.message.mutable_batch()->mutable_order_end();
    end.set_order(ended_order);
    end.set_is_limited(is_limit_reported_);
    end.set_not_taken(in_flight_.RefusedCount());
  }
  pacer_.Spend(bytes + kBatchOverheadBytes, now);
  order_.SpendBytes(bytes);
  counts_.ObserveSent(batch.contents.keys.size(), bytes, batch.message.batch().codec());
  actions.push_back({destination_, std::move(batch.message)});
  notes_.ObserveHandedOver(batch.contents.keys, actions);
  in_flight_.Add(number, std::move(batch.contents));
  SetDeadline(now);
}

bool SharingSession::MayLeave(const MadeBatch& batch) const {
  if (order_.is_used_up()) return false;
  if (in_flight_.is_empty()) return true;
  // The last batch reports that no records remain, so it waits until all batches before it are acknowledged.
  return batch.message.remaining() > 0 && in_flight_.HasRoomFor(batch.contents.bytes);
}

// Returns the size limit of the next batch in coded bytes: the credit or, if lower, the order's remaining bytes,
// between kBatchBytesMin and batch_bytes_max. If no batch is in flight, MayLeave does not check the credit, so this
// limit keeps the batch within the credit.
std::size_t SharingSession::BatchBytesMax() const {
  const std::size_t credit = in_flight_.credit_bytes();
  const std::size_t left = std::min<std::uint64_t>(order_.bytes_left().value_or(credit), credit);
  return std::min(options_.batch_bytes_max, std::max(left, kBatchBytesMin));
}

void SharingSession::RequestMissing(SharingActions& actions) {
  phase_ = Phase::kAsking;
  SharingAction action;
  action.message.set_ms_type(proto::CONTROL);
  action.message.set_request_id(++request_id_);
  proto::MissingRequest& request = *action.message.mutable_missing_request();
  *request.mutable_destination_have() = ToProto(in_flight_.ExpectedHave(maker_.Contents()));
  *request.mutable_filter() = order_.Meant();
  request.set_destination(destination_);
  request.set_kind(kind_);
  request.set_mark(order_.mark());
  const double content_bytes = maker_.ContentBytesFor(BatchBytesMax());
  request.set_content_bytes_max(
      static_cast<std::uint32_t>(std::clamp(content_bytes, kContentBytesMin, kContentBytesMax)));
  request.set_records_max(kRecordsMax);
  actions.push_back(std::move(action));
}

void SharingSession::RequestAgain() {
  if (is_answered()) phase_ = Phase::kSending;
  maker_.PutOffEnd();
}

void SharingSession::GiveUp(std::size_t batches) {
  if (batches == 0) return;
  counts_.ObserveResends(batches);
  RequestAgain();
}

void SharingSession::ForgetInFlight() {
  maker_.StartOver(session_id_, /*is_any_in_flight=*/!in_flight_.is_empty());
  in_flight_.Clear();
  paced_until_.reset();
}

void SharingSession::SetPace(Time now) {
  const bool is_granted_less = granted_rate_ > 0 && (own_rate_ <= 0 || granted_rate_ < own_rate_);
  pacer_.SetRate(is_granted_less ? granted_rate_ : own_rate_, now);
  if (paced_until_) paced_until_ = pacer_.Next(now);
}

void SharingSession::SetDeadline(Time now) {
  const auto transfer = std::chrono::duration<double>(static_cast<double>(in_flight_.unacked_bytes()) /
                                                      static_cast<double>(options_.bytes_per_second_min));
  deadline_ = now + resend_delay_.delay() + std::chrono::duration_cast<Duration>(transfer);
}

}  // namespace moondb
