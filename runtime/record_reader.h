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
// Reads records of `data_types`, both this agent's own and those received by sharing. Each is read once, in the order
// in which they were stored here. Records that were superseded or pruned before their page was read are skipped. The
// cursor is the row id of the last record read. It is kept in memory: a restarted actor has a new reader, which starts
// at the first record (decision 0002).
//
// Follow reads all stored records and then new ones, as long as the actor exists. Read reads the records stored at the
// time of the call; result() is its outcome.
//
// Concurrent changes and failures:
//   - Records are stored while a page is in flight: the reader requests another page after it.
//   - Storage fails and restarts: the reader requests the page again at once. A following reader that was idle requests
//     a page too, because storage may have failed before it published its last commit.
//   - A page is lost at a full mailbox, or storage does not answer, cannot be reached or returns an error: a following
//     reader retries after retry_delay, any number of times. The reading of any other reader ends with the error.
//   - Replies to abandoned requests, and replies that are not from storage, are ignored.
// One request is in flight at a time. A request that timed out may still wait in storage's mailbox. At most one such
// request is added per answer_timeout, and the watchdog ends a process whose storage gets no turn.
//
// Call it only in the handlers of one actor. Not thread-safe; starts no thread.
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
    Duration retry_delay = std::chrono::seconds(5);  // Delay before a following reader retries.
  };

  // Called for each record, inside OnMessage. Must not call the reader. An error ends the reading like an error of
  // storage, and the next reading starts with this record.
  using Take = std::function<Result<void>(Context&, const proto::StoredRecord&)>;

  // Kind of the timers of all readers. A timer's value shows to which of an actor's readers it belongs.
  static constexpr std::uint32_t kTimerKind = 0x7265'6164;

  RecordReader(Options options, Take take);

  // Starts following. Call once, in OnStart. Watches Topic::kStored.
  void Follow(Context& context);
  // Reads the records stored so far. Extends a reading that is in progress. If storage cannot be reached and the reader
  // does not follow, the reading has ended when this returns.
  void Read(Context& context);
  // As Read, but restarts at the first record. Ends a reading that is in progress, without a result.
  void ReadAgain(Context& context);
  // Ends a reading that is in progress, without a result. Keeps the cursor. A following reader continues at the next
  // RecordsStored.
  void Stop(Context& context);

  // Call with each message that the actor handles. Returns true if the message was for this reader only; the actor must
  // then ignore it. Returns false for RecordsStored and Down, because the actor and its other readers may need them
  // too.
  bool OnMessage(Context& context, const proto::Message& message);

  // True if a page is in flight, or will be requested after a pause.
  bool is_reading() const { return state_ != State::kIdle; }
  // Result of the last reading. kUnavailable: storage cannot be reached. kTimedOut: storage did not answer. Otherwise
  // an error of storage or of Take. No error: all records stored before the last call of Read were read.
  const Result<void>& result() const { return result_; }
  // True if `stored` includes a type that this reader reads.
  bool Reads(const proto::RecordsStored& stored) const;

 private:
  enum class State {
    kIdle,
    kAwaitingPage,
    kPausing,  // Waits for the timer before the next request.
  };

  bool OnReadReply(Context& context, const proto::Message& message);
  bool OnTimer(Context& context, const proto::Timer& timer);
  void OnRecordsStored(Context& context, const proto::RecordsStored& stored);
  void OnDown(Context& context, const proto::Down& down);

  void Ask(Context& context);
  void AskAfter(Context& context, Duration delay);
  Result<void> TakePage(Context& context, const proto::ReadReply& page);
  void Finish(Context& context, Result<void> result);

  const Options options_;
  const Take take_;
  State state_ = State::kIdle;
  bool is_following_ = false;
  bool is_more_wanted_ = false;    // True if records may be stored that the page in flight does not contain.
  std::uint64_t last_row_id_ = 0;  // The cursor: row id of the last record read.
  std::uint64_t question_id_ = 0;  // Id of the last request, or of the pause before the next one; 0: none yet.
  TimerId timer_ = 0;
  Result<void> result_;
  RateLimitedLog trouble_log_;
};

}  // namespace moondb
