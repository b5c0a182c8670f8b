#include "runtime/record_writer.h"

#include <algorithm>
#include <string>
#include <utility>

#include "model/check.h"

namespace moondb {

void RecordWriter::Write(Context& context, std::vector<proto::Record> records) {
  Check(!is_writing_, "a writer writes one batch at a time");
  // Start at a random id, so that a late reply to a request from before a restart matches no new request.
  if (request_id_ == 0) request_id_ = context.rng()() >> 1;
  records_ = std::move(records);
  sent_count_ = stored_count_ = 0;
  is_writing_ = true;
  WriteChunk(context);
}

void RecordWriter::WriteChunk(Context& context) {
  const std::size_t count = std::min(records_.size() - sent_count_, options_.chunk_records_max);
  if (count == 0) return Finish(context, {});
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(++request_id_);
  for (std::size_t i = 0; i < count; ++i) {
    *message.mutable_insert_request()->add_records() = std::move(records_[sent_count_ + i]);
  }
  sent_count_ += count;
  const SendResult sent = context.Send({context.self().agent, actor_name::kStorage}, std::move(message));
  if (sent != SendResult::kAccepted) {
    return Finish(context,
                  Fail(ErrorCode::kUnavailable, std::string("storage does not accept requests: ") + ToString(sent)));
  }
  timeout_ = context.AfterTimer(options_.answer_timeout, kTimerKind, request_id_);
}

bool RecordWriter::OnMessage(Context& context, const proto::Message& message) {
  if (!is_writing_) return false;
  const proto::Timer& timer = message.timer();
  if (timer.kind() == kTimerKind && timer.value() == request_id_ && context.sender() == context.self()) {
    Finish(context, Fail(ErrorCode::kTimedOut, "storage did not answer"));
    return true;
  }
  const bool is_answer = message.has_insert_reply() && message.request_id() == request_id_ &&
                         context.sender() == Address{context.self().agent, actor_name::kStorage};
  if (!is_answer) return false;
  context.Cancel(timeout_);
  const proto::InsertReply& reply = message.insert_reply();
  if (IsError(reply.error())) {
    Finish(context, tl::unexpected(FromProto(reply.error())));
  } else {
    stored_count_ += static_cast<std::size_t>(reply.keys_size());
    WriteChunk(context);
  }
  return true;
}

void RecordWriter::Stop(Context& context) {
  context.Cancel(timeout_);
  is_writing_ = false;
  records_.clear();
}

void RecordWriter::Finish(Context& context, Result<void> result) {
  Stop(context);
  result_ = std::move(result);
}

}  // namespace moondb
