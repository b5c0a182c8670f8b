// RecordWriter: inserts records as this agent's own at its storage, chunk by chunk, for the actor that owns the writer.
//
//   void OnMessage(Context& context, const proto::Message& message) override {
//     if (writer_.OnMessage(context, message)) {
//       if (!writer_.is_writing()) OnWritten(context, writer_.result());
//       return;
//     }
//   }
//
// At most one chunk is in flight. The first error ends the writing; chunks that storage has accepted stay. Only the
// answers of this agent's storage count.
//
// Call the writer only in the handlers of one actor. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <vector>

#include "model/error.h"
#include "proto/record.pb.h"
#include "runtime/actor.h"

namespace moondb {

class RecordWriter {
 public:
  struct Options {
    std::size_t chunk_records_max = 128;
    Duration answer_timeout = std::chrono::seconds(30);
  };

  // Kind of the timers of all writers. A timer's value is the id of a request.
  static constexpr std::uint32_t kTimerKind = 0x7772'6974;

  explicit RecordWriter(Options options) : options_(options) {}

  // Starts to insert the records. If there are none, or storage cannot be reached, the writing ends before this call
  // returns. Requires: is_writing() is false.
  void Write(Context& context, std::vector<proto::Record> records);
  // Ends the writing that is in progress, without changing result(). A chunk in flight may still be stored.
  void Stop(Context& context);
  // Returns true if the message was for this writer only; the actor must then ignore the message, and continue if
  // is_writing() is false.
  bool OnMessage(Context& context, const proto::Message& message);

  bool is_writing() const { return is_writing_; }
  // Result of the last writing that ended. kUnavailable: storage cannot be reached. kTimedOut: storage did not answer.
  // Otherwise an error of storage.
  const Result<void>& result() const { return result_; }
  // Number of records that storage has accepted in the last writing.
  std::size_t stored_count() const { return stored_count_; }

 private:
  void WriteChunk(Context& context);
  void Finish(Context& context, Result<void> result);

  const Options options_;
  std::vector<proto::Record> records_;
  std::size_t sent_count_ = 0;
  std::size_t stored_count_ = 0;
  std::uint64_t request_id_ = 0;  // Id of the last request; 0: none yet.
  TimerId timeout_ = 0;
  bool is_writing_ = false;
  Result<void> result_;
};

}  // namespace moondb
