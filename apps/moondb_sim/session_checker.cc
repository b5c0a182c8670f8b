#include "apps/moondb_sim/session_checker.h"

#include <algorithm>

namespace moondb::simulation {

// Id of the sender in `fragments_` and `runs_`. There is only one sender, so any id serves.
constexpr AgentId kSender = 1;

void SessionChecker::OnHello(const proto::Hello& hello) {
  if (hello.has_have_from()) return;  // This Hello only requests a further page of the have-set.
  session_id_ = hello.session_id();
  have_ = HaveSet();
  in_flight_.clear();
  runs_.TakePlace(kSender, {});
}

std::vector<std::pair<std::string, std::string>> SessionChecker::OnBatch(const proto::Message& message) {
  std::vector<std::pair<std::string, std::string>> broken;
  const proto::Batch& batch = message.batch();
  const Result<Handed> handed = Open(message);
  if (!handed) {
    broken.emplace_back("nothing_refused", "a batch is damaged: " + ToString(handed.error()));
    return broken;
  }
  const std::string name = "batch " + std::to_string(batch.batch_number());
  if (message.remaining() == 0 && !in_flight_.empty()) {
    broken.emplace_back("end_is_last", name + " reports the end while batch " +
                                           std::to_string(in_flight_.begin()->first) + " is not acknowledged");
  }
  in_flight_[batch.batch_number()] = *handed;
  std::size_t bytes = 0;
  for (const auto& [number, other] : in_flight_) bytes += other.bytes;
  if (bytes > limits_.unacked_bytes_max) {
    broken.emplace_back("unacked_bounded", std::to_string(bytes) + " bytes are in flight with " + name);
  }
  if (batch.coded().size() > limits_.batch_bytes_max) {
    broken.emplace_back("unacked_bounded", name + " has " + std::to_string(batch.coded().size()) + " bytes");
  }
  return broken;
}

void SessionChecker::OnHave(const proto::Have& have) {
  const Result<HaveSet> heard = FromProto(have.have());
  if (!heard || have.session_id() != session_id_) return;
  have_.Merge(*heard);
  std::erase_if(in_flight_, [&](const auto& entry) {
    // If the acknowledged batch number exceeds the number of this batch by two or more, the sender treats this batch as
    // lost and retransmits its records.
    const bool is_given_up = !have.needs_new_run() && entry.first + 2 <= have.batch_number();
    return entry.first == have.batch_number() || is_given_up || IsCovered(entry.second);
  });
}

Result<SessionChecker::Handed> SessionChecker::Open(const proto::Message& message) {
  const proto::Batch& batch = message.batch();
  Handed handed;
  handed.bytes = batch.ByteSizeLong();
  if (batch.has_fragment()) {
    const bool is_last = batch.fragment().first_byte() + batch.coded().size() == batch.fragment().whole_bytes();
    const Result<RecordKey> key = ParseRecordKey(message.record_id());
    if (!key) return tl::unexpected(key.error());
    if (is_last) handed.keys.push_back(*key);
    const auto whole = fragments_.Take(kSender, batch);
    if (!whole) unheard_run_ = batch.run();
    if (!whole || !*whole) return handed;
    const Result<proto::RecordBatch> record = runs_.Decode(kSender, batch, **whole, {});
    if (!record && batch.run() != unheard_run_) return tl::unexpected(record.error());
    return handed;
  }
  const Result<proto::RecordBatch> records = runs_.Decode(kSender, batch, batch.coded(), {});
  if (!records && records.error().code == ErrorCode::kNotFound && batch.run() == unheard_run_) return handed;
  if (!records) return tl::unexpected(records.error());
  for (const proto::StoredRecord& record : records->records()) handed.keys.push_back(FromProto(record.key()));
  return handed;
}

bool SessionChecker::IsCovered(const Handed& batch) const {
  return !batch.keys.empty() && std::all_of(batch.keys.begin(), batch.keys.end(), [this](const RecordKey& key) {
    const StreamHave& stream = have_.Get(key.stream);
    return stream.held.Contains(key.seq) || stream.dropped.Contains(key.seq);
  });
}

}  // namespace moondb::simulation
