// RecordReader: reads the records that this agent's storage holds, page by page, for the actor that owns the reader.
//
//   class Counter final : public Actor {
//    public:
//     void OnStart(Context& context) override { reader_.Follow(context); }
//     void OnMessage(Context& context, const proto::Message& message) override {
//       if (reader_.OnMessage(context, message)) return;
//       // Handle other messages.
//     }
//
//    private:
//     std::uint64_t count_ = 0;
//     RecordReader reader_{{.data_types = {proto::TEMPERATURE}}, [this](Context&, const proto::StoredRecord&) {
//                            ++count_;
//                            return Result<void>();
//                          }};
//   };
//
// Reads this agent's own records and those received by sharing, each once, in the order in which they were stored here.
// Skips records that were superseded or pruned before their page was read. The cursor (the row id of the last record
// read) is kept in memory, so the reader of a restarted actor starts at the first record (decision 0002).
//
// Follow reads all stored records and then new ones, as long as the actor exists. Read reads the records stored at the
// time of the call; result() is its outcome. At most one request is in flight.
//
// If storage restarts, the reader requests the page again at once. If storage does not answer, cannot be reached or
// returns an error, a following reader retries after retry_delay, any number of times; the reading of any other reader
// ends with the error.
//
// Call the reader only in the handlers of one actor. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "runtime/actor.h"
#include "runtime/rate_limited_log.h"

namespace moondb {

class RecordReader {
 public:
  struct Options {
    std::vector<DataType> data_types;      // Types to read. Empty: all types.
    std::uint32_t page_records_max = 512;  // Records per page. Storage returns at most 10,000.
    // Content bytes per page, at most 32 MiB. A larger record has a page of its own.
    std::uint32_t page_bytes_max = 1024 * 1024;
    Duration answer_timeout = std::chrono::seconds(30);
    Duration retry_delay = std::chrono::seconds(5);  // Delay before a retry after an error, if Follow was called.
  };

  // Called for each record, inside OnMessage. Must not call the reader. If it returns an error, the reading ends with
  // that error, and the next reading starts with this record.
  using Take = std::function<Result<void>(Context&, const proto::StoredRecord&)>;

  // Kind of the timers of all readers. A timer's value is the id of a request, by which each reader of an actor
  // recognises its own timers.
  static constexpr std::uint32_t kTimerKind = 0x7265'6164;

  RecordReader(Options options, Take take);

  // Starts following. Call once, in OnStart. Subscribes the actor to Topic::kStored.
  void Follow(Context& context);
  // Reads the records stored so far. If a reading is in progress, that reading also reads the records stored since its
  // start. If storage cannot be reached and the reader does not follow, the reading ends before this call returns, and
  // result() holds the error.
  void Read(Context& context);
  // Reads like Read, but from the first record. Ends a reading that is in progress, without changing result().
  void ReadAgain(Context& context);
  // Ends a reading that is in progress, without changing result(). Keeps the cursor. If Follow was called, the
  // reader continues at the next RecordsStored.
  void Stop(Context& context);

  // Call with each message that the actor handles. Returns true if the message was for this reader only; the actor must
  // then ignore the message. Returns false for RecordsStored and Down, which the actor and its other readers may need
  // too.
  bool OnMessage(Context& context, const proto::Message& message);

  // True if a page is in flight, or will be requested after a pause.
  bool is_reading() const { return state_ != State::kIdle; }
  // Result of the last reading that ended. kUnavailable: storage cannot be reached. kTimedOut: storage did not answer.
  // Otherwise an error of storage or of Take. No error: all records stored before the last call of Read were read.
  const Result<void>& result() const { return result_; }
  // True if `stored` includes a type that this reader reads.
  bool Reads(const proto::RecordsStored& stored) const;

 private:
  enum class State {
    kIdle,
    kAwaitingPage,
    kPausing,  // A timer runs before the next request.
  };

  bool OnReadReply(Context& context, const proto::Message& message);
  bool OnTimer(Context& context, const proto::Timer& timer);
  void OnRecordsStored(Context& context, const proto::RecordsStored& stored);
  void OnDown(Context& context, const proto::Down& down);

  void Ask(Context& context);
  void RequestAfter(Context& context, Duration delay);
  Result<void> TakePage(Context& context, const proto::ReadReply& page);
  void Finish(Context& context, Result<void> result);

  const Options options_;
  const Take take_;
  State state_ = State::kIdle;
  bool is_following_ = false;
  bool is_more_wanted_ = false;    // True if records may be stored that the page in flight does not contain.
  std::uint64_t last_row_id_ = 0;  // The cursor: row id of the last record read.
  std::uint64_t question_id_ = 0;  // Id of the last request, or of the timer for the next one; 0: none yet.
  TimerId timer_ = 0;
  Result<void> result_;
  RateLimitedLog trouble_log_;
};

}  // namespace moondb
