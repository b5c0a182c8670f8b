// DerivedReader: reads stored records for an actor that derives something from them, such as poses or the merged map.
//
// Passes on only records that count (RecordAuthority). Reads all records again if pruned records must be forgotten, or
// if a role assignment has made an earlier record valid. Reports to storage how many records do not count.
//
//   void OnMessage(Context& context, const proto::Message& message) override {
//     if (reader_.OnMessage(context, message)) return OnRead(context);  // All are read once is_reading() is false.
//     if (message.has_records_stored()) reader_.OnRecordsStored(message.records_stored());
//   }
//
// Call the reader only in the handlers of one actor. Not thread-safe.
#pragma once

#include <functional>
#include <map>

#include "model/record_authority.h"
#include "model/record_key.h"
#include "proto/record.pb.h"
#include "runtime/record_reader.h"

namespace moondb {

class DerivedReader {
 public:
  // Forgets all records that were taken. All records are then read again.
  using Forget = std::function<void()>;
  using Take = std::function<void(const RecordKey& key, const proto::Record& record)>;

  // `roles`: RoleChainOptions of the team file. Requires: the options' data types include ROLE_ASSIGNMENT.
  DerivedReader(RoleChain::Options roles, RecordReader::Options options, Forget forget, Take take);

  // Reads the records stored since the last reading, or all records if some must be forgotten. If storage cannot be
  // reached, the reading ends before this call returns.
  void Read(Context& context);
  void Stop(Context& context) { reader_.Stop(context); }
  // Returns true if the message was for this reader only; the actor must then ignore the message, and continue if
  // is_reading() is false.
  bool OnMessage(Context& context, const proto::Message& message);
  void OnRecordsStored(const proto::RecordsStored& stored) { is_outdated_ = is_outdated_ || stored.is_pruned(); }
  // The next Read reads all records again.
  void ForgetAll() { is_outdated_ = true; }

  bool is_reading() const { return reader_.is_reading(); }
  // Result of the last reading that ended (RecordReader::result).
  const Result<void>& result() const { return reader_.result(); }
  bool Reads(const proto::RecordsStored& stored) const { return reader_.Reads(stored); }

  // Reports to storage the records that do not count, and those for which the actor had no room, by origin. Sends
  // nothing if neither has changed.
  void Report(Context& context, std::map<AgentId, std::uint64_t> without_room);

 private:
  Result<void> TakeStored(const proto::StoredRecord& stored);
  void ReadAgainIfOutdated(Context& context);

  const Forget forget_;
  const Take take_;
  RecordAuthority authority_;
  RecordReader reader_;
  bool is_outdated_ = false;  // True if pruned records were taken, or records that have become valid are missing.
};

}  // namespace moondb
