#include "runtime/record_reader.h"

#include <algorithm>
#include <string>
#include <utility>

namespace moondb {
namespace {

Address StorageOf(const Context& context) { return {context.self().agent, actor_name::kStorage}; }

}  // namespace

RecordReader::RecordReader(Options options, Take take) : options_(std::move(options)), take_(std::move(take)) {}

void RecordReader::Follow(Context& context) {
  is_following_ = true;
  context.Watch(Topic::kStored);
  Read(context);
}

void RecordReader::Read(Context& context) {
  if (question_id_ == 0) {
    // Start at a random id, so that a late reply to a request from before a restart matches no new request.
    question_id_ = context.rng()();
    context.Monitor(StorageOf(context));
  }
  is_more_wanted_ = true;
  if (!is_reading()) Ask(context);
}

void RecordReader::ReadAgain(Context& context) {
  Stop(context);
  last_row_id_ = 0;
  Read(context);
}

void RecordReader::Stop(Context& context) {
  context.Cancel(timer_);
  state_ = State::kIdle;
}

bool RecordReader::OnMessage(Context& context, const proto::Message& message) {
  switch (message.body_case()) {
    case proto::Message::kReadReply:
      return OnReadReply(context, message);
    case proto::Message::kTimer:
      return OnTimer(context, message.timer());
    case proto::Message::kRecordsStored:
      OnRecordsStored(context, message.records_stored());
      return false;
    case proto::Message::kDown:
      OnDown(context, message.down());
      return false;
    default:
      return false;
  }
}

bool RecordReader::OnReadReply(Context& context, const proto::Message& message) {
  const bool is_answer =
      state_ == State::kAwaitingPage && message.request_id() == question_id_ && context.sender() == StorageOf(context);
  if (!is_answer) return false;
  const proto::ReadReply& page = message.read_reply();
  if (Result<void> taken = TakePage(context, page); !taken) {
    Finish(context, std::move(taken));
  } else if (is_more_wanted_ || (!page.is_complete() && page.row_ids_size() > 0)) {
    Ask(context);
  } else {
    Finish(context, {});
  }
  return true;
}

bool RecordReader::OnTimer(Context& context, const proto::Timer& timer) {
  const bool is_own = timer.kind() == kTimerKind && timer.value() == question_id_ && is_reading();
  if (!is_own || context.sender() != context.self()) return false;
  if (state_ == State::kPausing) {
    Ask(context);
  } else {
    Finish(context, Fail(ErrorCode::kTimedOut, "storage did not answer"));
  }
  return true;
}

// Later RecordsStored messages are merged into one that waits, so `stored` may report rows that the page in flight does
// not contain.
void RecordReader::OnRecordsStored(Context& context, const proto::RecordsStored& stored) {
  if (!is_following_ || context.sender() != StorageOf(context)) return;
  if (stored.last_row_id() > last_row_id_ && Reads(stored)) Read(context);
}

// Requests the page again through a timer and not directly, because a reading may end only in Read or in an OnMessage
// that returns true. After Follow, an idle reader requests a page too, because storage may have failed after a commit
// and before it published RecordsStored.
void RecordReader::OnDown(Context& context, const proto::Down& down) {
  const Address lost{down.agent(), down.actor()};
  if (lost != StorageOf(context) || down.is_final()) return;
  if (is_following_ || is_reading()) RequestAfter(context, Duration::zero());
}

void RecordReader::Ask(Context& context) {
  context.Cancel(timer_);
  state_ = State::kAwaitingPage;
  is_more_wanted_ = false;
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(++question_id_);
  proto::ReadRequest& request = *message.mutable_read_request();
  request.set_after_row_id(last_row_id_);
  *request.mutable_data_types() = {options_.data_types.begin(), options_.data_types.end()};
  request.set_records_max(options_.page_records_max);
  request.set_content_bytes_max(options_.page_bytes_max);
  const SendResult sent = context.Send(StorageOf(context), std::move(message));
  if (sent != SendResult::kAccepted) {
    return Finish(context,
                  Fail(ErrorCode::kUnavailable, std::string("storage does not accept requests: ") + ToString(sent)));
  }
  timer_ = context.AfterTimer(options_.answer_timeout, kTimerKind, question_id_);
}

void RecordReader::RequestAfter(Context& context, Duration delay) {
  context.Cancel(timer_);
  state_ = State::kPausing;
  timer_ = context.AfterTimer(delay, kTimerKind, ++question_id_);
}

// Advances the cursor after each record, so that a retry after an error repeats no record.
Result<void> RecordReader::TakePage(Context& context, const proto::ReadReply& page) {
  if (IsError(page.error())) return tl::unexpected(FromProto(page.error()));
  const int count = std::min(page.records_size(), page.row_ids_size());
  for (int i = 0; i < count; ++i) {
    if (Result<void> taken = take_(context, page.records(i)); !taken) return taken;
    last_row_id_ = std::max(last_row_id_, page.row_ids(i));
  }
  return {};
}

void RecordReader::Finish(Context& context, Result<void> result) {
  context.Cancel(timer_);
  state_ = State::kIdle;
  result_ = std::move(result);
  if (result_ || !is_following_) return;
  trouble_log_.Warn(ToString(context.self()) +
                    ": cannot read records and tries again soon: " + ToString(result_.error()));
  RequestAfter(context, options_.retry_delay);
}

bool RecordReader::Reads(const proto::RecordsStored& stored) const {
  const std::vector<DataType>& wanted = options_.data_types;
  return wanted.empty() || std::any_of(stored.data_types().begin(), stored.data_types().end(), [&](DataType type) {
           return std::find(wanted.begin(), wanted.end(), type) != wanted.end();
         });
}

}  // namespace moondb
