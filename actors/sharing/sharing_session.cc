#include "actors/sharing/sharing_session.h"

#include <algorithm>
#include <utility>

#include "model/order_number.h"
#include "model/text.h"

namespace moondb {
namespace {

// What one MissingRequest may bring into memory, whatever the ratio says; and what is coded within one message's
// handling: at most 300,000 cells of maps, which take some 15 ms here and at the destination. With more of them in a
// batch the two that fit into the credit are not there and decoded before the radio is idle.
constexpr double kContentBytesMin = 512;
constexpr double kContentBytesMax = 72 * 1024;
constexpr std::uint32_t kRecordsMax = 1024;
constexpr double kRatioMin = 0.01;
// Smaller batches cost more in headers and commits than they save in waiting.
constexpr std::size_t kBatchBytesMin = 1024;
// Beside a batch's own bytes: the heads of its frames, and its acknowledgment, which travels over the same radio.
constexpr std::size_t kBatchOverheadBytes = 300;
// What a batch of one piece holds beside it, at most: so that two fit into the credit.
constexpr std::size_t kPieceHeadBytes = 64;

void AddHeld(const std::vector<RecordKey>& keys, HaveSet& have) {
  for (const RecordKey& key : keys) have[key.stream].held.Add(key.seq);
}

void AddDropped(const std::vector<proto::StreamHave>& streams, HaveSet& have) {
  for (const proto::StreamHave& stream : streams) {
    IntervalSet& dropped = have[{stream.origin_agent(), stream.epoch(), stream.data_type()}].dropped;
    for (const proto::Interval& interval : stream.dropped()) dropped.Add({interval.first(), interval.last()});
  }
}

bool Has(const HaveSet& have, const RecordKey& key) {
  const StreamHave& stream = have.Get(key.stream);
  return stream.held.Contains(key.seq) || stream.dropped.Contains(key.seq);
}

// Takes the batch's first records off what is missing by type, of which nothing is told yet.
std::vector<proto::TypeBacklog> BacklogOf(const proto::MissingReply& reply, int sent_count) {
  std::vector<proto::TypeBacklog> backlog(reply.backlog().begin(), reply.backlog().end());
  for (int i = reply.records_size(); i-- > sent_count;) {
    const DataType type = reply.records(i).key().data_type();
    if (backlog.empty() || backlog.front().data_type() != type) {
      backlog.emplace(backlog.begin())->set_data_type(type);
    }
    backlog.front().set_records(backlog.front().records() + 1);
  }
  return backlog;
}

// As many intervals as fit into `bytes_max`, at least one.
std::vector<proto::StreamHave> FirstDropped(const proto::MissingReply& reply, std::size_t bytes_max) {
  constexpr std::size_t kFieldBytes = 6;  // At most, around each of them.
  std::vector<proto::StreamHave> first;
  std::size_t bytes = 0;
  for (const proto::StreamHave& stream : reply.dropped()) {
    proto::StreamHave part = stream;
    part.clear_dropped();
    bytes += part.ByteSizeLong() + kFieldBytes;
    for (const proto::Interval& interval : stream.dropped()) {
      bytes += interval.ByteSizeLong() + kFieldBytes;
      const bool is_first = first.empty() && part.dropped().empty();
      if (bytes > bytes_max && !is_first) break;
      *part.add_dropped() = interval;
    }
    if (part.dropped().empty()) break;
    first.push_back(std::move(part));
  }
  return first;
}

}  // namespace

SharingSession::SharingSession(Options options, proto::SharingKind kind, AgentId destination, std::uint64_t first_id)
    : options_(std::move(options)),
      kind_(kind),
      destination_(destination),
      session_id_(first_id),
      request_id_(first_id),
      pacer_(options_.unacked_bytes_max),
      encoder_(options_.paper_sql, static_cast<std::uint32_t>(first_id)),
      backoff_(options_.resend_after) {}

SharingActions SharingSession::Order(proto::RecordFilter filter, Time now, std::uint64_t bytes_max, ShareOrderId id) {
  SharingActions actions;
  Note(id);
  const bool is_limited = bytes_max != 0 && (!is_ordered() || bytes_left_);
  bytes_left_ = is_limited ? std::optional(bytes_max) : std::nullopt;
  filter_ = std::move(filter);
  if (!is_ordered()) last_error_.clear();
  is_unasked_ = false;
  LookAgain(now, actions);
  return actions;
}

void SharingSession::Note(ShareOrderId id) {
  if (id.number == 0) return;
  KnownOrder& known = orders_[id.agent];
  known.is_open = true;
  known.order.set_agent(id.agent);
  // A late copy of an earlier order takes nothing back.
  if (!HasReached(known.order.ordered(), id.number)) known.order.set_ordered(id.number);
}

void SharingSession::EndOrders(void (proto::SessionOrder::*set_reached)(std::uint64_t)) {
  for (auto& [agent, known] : orders_) {
    if (std::exchange(known.is_open, false)) (known.order.*set_reached)(known.order.ordered());
  }
}

SharingActions SharingSession::BringUnasked(const proto::RecordFilter& states, Time now) {
  SharingActions actions;
  if (!is_open()) {
    bytes_left_.reset();
    filter_ = states;
    is_unasked_ = true;
    LookAgain(now, actions);
    return actions;
  }
  // What storage is asked already, or what ends, needs no reminder; neither does a destination that is silent.
  const bool is_sending = phase_ == Phase::kSending && !is_asking_ && !is_end_told_;
  const bool waits_for_states = is_waiting_ && window_ == Window::kStatesOnly;
  if (is_waiting_ ? waits_for_states : is_sending) LookAgain(now, actions);
  return actions;
}

void SharingSession::LookAgain(Time now, SharingActions& actions) {
  const bool was_waiting = is_waiting_;
  if (window_ == Window::kStatesOnly) is_waiting_ = StatesMeant().data_types().empty();
  if (!is_open()) {
    last_progress_ = now;
    Start(now, actions);
  } else if (was_waiting) {
    Start(now, actions);
  } else if (!IsAllAsked() || (is_for_states_ && !IsForStates())) {
    Start(now, actions);  // The destination has not said what it has of these, or the session was for less.
  } else if (phase_ == Phase::kAwaitingHave) {
    // Whoever asks again while the destination is silent does not wait for a delay that has grown.
    if (backoff_ > options_.resend_after) Start(now, actions);
  } else {
    AskAnew();
    Fill(now, actions);
  }
}

SharingActions SharingSession::Close() {
  SharingActions actions;
  if (!is_open()) return actions;
  if (!is_unasked_) ++closed_sessions_;
  EndOrders(&proto::SessionOrder::set_closed);
  End(actions);
  encoder_.BeginRun();  // The run may be some megabytes, and nobody may ever share with this destination again.
  return actions;
}

void SharingSession::End(SharingActions& actions) {
  phase_ = Phase::kClosed;
  ForgetUnderWay();
  missing_count_ = 0;  // Nobody asks for them any more.
  missing_types_.clear();
  is_remaining_known_ = false;
  TellStorage({}, /*is_closed=*/true, actions);
}

SharingActions SharingSession::OnHave(const proto::Have& have, Time now) {
  SharingActions actions;
  if (!is_open() || have.session_id() != session_id_) return actions;
  if (phase_ == Phase::kAwaitingHave && !have.is_whole()) return actions;
  Result<HaveSet> heard = CheckHave(have);
  if (!heard) {
    ++refused_haves_;
    NoteError("the destination's have-set was refused: " + ToString(heard.error()));
    return actions;
  }
  if (phase_ == Phase::kAwaitingHave) {
    have_ = *std::move(heard);
    part_ = {have.part_hash(), have.part_bytes()};
    other_schema_types_ = TypesNotFor(options_.schemas, have.schemas());
    is_each_by_itself_ = !have.keeps_runs();
    is_codec_read_ = std::find(have.codecs().begin(), have.codecs().end(), options_.codec) != have.codecs().end();
    phase_ = Phase::kSending;
    last_progress_ = now;
    answered_ = now;
    session_acknowledged_records_ = 0;
    session_acknowledged_bytes_ = 0;
    SetDeadline(now);
  } else {
    have_.Merge(*heard);
  }
  credit_bytes_ = std::min<std::size_t>(options_.unacked_bytes_max, have.unacked_bytes_max());
  granted_rate_ = have.bytes_per_second_max();
  SetPace(now);
  if (have.needs_new_run()) {
    OnRunBroken(have.batch_number());
    Fill(now, actions);
    return actions;
  }
  const std::size_t under_way_before = under_way_.size();
  const double acknowledged_before = acknowledged_records_;
  Acknowledge(have.batch_number());
  if (under_way_.size() < under_way_before) {
    last_progress_ = now;
    if (acknowledged_records_ > acknowledged_before) is_refused_ = false;
    // Pieces are acknowledged by a destination, too, that cannot store what they make up.
    if (!is_refused_) {
      backoff_ = options_.resend_after;
      has_restarted_at_once_ = false;
    }
    SetDeadline(now);
  }
  GiveUpBatchesBefore(have.batch_number());
  TellStorage({}, /*is_closed=*/false, actions);
  Fill(now, actions);
  return actions;
}

SharingActions SharingSession::OnRefusal(const proto::Refusal& refusal, Time now) {
  SharingActions actions;
  if (!is_open() || refusal.session_id() != session_id_) return actions;
  const Error error = FromProto(refusal.error());
  if (error.code == ErrorCode::kNotFound && !has_restarted_at_once_) {
    // The receiver started anew. Once only without progress in between: the delay serves what lasts.
    has_restarted_at_once_ = true;
    Restart(now, actions);
    return actions;
  }
  is_refused_ = true;
  NoteError("the destination refused: " + OneLine(ToString(error)));
  if (error.code == ErrorCode::kRefused || error.code == ErrorCode::kInvalid) return Close();
  return actions;
}

SharingActions SharingSession::OnMissingReply(std::uint64_t request_id, const proto::MissingReply& reply, Time now) {
  SharingActions actions;
  if (phase_ != Phase::kSending || !is_asking_ || request_id != request_id_) return actions;
  if (reply.records().empty() && reply.remaining() > 0) {
    NoteError("storage cannot say what is missing");  // Still asking, so that the deadline starts over.
    return actions;
  }
  is_asking_ = false;
  is_remaining_known_ = true;
  const bool is_end_known = is_for_states_ || (reply.dropped().empty() && is_end_told_);
  if (reply.records().empty() && is_end_known) {
    is_exhausted_ = true;
    missing_count_ = 0;
    missing_types_.clear();
  } else {
    ready_ = Code(reply);
    missing_count_ = ready_->message.remaining();
    // One message does not always hold all that is dropped.
    is_exhausted_ = missing_count_ == 0 && reply.dropped().empty();
    if (missing_count_ == 0) is_end_told_ = true;
  }
  Fill(now, actions);
  return actions;
}

void SharingSession::SetRate(double bytes_per_second, Time now) {
  own_rate_ = bytes_per_second;
  SetPace(now);
}

SharingActions SharingSession::SetWindow(Window window, Time now) {
  SharingActions actions;
  if (window == window_) return actions;
  window_ = window;
  is_waiting_ = window != Window::kOpen;
  if (is_open() && !is_waiting_) Start(now, actions);
  return actions;
}

SharingActions SharingSession::OnConnected(Time now) {
  SharingActions actions;
  if (is_open()) Start(now, actions);
  return actions;
}

SharingActions SharingSession::OnTimer(Time now) {
  SharingActions actions;
  if (!is_open() || is_waiting_) return actions;
  Fill(now, actions);
  if (!is_open() || is_waiting_ || now < deadline_) return actions;
  backoff_ = std::min(2 * backoff_, options_.resend_after_max);
  Restart(now, actions);
  return actions;
}

std::optional<SharingSession::Time> SharingSession::deadline() const {
  if (!is_open() || is_waiting_) return std::nullopt;
  return paced_until_ ? std::min(*paced_until_, deadline_) : deadline_;
}

proto::ShareSession SharingSession::Status(Time now) const {
  std::uint64_t remaining = missing_count_ + (ready_ ? ready_->keys.size() : 0);
  for (const auto& [number, batch] : under_way_) remaining += batch.keys.size();
  proto::ShareSession status;
  status.set_destination(destination_);
  status.set_kind(kind_);
  status.set_is_open(is_open());
  status.set_remaining(static_cast<double>(remaining));
  status.set_sent_records(sent_records_);
  status.set_acknowledged_records(acknowledged_records_);
  status.set_coded_bytes(coded_bytes_);
  status.set_completed_sessions(completed_sessions_);
  status.set_closed_sessions(closed_sessions_);
  status.set_limited_sessions(limited_sessions_);
  status.set_is_unasked(is_open() && is_unasked_);
  status.set_resends(resends_);
  status.set_refused_haves(refused_haves_);
  status.set_seconds_since_progress(std::chrono::duration<double>(now - last_progress_).count());
  status.set_last_error(last_error_);
  status.set_is_remaining_known(is_remaining_known_);
  status.mutable_other_schema_types()->Assign(other_schema_types_.begin(), other_schema_types_.end());
  status.set_bytes_per_second_max(pacer_.rate());
  if (is_remaining_known_) *status.mutable_backlog() = {missing_types_.begin(), missing_types_.end()};
  status.set_codec(codec_sent_);
  for (const auto& [agent, known] : orders_) *status.add_orders() = known.order;
  if (phase_ == Phase::kSending) {
    status.set_session_s(std::chrono::duration<double>(now - answered_).count());
    status.set_session_acknowledged_records(session_acknowledged_records_);
    status.set_session_acknowledged_bytes(session_acknowledged_bytes_);
  }
  return status;
}

std::set<AgentId> SharingSession::OriginsMeant() const {
  std::set<AgentId> origins(filter_.origin_agents().begin(), filter_.origin_agents().end());
  if (!origins.empty() && filter_.own_records_of() != 0) origins.insert(filter_.own_records_of());
  return origins;
}

bool SharingSession::IsAllAsked() const {
  if (asked_.empty()) return true;
  const auto is_asked = [this](DataType type) { return asked_types_.contains(type); };
  const std::set<AgentId> origins = OriginsMeant();
  return !origins.empty() && std::includes(asked_.begin(), asked_.end(), origins.begin(), origins.end()) &&
         std::all_of(filter_.everyones_types().begin(), filter_.everyones_types().end(), is_asked);
}

proto::RecordFilter SharingSession::StatesMeant() const {
  proto::RecordFilter states = filter_;
  states.clear_data_types();
  states.clear_own_records_of();
  states.clear_everyones_types();
  for (const DataType type : options_.state_types) {
    const auto& meant = filter_.data_types();
    if (meant.empty() || std::find(meant.begin(), meant.end(), type) != meant.end()) states.add_data_types(type);
  }
  return states;
}

Result<HaveSet> SharingSession::CheckHave(const proto::Have& have) const {
  const bool is_of_a_batch = have.batch_number() != 0 || !have.is_whole();
  if (is_of_a_batch && (have.batch_number() == 0 || have.batch_number() >= next_batch_number_)) {
    return Fail(ErrorCode::kInvalid, "was never sent", "batch_number");
  }
  Result<HaveSet> heard = FromProto(have.have());
  if (!heard || phase_ == Phase::kAwaitingHave) return heard;
  // It joins what was heard before.
  const bool fits = have_.streams().size() + heard->streams().size() <= kHaveStreamsMax &&
                    have_.IntervalCount() + heard->IntervalCount() <= kHaveIntervalsMax;
  if (!fits) return Fail(ErrorCode::kInvalid, "has grown too large", "have");
  return heard;
}

void SharingSession::Start(Time now, SharingActions& actions) {
  is_refused_ = false;
  has_restarted_at_once_ = false;
  backoff_ = options_.resend_after;
  Restart(now, actions);
}

void SharingSession::Restart(Time now, SharingActions& actions) {
  if (is_open() && !is_waiting_) ++resends_;
  phase_ = Phase::kAwaitingHave;
  is_remaining_known_ = false;
  ForgetUnderWay();
  ++session_id_;
  if (session_id_ == 0) ++session_id_;
  refused_ = HaveSet();
  SetDeadline(now);
  is_for_states_ = IsForStates();
  if (is_waiting_) return;
  SharingAction action{destination_, {}};
  action.message.set_ms_type(proto::CONTROL);
  proto::Hello& hello = *action.message.mutable_hello();
  hello.set_session_id(session_id_);
  hello.set_kind(kind_);
  hello.set_schema_hash(HashSchemas(options_.schemas));
  asked_ = OriginsMeant();
  hello.mutable_origin_agents()->Assign(asked_.begin(), asked_.end());
  asked_types_ = {filter_.everyones_types().begin(), filter_.everyones_types().end()};
  *hello.mutable_everyones_types() = filter_.everyones_types();
  actions.push_back(std::move(action));
}

void SharingSession::Complete(SharingActions& actions) {
  if (is_for_states_ && !is_unasked_) {
    is_waiting_ = true;  // The rest of the order.
    return;
  }
  phase_ = Phase::kClosed;
  if (is_unasked_) return TellStorage({}, /*is_closed=*/true, actions);
  ++completed_sessions_;
  EndOrders(&proto::SessionOrder::set_completed);
  std::uint64_t refused_count = 0;
  for (const auto& [key, stream] : refused_.streams()) refused_count += stream.held.Count();
  last_error_ = refused_count == 0 ? "" : "the destination did not take " + std::to_string(refused_count) + " records";
  TellStorage({}, /*is_closed=*/true, actions);
}

void SharingSession::EndLimitedOrder(SharingActions& actions) {
  NoteError("ended with its order's bytes; more is left to share");
  ++limited_sessions_;
  EndOrders(&proto::SessionOrder::set_limited);
  End(actions);
}

void SharingSession::Fill(Time now, SharingActions& actions) {
  if (phase_ != Phase::kSending) return;
  paced_until_.reset();
  while (!is_waiting_ && ready_ && MayLeave(*ready_)) {
    if (const Time next = pacer_.Next(now); next > now) {
      paced_until_ = next;
      if (under_way_.empty()) SetDeadline(next);
      break;
    }
    SendReady(now, actions);
    if (large_) ready_ = NextPiece();
  }
  if (bytes_left_ == 0 && !(is_exhausted_ && !ready_)) {
    if (under_way_.empty()) EndLimitedOrder(actions);
    return;
  }
  if (!ready_ && !is_asking_ && !is_exhausted_) AskForMissing(actions);
  if (!ready_ && !is_asking_ && under_way_.empty()) Complete(actions);
}

void SharingSession::AskForMissing(SharingActions& actions) {
  is_asking_ = true;
  SharingAction action;
  action.message.set_ms_type(proto::CONTROL);
  action.message.set_request_id(++request_id_);
  proto::MissingRequest& request = *action.message.mutable_missing_request();
  *request.mutable_destination_have() = ToProto(ExpectedHave());
  *request.mutable_filter() = is_for_states_ ? StatesMeant() : filter_;
  request.mutable_filter()->mutable_not_data_types()->Assign(other_schema_types_.begin(), other_schema_types_.end());
  // What cannot be cut without being coded anew should just fit.
  const double share = CodecNow() == proto::CODEC_COMPACT ? 1.25 : 0.9;
  const double content_bytes = share * static_cast<double>(BatchBytesMax()) / coded_ratio_;
  request.set_content_bytes_max(
      static_cast<std::uint32_t>(std::clamp(content_bytes, kContentBytesMin, kContentBytesMax)));
  request.set_records_max(kRecordsMax);
  actions.push_back(std::move(action));
}

void SharingSession::SendReady(Time now, SharingActions& actions) {
  CodedRecords batch = *std::move(ready_);
  ready_.reset();
  const std::uint32_t number = next_batch_number_++;
  proto::Message message = std::move(batch.message);
  batch.message.Clear();
  unacked_bytes_ += batch.bytes;
  pacer_.Spend(batch.bytes + kBatchOverheadBytes, now);
  if (bytes_left_) *bytes_left_ -= std::min<std::uint64_t>(*bytes_left_, batch.bytes);
  sent_records_ += static_cast<double>(batch.keys.size());
  coded_bytes_ += static_cast<double>(batch.bytes);
  codec_sent_ = message.batch().codec();
  actions.push_back({destination_, std::move(message)});
  TellStorage(batch.keys, /*is_closed=*/false, actions);
  under_way_.emplace(number, std::move(batch));
  SetDeadline(now);
}

// One batch leaves without credit too: where several senders share what the receiver grants, it is no larger than that.
std::size_t SharingSession::BatchBytesMax() const {
  const std::size_t left = bytes_left_ ? std::min<std::uint64_t>(*bytes_left_, credit_bytes_) : credit_bytes_;
  return std::min(options_.batch_bytes_max, std::max(left, kBatchBytesMin));
}

bool SharingSession::MayLeave(const CodedRecords& batch) const {
  if (bytes_left_ == 0) return false;
  if (under_way_.empty()) return true;
  // The last one says that all is there: so all before it is.
  return batch.message.remaining() > 0 && unacked_bytes_ + batch.bytes <= credit_bytes_;
}

proto::Codec SharingSession::CodecNow() const {
  const bool is_always_read = options_.codec == proto::CODEC_PLAIN || options_.codec == proto::CODEC_ZSTD;
  return is_always_read || is_codec_read_ ? options_.codec : proto::CODEC_ZSTD;
}

SharingSession::CodedRecords SharingSession::Code(const proto::MissingReply& reply) {
  const std::size_t bytes_max = BatchBytesMax();
  proto::RecordBatch records;
  *records.mutable_records() = reply.records();
  if (is_each_by_itself_) encoder_.BeginRun();
  CodedBatch coded = encoder_.Encode(CodecNow(), records, bytes_max);
  const int count = coded.record_count;
  CodedRecords result;
  result.run = coded.run;
  result.leans_on_others = coded.leans_on_others;
  std::size_t content_bytes = 0;
  for (int i = 0; i < count; ++i) {
    result.keys.push_back(FromProto(reply.records(i).key()));
    content_bytes += reply.records(i).content().size();
  }
  if (content_bytes > 0) {
    const double ratio = static_cast<double>(coded.bytes.size()) / static_cast<double>(content_bytes);
    coded_ratio_ = std::max(kRatioMin, 0.5 * (coded_ratio_ + ratio));
  }
  missing_types_ = BacklogOf(reply, count);
  std::uint64_t remaining = reply.remaining() + static_cast<std::uint64_t>(reply.records_size() - count);
  if (is_for_states_) ++remaining;  // The end is not told before the rest of the order has gone.
  if (coded.bytes.size() > bytes_max && count == 1) {
    large_ = Large{result.keys.front(), remaining, PieceCutter(std::move(coded), 1, part_), result.run,
                   result.leans_on_others};
    return NextPiece();
  }
  proto::Batch& batch = *result.message.mutable_batch();
  const std::size_t coded_bytes = coded.bytes.size();
  batch.set_codec(coded.codec);
  batch.set_run(coded.run);
  if (coded.codec == proto::CODEC_PAPER_SQL) {
    result.message.set_sql(std::move(coded.bytes));
  } else {
    batch.set_coded(std::move(coded.bytes));
  }
  batch.set_record_count(static_cast<std::uint32_t>(count));
  // What is dropped never travels before what superseded it.
  if (remaining == 0) {
    result.dropped = FirstDropped(reply, bytes_max - std::min(bytes_max, coded_bytes));
    batch.mutable_dropped()->Assign(result.dropped.begin(), result.dropped.end());
  }
  Address(result, remaining);
  return result;
}

SharingSession::CodedRecords SharingSession::NextPiece() {
  CodedRecords piece;
  *piece.message.mutable_batch() = large_->cutter.Next(BatchBytesMax() - kPieceHeadBytes);
  piece.message.mutable_batch()->set_run(large_->run);
  if (!large_->cutter.is_done()) {
    Address(piece, large_->remaining + 1);
    return piece;
  }
  piece.keys = {large_->key};
  piece.run = large_->run;
  piece.leans_on_others = large_->leans_on_others;
  missing_count_ = large_->remaining;
  is_end_told_ = missing_count_ == 0;
  large_.reset();
  Address(piece, missing_count_);
  return piece;
}

void SharingSession::Address(CodedRecords& batch, std::uint64_t remaining) const {
  batch.message.mutable_batch()->set_session_id(session_id_);
  batch.message.mutable_batch()->set_batch_number(next_batch_number_);
  batch.bytes = batch.message.batch().ByteSizeLong() + batch.message.sql().size();
  batch.message.set_ms_type(proto::DATA);
  batch.message.set_remaining(remaining);
  batch.message.set_destination_id(destination_);
  if (!batch.keys.empty() || large_) {
    const RecordKey& first = batch.keys.empty() ? large_->key : batch.keys.front();
    batch.message.set_agent_id(first.stream.origin);
    batch.message.set_data_type(first.stream.type);
    batch.message.set_record_id(ToString(first));
  } else if (!batch.dropped.empty()) {
    batch.message.set_agent_id(batch.dropped.front().origin_agent());
    batch.message.set_data_type(batch.dropped.front().data_type());
  }
}

HaveSet SharingSession::ExpectedHave() const {
  HaveSet expected = have_;
  expected.Merge(refused_);
  const auto add = [&expected](const CodedRecords& batch) {
    AddHeld(batch.keys, expected);
    AddDropped(batch.dropped, expected);
  };
  for (const auto& [number, batch] : under_way_) add(batch);
  if (ready_) add(*ready_);
  if (large_) AddHeld({large_->key}, expected);
  // Held and dropped stay apart, whatever overlapped above.
  HaveSet apart;
  apart.Merge(expected);
  return apart;
}

void SharingSession::Acknowledge(std::uint32_t batch_number) {
  for (auto it = under_way_.begin(); it != under_way_.end();) {
    const CodedRecords& batch = it->second;
    const auto had =
        std::count_if(batch.keys.begin(), batch.keys.end(), [this](const RecordKey& key) { return Has(have_, key); });
    const bool is_all_had = !batch.keys.empty() && static_cast<std::size_t>(had) == batch.keys.size();
    if (it->first != batch_number && !is_all_had) {
      ++it;
      continue;
    }
    for (const RecordKey& key : batch.keys) {
      if (!Has(have_, key)) refused_[key.stream].held.Add(key.seq);
    }
    AddDropped(batch.dropped, refused_);  // Where the destination keeps one for now, it has its reason.
    acknowledged_records_ += static_cast<double>(had);
    session_acknowledged_records_ += static_cast<double>(had);
    session_acknowledged_bytes_ += static_cast<double>(batch.bytes);
    unacked_bytes_ -= batch.bytes;
    it = under_way_.erase(it);
  }
}

// Batches travel nearly in order: one that is still open when the second after it is acknowledged was lost.
void SharingSession::GiveUpBatchesBefore(std::uint32_t batch_number) {
  while (!under_way_.empty() && under_way_.begin()->first + 2 <= batch_number) GiveUp(under_way_.begin());
}

void SharingSession::GiveUp(std::map<std::uint32_t, CodedRecords>::iterator batch) {
  ++resends_;
  unacked_bytes_ -= batch->second.bytes;
  under_way_.erase(batch);
  AskAnew();
}

// Only what leans on others can need them: so a destination that always says so is not listened to for ever.
void SharingSession::OnRunBroken(std::uint32_t batch_number) {
  const auto broken = under_way_.find(batch_number);
  if (broken == under_way_.end() || !broken->second.leans_on_others) return;
  const std::uint32_t run = broken->second.run;
  if (large_ && large_->run == run) {
    large_.reset();
    ready_.reset();
  }
  if (ready_ && ready_->run == run) ready_.reset();
  if (encoder_.run() == run) is_each_by_itself_ = true;
  GiveUp(broken);
}

// What storage said is missing is no longer all.
void SharingSession::AskAnew() {
  is_asking_ = false;
  is_exhausted_ = false;
  is_end_told_ = false;
  if (large_) large_->remaining = std::max<std::uint64_t>(large_->remaining, 1);
  if (!ready_ || ready_->message.remaining() > 0) return;
  if (ready_->keys.empty()) {
    ready_.reset();
    return;
  }
  // It is not the end any more.
  ready_->dropped.clear();
  ready_->message.mutable_batch()->clear_dropped();
  Address(*ready_, 1);
}

void SharingSession::ForgetUnderWay() {
  if (ready_ || large_ || !under_way_.empty()) encoder_.BeginRun();
  AskAnew();
  ready_.reset();
  large_.reset();
  under_way_.clear();
  unacked_bytes_ = 0;
  paced_until_.reset();
  next_batch_number_ = 1;
}

void SharingSession::TellStorage(const std::vector<RecordKey>& handed_over, bool is_closed,
                                 SharingActions& actions) const {
  SharingAction action;
  action.message.set_ms_type(proto::EVENT);
  proto::PeerHave& peer_have = *action.message.mutable_peer_have();
  peer_have.set_peer(destination_);
  *peer_have.mutable_acknowledged() = ToProto(have_);
  peer_have.mutable_origin_agents()->Assign(asked_.begin(), asked_.end());
  for (const RecordKey& key : handed_over) *peer_have.add_handed_over() = ToProto(key);
  peer_have.set_is_session_closed(is_closed);
  actions.push_back(std::move(action));
}

void SharingSession::SetPace(Time now) {
  const bool is_granted_less = granted_rate_ > 0 && (own_rate_ <= 0 || granted_rate_ < own_rate_);
  pacer_.SetRate(is_granted_less ? granted_rate_ : own_rate_, now);
  if (paced_until_) paced_until_ = pacer_.Next(now);
}

void SharingSession::SetDeadline(Time now) {
  const auto transfer = std::chrono::duration<double>(static_cast<double>(unacked_bytes_) /
                                                      static_cast<double>(options_.bytes_per_second_min));
  deadline_ = now + backoff_ + std::chrono::duration_cast<Duration>(transfer);
}

}  // namespace moondb
