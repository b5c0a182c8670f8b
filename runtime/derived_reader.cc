#include "runtime/derived_reader.h"

#include <optional>
#include <utility>

namespace moondb {

DerivedReader::DerivedReader(RoleChain::Options roles, RecordReader::Options options, Forget forget, Take take)
    : forget_(std::move(forget)),
      take_(std::move(take)),
      authority_(std::move(roles)),
      reader_(std::move(options), [this](Context&, const proto::StoredRecord& stored) { return TakeStored(stored); }) {}

void DerivedReader::Read(Context& context) {
  if (std::exchange(is_outdated_, false)) {
    forget_();
    authority_.Restart();
    reader_.ReadAgain(context);
  } else {
    reader_.Read(context);
  }
  ReadAgainIfOutdated(context);
}

bool DerivedReader::OnMessage(Context& context, const proto::Message& message) {
  const bool was_reading = is_reading();
  const bool is_taken = reader_.OnMessage(context, message);
  if (was_reading) ReadAgainIfOutdated(context);
  return is_taken;
}

void DerivedReader::ReadAgainIfOutdated(Context& context) {
  if (is_reading() || !result() || !authority_.TakeOutdated()) return;
  is_outdated_ = true;
  Read(context);
}

Result<void> DerivedReader::TakeStored(const proto::StoredRecord& stored) {
  proto::Record record;
  const RecordKey key = FromProto(stored.key());
  // The record validator has checked every stored record. A record of a later version that this version cannot parse is
  // skipped.
  if (record.ParseFromString(stored.content()) && authority_.Counts(key, record)) take_(key, record);
  return {};
}

void DerivedReader::Report(Context& context, std::map<AgentId, std::uint64_t> without_room) {
  if (std::optional<proto::Message> report = authority_.TakeReport(std::move(without_room))) {
    // The report is only informative. Ignore a failed send.
    (void)context.Send({context.self().agent, actor_name::kStorage}, *std::move(report));
  }
}

}  // namespace moondb
