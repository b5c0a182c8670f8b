#include "actors/sharing/batch_maker.h"

#include <algorithm>
#include <utility>

#include "proto/share_status.pb.h"

namespace moondb {
namespace {

constexpr double kRatioMin = 0.01;
// Upper bound of the bytes in a batch in addition to the coded bytes of its fragment. Each fragment is smaller than the
// batch limit by this much, so two batches fit into the receiver's credit.
constexpr std::size_t kFragmentHeadBytes = 64;

// Returns the number of missing records by data type, without the first `sent_count` records of the reply.
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

// Returns as many dropped intervals as fit into `bytes_max`, but at least one.
std::vector<proto::StreamHave> FirstDropped(const proto::MissingReply& reply, std::size_t bytes_max) {
  constexpr std::size_t kFieldBytes = 6;  // Upper bound of the tag and length bytes of one interval or stream.
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

void BatchMaker::StartOver(std::uint64_t session_id, bool is_any_in_flight) {
  if (ready_ || large_ || is_any_in_flight) encoder_.BeginRun();
  ready_.reset();
  large_.reset();
  session_id_ = session_id;
  next_number_ = 1;
  is_end_reported_ = false;
  is_missing_known_ = false;
}

void BatchMaker::TakeAnswer(const proto::Have& answer) {
  part_ = {answer.part_hash(), answer.part_bytes()};
  is_each_by_itself_ = !answer.keeps_runs();
}

bool BatchMaker::Make(const proto::MissingReply& reply, std::size_t bytes_max, bool is_part_of_order) {
  is_missing_known_ = true;
  const bool is_end_known = is_part_of_order || (reply.dropped().empty() && is_end_reported_);
  if (reply.records().empty() && is_end_known) {
    missing_count_ = 0;
    missing_types_.clear();
    return true;
  }
  Code(reply, bytes_max, is_part_of_order);
  missing_count_ = ready_->message.remaining();
  if (missing_count_ == 0) is_end_reported_ = true;
  // If the reply has dropped intervals, return false: some of them may not have fit into the batch.
  return missing_count_ == 0 && reply.dropped().empty();
}

void BatchMaker::Code(const proto::MissingReply& reply, std::size_t bytes_max, bool is_part_of_order) {
  proto::RecordBatch records;
  *records.mutable_records() = reply.records();
  if (is_each_by_itself_) encoder_.BeginRun();
  CodedBatch coded = encoder_.Encode(codec_, records, bytes_max);
  const int count = coded.record_count;
  std::size_t content_bytes = 0;
  for (int i = 0; i < count; ++i) content_bytes += reply.records(i).content().size();
  LearnRatio(coded.bytes.size(), content_bytes);
  missing_types_ = BacklogOf(reply, count);
  std::uint64_t remaining = reply.remaining() + static_cast<std::uint64_t>(reply.records_size() - count);
  if (is_part_of_order) ++remaining;  // A part of the order must not report that nothing remains.
  if (coded.bytes.size() <= bytes_max || count != 1) return MakeWhole(std::move(coded), reply, remaining, bytes_max);
  const std::uint32_t run = coded.run;
  const bool leans_on_others = coded.leans_on_others;
  large_ = Large{FromProto(reply.records(0).key()), remaining, FragmentCutter(std::move(coded), 1, part_), run,
                 leans_on_others};
  MakeNextFragment(bytes_max);
}

void BatchMaker::MakeEmpty(std::size_t bytes_max) {
  if (ready_ || large_) encoder_.BeginRun();
  large_.reset();
  proto::MissingReply nothing;
  nothing.set_remaining(std::max<std::uint64_t>(RemainingCount(), 1));
  Code(nothing, bytes_max, /*is_part_of_order=*/false);
}

void BatchMaker::LearnRatio(std::size_t coded_bytes, std::size_t content_bytes) {
  if (content_bytes == 0) return;
  const double ratio = static_cast<double>(coded_bytes) / static_cast<double>(content_bytes);
  coded_ratio_ = std::max(kRatioMin, 0.5 * (coded_ratio_ + ratio));
}

void BatchMaker::MakeWhole(CodedBatch coded, const proto::MissingReply& reply, std::uint64_t remaining,
                           std::size_t bytes_max) {
  MadeBatch& made = ready_.emplace();
  for (int i = 0; i < coded.record_count; ++i) made.contents.keys.push_back(FromProto(reply.records(i).key()));
  made.contents.run = coded.run;
  made.contents.leans_on_others = coded.leans_on_others;
  proto::Batch& batch = *made.message.mutable_batch();
  batch.set_codec(coded.codec);
  batch.set_run(coded.run);
  batch.set_record_count(static_cast<std::uint32_t>(coded.record_count));
  // Dropped intervals are sent only after the records that superseded them.
  if (remaining == 0) {
    made.contents.dropped = FirstDropped(reply, bytes_max - std::min(bytes_max, coded.bytes.size()));
    *batch.mutable_dropped() = {made.contents.dropped.begin(), made.contents.dropped.end()};
  }
  if (coded.codec == proto::CODEC_PAPER_SQL) {
    made.message.set_sql(std::move(coded.bytes));
  } else {
    batch.set_coded(std::move(coded.bytes));
  }
  Address(remaining);
}

void BatchMaker::MakeNextFragment(std::size_t bytes_max) {
  if (!large_) return;
  MadeBatch& fragment = ready_.emplace();
  *fragment.message.mutable_batch() = large_->cutter.Next(bytes_max - kFragmentHeadBytes);
  fragment.message.mutable_batch()->set_run(large_->run);
  if (!large_->cutter.is_done()) return Address(large_->remaining + 1);
  fragment.contents.keys = {large_->key};
  fragment.contents.run = large_->run;
  fragment.contents.leans_on_others = large_->leans_on_others;
  missing_count_ = large_->remaining;
  is_end_reported_ = missing_count_ == 0;
  large_.reset();
  Address(missing_count_);
}

void BatchMaker::Address(std::uint64_t remaining) {
  proto::Message& message = ready_->message;
  BatchContents& contents = ready_->contents;
  message.mutable_batch()->set_session_id(session_id_);
  message.mutable_batch()->set_batch_number(next_number_);
  contents.bytes = message.batch().ByteSizeLong() + message.sql().size();
  message.set_ms_type(proto::DATA);
  message.set_remaining(remaining);
  message.set_destination_id(destination_);
  if (!contents.keys.empty() || large_) {
    const RecordKey& first = contents.keys.empty() ? large_->key : contents.keys.front();
    message.set_agent_id(first.stream.origin);
    message.set_data_type(first.stream.type);
    message.set_record_id(ToString(first));
  } else if (!contents.dropped.empty()) {
    message.set_agent_id(contents.dropped.front().origin_agent());
    message.set_data_type(contents.dropped.front().data_type());
  }
}

MadeBatch BatchMaker::Take() {
  MadeBatch batch = *std::move(ready_);
  ready_.reset();
  ++next_number_;
  return batch;
}

HaveSet BatchMaker::Contents() const {
  HaveSet contents;
  if (ready_) AddContents(ready_->contents, contents);
  if (large_) contents[large_->key.stream].held.Add(large_->key.seq);
  return contents;
}

double BatchMaker::ContentBytesFor(std::size_t coded_bytes) const {
  // The compact codec can stop at the size limit, so request more content than probably fits. The other codecs must
  // code a batch again to make it smaller, so request a little less.
  const double share = codec_ == proto::CODEC_COMPACT ? 1.25 : 0.9;
  return share * static_cast<double>(coded_bytes) / coded_ratio_;
}

void BatchMaker::PutOffEnd() {
  is_end_reported_ = false;
  if (large_) large_->remaining = std::max<std::uint64_t>(large_->remaining, 1);
  if (!ready_ || ready_->message.remaining() > 0) return;
  if (ready_->contents.keys.empty()) return ready_.reset();
  ready_->contents.dropped.clear();
  ready_->message.mutable_batch()->clear_dropped();
  Address(1);
}

void BatchMaker::DropRun(std::uint32_t run) {
  if (large_ && large_->run == run) {
    large_.reset();
    ready_.reset();
  }
  if (ready_ && ready_->contents.run == run) ready_.reset();
  if (encoder_.run() == run) is_each_by_itself_ = true;
}

void BatchMaker::ForgetMissing() {
  missing_count_ = 0;
  missing_types_.clear();
  is_missing_known_ = false;
}

void BatchMaker::AddTo(proto::ShareSession& status) const {
  status.set_is_remaining_known(is_missing_known_);
  if (is_missing_known_) *status.mutable_backlog() = {missing_types_.begin(), missing_types_.end()};
}

}  // namespace moondb
