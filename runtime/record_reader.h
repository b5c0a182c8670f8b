// RecordReader: reads the records that this agent's storage holds, page by page, for the actor that owns the reader.
//
//   class Counter final : public Actor {
//    public:
//     void OnStart(Context& context) override { reader_.Follow(context); }
//     void OnMessage(Context& context, const proto::Message& message) override {
//       if (reader_.OnMessage(context, message)) return;
//       // What else this actor hears.
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
// Which records: those of `data_types`, this agent's own and those that sharing brought, in the order in which they
// were stored here, each once. One that was superseded or pruned before its page was read does not come. The cursor is
// the row of the last record. It lies in memory, as an actor's state comes from storage: an actor that is made anew has
// a new reader, which begins with the first record (decision 0002).
//
// Follow reads all that is stored and then whatever comes, as long as the actor lives. Read reads what is stored by
// now, for an actor that looks when it is asked; the reading ends with result().
//
// What comes between:
//   - Something is stored while a page is on its way: the reader looks again behind that page.
//   - Storage fails and is made anew: it is asked for the page again at once. A reader that follows also looks when it
//     was not reading, since what storage committed last may not have been published.
//   - A page does not come (it was lost at a full mailbox, or storage is silent), storage cannot be asked or answers
//     with an error: a reader that follows asks again after retry_delay, as often as it takes; else the reading ends.
//   - Answers to a question that was given up, and those that are not storage's, are not taken.
// One question is under way at a time. A question that timed out may still wait at storage: one each answer_timeout, of
// which there are few before the runtime's watchdog ends a process whose storage gets no turn.
//
// A plain class without a thread, for the handlers of one actor.
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
    std::vector<DataType> data_types;            // Empty: all.
    std::uint32_t page_records_max = 512;        // Storage gives at most 10,000.
    std::uint32_t page_bytes_max = 1024 * 1024;  // Of contents, at most 32 MiB; a larger record comes alone.
    Duration answer_timeout = std::chrono::seconds(30);
    Duration retry_delay = std::chrono::seconds(5);  // Of a reader that follows.
  };

  // Called for each record, within OnMessage; must not call the reader. With an error the reading ends as with one of
  // storage's, and the next one begins with this record.
  using Take = std::function<Result<void>(Context&, const proto::StoredRecord&)>;

  // Timers of this kind are a reader's; an actor may have several readers.
  static constexpr std::uint32_t kTimerKind = 0x7265'6164;

  RecordReader(Options options, Take take);

  // To be called once, in OnStart. Watches Topic::kStored.
  void Follow(Context& context);
  // Reads what is stored by now; extends a reading under way to that. Where storage cannot be asked, the reading of a
  // reader that does not follow has ended when this returns.
  void Read(Context& context);
  // As Read, from the first record on, whatever was read before. Ends a reading under way without a result.
  void ReadAgain(Context& context);
  // Ends a reading under way without a result; the cursor stays. A reader that follows goes on with the next record.
  void Stop(Context& context);

  // To be called with each message that the actor handles. True: it was for this reader alone, and the actor has
  // nothing to do with it. RecordsStored and Down are seen, and left to the actor and its other readers.
  bool OnMessage(Context& context, const proto::Message& message);

  // A page is on its way, or will be asked for again.
  bool is_reading() const { return state_ != State::kIdle; }
  // How the last reading ended: kUnavailable: storage cannot be asked. kTimedOut: it did not answer. Else its own
  // error, or Take's. None: all that was stored as Read was called last was read.
  const Result<void>& result() const { return result_; }
  // Whether any of these is to be read here.
  bool Reads(const proto::RecordsStored& stored) const;

 private:
  enum class State {
    kIdle,
    kAwaitingPage,
    kPausing,  // Until the timer, then storage is asked.
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
  bool is_more_wanted_ = false;    // Something may be stored that the page on its way does not hold.
  std::uint64_t last_row_id_ = 0;  // The cursor.
  std::uint64_t question_id_ = 0;  // The last question's, or the pause's before the next; 0: none yet.
  TimerId timer_ = 0;
  Result<void> result_;
  RateLimitedLog trouble_log_;
};

}  // namespace moondb
