// MemoryStore: a small substitute for StorageActor. Keeps records in memory, all of them under the policy `all`.
#pragma once

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "model/have_page.h"
#include "model/have_set.h"
#include "model/record_hash.h"
#include "model/record_key.h"
#include "proto/storage.pb.h"
#include "runtime/actor.h"

namespace moondb {

class MemoryStore {
 public:
  // Inserts a record with the next seq of the stream (origin, epoch, type). Returns its key.
  RecordKey Insert(AgentId origin, DataType type, std::string content, std::uint64_t epoch = 7) {
    RecordKey key{{origin, epoch, type}, have_.Get({origin, epoch, type}).Covered().Max() + 1};
    have_[key.stream].held.Add(key.seq);
    records_[key] = std::move(content);
    return key;
  }

  void Drop(const RecordKey& key) {
    records_.erase(key);
    have_[key.stream].held.Remove(key.seq);
    have_[key.stream].dropped.Add(key.seq);
  }

  // Makes the store reject records of this type from peers.
  void Reject(DataType type) { rejected_type_ = type; }

  proto::HaveReply Have(const proto::HaveRequest& request = {}) const {
    const RecordKey from = FromProto(request.from());
    HavePageWriter writer(from, request.bytes_max());
    for (auto it = have_.streams().lower_bound(from.stream); it != have_.streams().end(); ++it) {
      const auto& origins = request.origin_agents();
      const bool is_asked =
          origins.empty() || std::find(origins.begin(), origins.end(), it->first.origin) != origins.end();
      if (is_asked && !writer.Add(it->first, it->second)) break;
    }
    proto::HaveReply reply;
    *reply.mutable_have() = std::move(writer.page());
    if (writer.next()) *reply.mutable_next() = ToProto(*writer.next());
    return reply;
  }

  proto::MissingReply Missing(const proto::MissingRequest& request) {
    Mark& mark = marks_[{request.destination(), request.kind()}];
    if (mark.number != request.mark()) mark = {request.mark(), have_};
    const HaveSet theirs = *FromProto(request.destination_have());
    proto::MissingReply reply;
    std::size_t bytes = 0;
    bool is_full = false;
    for (const auto& [key, content] : records_) {
      const StreamHave& covered = theirs.Get(key.stream);
      if (!IsWanted(request.filter(), key.stream) || covered.held.Contains(key.seq) ||
          covered.dropped.Contains(key.seq)) {
        continue;
      }
      if (request.mark() != 0 && !mark.have.Get(key.stream).held.Contains(key.seq)) continue;
      is_full = is_full || (reply.records_size() > 0 && (bytes + content.size() > request.content_bytes_max() ||
                                                         reply.records_size() >= int(request.records_max())));
      if (is_full) {
        reply.set_remaining(reply.remaining() + 1);
        const bool is_known = !reply.backlog().empty() && reply.backlog().rbegin()->data_type() == key.stream.type;
        proto::TypeBacklog& backlog = is_known ? *reply.mutable_backlog()->rbegin() : *reply.add_backlog();
        backlog.set_data_type(key.stream.type);
        backlog.set_records(backlog.records() + 1);
        continue;
      }
      bytes += content.size();
      proto::StoredRecord& record = *reply.add_records();
      *record.mutable_key() = ToProto(key);
      record.set_content(content);
      record.set_hash(HashRecord(key, content));
    }
    if (reply.remaining() == 0) AddDropped(request.filter(), theirs, reply);
    return reply;
  }

  proto::StoreReply Store(const proto::StoreRequest& request) {
    proto::StoreReply reply;
    HaveSet touched;
    for (const proto::StoredRecord& record : request.records()) {
      const RecordKey key = FromProto(record.key());
      if (key.stream.type == rejected_type_ || HashRecord(key, record.content()) != record.hash()) {
        reply.set_rejected_count(reply.rejected_count() + 1);
        continue;
      }
      if (!have_.Get(key.stream).Covered().Contains(key.seq)) {
        records_[key] = record.content();
        have_[key.stream].held.Add(key.seq);
        reply.set_stored_count(reply.stored_count() + 1);
      }
      touched[key.stream] = have_.Get(key.stream);
    }
    for (const proto::StreamHave& stream : request.dropped()) {
      const StreamKey key{stream.origin_agent(), stream.epoch(), stream.data_type()};
      for (const proto::Interval& interval : stream.dropped()) {
        for (std::uint64_t seq = interval.first(); seq <= interval.last(); ++seq) Drop({key, seq});
      }
      touched[key] = have_.Get(key);
    }
    *reply.mutable_covered() = ToProto(touched);
    return reply;
  }

  const std::map<RecordKey, std::string>& records() const { return records_; }
  const HaveSet& have() const { return have_; }

 private:
  // Number of a mark (MissingRequest.mark), and the have-set when the mark was first requested.
  struct Mark {
    std::uint64_t number = 0;
    HaveSet have;
  };

  static bool IsWanted(const proto::RecordFilter& filter, const StreamKey& stream) {
    const auto holds = [](const auto& list, std::uint32_t value) {
      return list.empty() || std::find(list.begin(), list.end(), value) != list.end();
    };
    return holds(filter.origin_agents(), stream.origin) && holds(filter.data_types(), stream.type);
  }

  void AddDropped(const proto::RecordFilter& filter, const HaveSet& theirs, proto::MissingReply& reply) const {
    HaveSet lacking;
    for (const auto& [key, stream] : have_.streams()) {
      const IntervalSet dropped = stream.dropped.Minus(theirs.Get(key).dropped);
      if (IsWanted(filter, key) && !dropped.is_empty()) lacking[key].dropped = dropped;
    }
    *reply.mutable_dropped() = ToProto(lacking).streams();
  }

  std::map<RecordKey, std::string> records_;
  HaveSet have_;
  std::map<std::pair<AgentId, proto::SharingKind>, Mark> marks_;
  DataType rejected_type_ = 0;
};

// Answers have, missing and store requests like StorageActor. The store outlives the actor, as a disk does.
class MemoryStorageActor final : public Actor {
 public:
  explicit MemoryStorageActor(std::shared_ptr<MemoryStore> store) : store_(std::move(store)) {}

  void OnMessage(Context& context, const proto::Message& message) override {
    proto::Message reply;
    if (message.has_have_request()) {
      *reply.mutable_have_reply() = store_->Have(message.have_request());
    } else if (message.has_missing_request()) {
      *reply.mutable_missing_reply() = store_->Missing(message.missing_request());
    } else if (message.has_store_request()) {
      *reply.mutable_store_reply() = store_->Store(message.store_request());
    } else {
      return;
    }
    (void)context.Reply(std::move(reply));
  }

 private:
  std::shared_ptr<MemoryStore> store_;
};

}  // namespace moondb
