#include "actors/sharing/run_decoders.h"

#include <algorithm>
#include <utility>

namespace moondb {

bool RunDecoders::TakePlace(AgentId sender, Time now) {
  Place* place = Find(sender);
  if (place == nullptr && places_.size() < places_max_) {
    place = &places_.emplace_back();
  } else if (place == nullptr && !places_.empty()) {
    const auto is_longer_silent = [](const Place& a, const Place& b) { return a.last_heard < b.last_heard; };
    place = &*std::min_element(places_.begin(), places_.end(), is_longer_silent);
    if (now - place->last_heard <= idle_after_) return false;
    *place = Place();
  }
  if (place == nullptr) return false;
  place->sender = sender;
  place->last_heard = now;
  return true;
}

Result<proto::RecordBatch> RunDecoders::Decode(AgentId sender, const proto::Batch& batch, std::string_view coded,
                                               Time now) {
  Place* place = Find(sender);
  if (place == nullptr || batch.run() == 0) return DecodeBatch(batch.codec(), coded, batch.record_count());
  place->last_heard = now;
  if (place->run == batch.run()) return DecodeBatch(batch.codec(), coded, batch.record_count(), place->decoder);
  BatchDecoder begun;
  Result<proto::RecordBatch> records = DecodeBatch(batch.codec(), coded, batch.record_count(), begun);
  if (!records) return records;
  place->run = batch.run();
  place->decoder = std::move(begun);
  return records;
}

RunDecoders::Place* RunDecoders::Find(AgentId sender) {
  const auto found =
      std::find_if(places_.begin(), places_.end(), [sender](const Place& p) { return p.sender == sender; });
  return found == places_.end() ? nullptr : &*found;
}

}  // namespace moondb
