#include "actors/sharing/run_decoders.h"

#include <algorithm>
#include <utility>

namespace moondb {

Result<proto::RecordBatch> RunDecoders::Decode(AgentId sender, const proto::Batch& batch, std::string_view coded) {
  if (batch.run() == 0) return DecodeBatch(batch.codec(), coded, batch.record_count());
  const auto of_sender = std::find_if(runs_.begin(), runs_.end(), [&](const Run& run) { return run.sender == sender; });
  if (of_sender != runs_.end() && of_sender->number == batch.run()) {
    runs_.splice(runs_.end(), runs_, of_sender);
    return DecodeBatch(batch.codec(), coded, batch.record_count(), of_sender->decoder);
  }
  Run begun{sender, batch.run(), {}};
  Result<proto::RecordBatch> records = DecodeBatch(batch.codec(), coded, batch.record_count(), begun.decoder);
  if (!records) return records;
  if (of_sender != runs_.end()) runs_.erase(of_sender);
  runs_.push_back(std::move(begun));
  if (runs_.size() > runs_max_) runs_.pop_front();
  return records;
}

}  // namespace moondb
