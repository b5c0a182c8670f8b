#include "apps/moondb_sim/state_checker.h"

#include <xxhash.h>

#include <algorithm>

#include "model/record_check.h"

namespace moondb::simulation {

std::uint64_t ContentHash(const std::string& content) { return XXH64(content.data(), content.size(), 0); }

std::set<std::uint64_t> StatementHashes(const proto::Record& given) {
  std::set<std::uint64_t> hashes;
  proto::Record record = given;
  for (const bool is_clock_suspect : {false, true}) {
    for (const bool is_state : {false, true}) {
      record.set_is_clock_suspect(is_clock_suspect);
      record.set_is_state(is_state);
      hashes.insert(ContentHash(record.SerializeAsString()));
    }
  }
  return hashes;
}

void StateChecker::OnGiven(AgentId origin, const proto::Record& record) {
  const DataType type = TypeOf(record);
  if (!IsState(type)) return;
  const Given given{{origin, type, LatestKey(record)}, ++given_};
  for (const std::uint64_t hash : StatementHashes(record)) given_by_content_[hash] = given;
}

void StateChecker::OnContent(const RecordKey& key, std::uint64_t content_hash) {
  if (IsState(key.stream.type)) content_of_[key] = content_hash;
}

const StateChecker::Given* StateChecker::Find(const RecordKey& key) const {
  const auto content = content_of_.find(key);
  if (content == content_of_.end()) return nullptr;
  const auto given = given_by_content_.find(content->second);
  return given == given_by_content_.end() ? nullptr : &given->second;
}

void StateChecker::OnHeld(AgentId agent, const RecordKey& key) {
  const Given* given = Find(key);
  if (given == nullptr) return;
  const AgentId origin = std::get<0>(given->series);
  if (agent != origin) shared_[origin].insert(given->number);
  std::uint64_t& last = last_on_[agent][given->series];
  last = std::max(last, given->number);
}

void StateChecker::OnDiskReplaced(AgentId agent) {
  ForgetDisk(agent);
  replaced_[agent] = {given_, shared_[agent]};
}

bool StateChecker::MayReplace(AgentId origin, std::uint64_t held, std::uint64_t last) const {
  const auto replaced = replaced_.find(origin);
  return replaced != replaced_.end() && held != 0 && last <= replaced->second.given &&
         !replaced->second.shared.contains(held);
}

std::optional<std::string> StateChecker::WhyOld(AgentId agent, AgentId origin, const Records& records) const {
  std::map<Series, std::uint64_t> holds;
  for (const auto& [key, content] : records) {
    if (!IsState(key.stream.type)) continue;
    const auto given = given_by_content_.find(ContentHash(content));
    if (given != given_by_content_.end()) holds[given->second.series] = given->second.number;
  }
  for (const auto& [disk, last] : last_on_) {
    for (const auto& [series, number] : last) {
      const auto& [its_origin, type, latest_key] = series;
      if ((origin != 0 && its_origin != origin) || holds[series] >= number) continue;
      if (MayReplace(its_origin, holds[series], number)) continue;
      return "agent " + std::to_string(agent) + " holds the state " + std::to_string(holds[series]) + " of type " +
             std::to_string(type) + " '" + latest_key + "' of agent " + std::to_string(its_origin) +
             ", and the disk of agent " + std::to_string(disk) + " had the later one " + std::to_string(number);
    }
  }
  return std::nullopt;
}

}  // namespace moondb::simulation
