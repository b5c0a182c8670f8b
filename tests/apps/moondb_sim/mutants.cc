#include "tests/apps/moondb_sim/mutants.h"

#include <algorithm>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <utility>

#include "actors/storage/own_epochs.h"
#include "apps/moondb_sim/byzantine_checker.h"
#include "apps/moondb_sim/forged_message.h"
#include "apps/moondb_sim/simulated_config.h"
#include "apps/moondb_sim/state_checker.h"
#include "model/data_types.h"
#include "model/have_set.h"
#include "model/record_authority.h"
#include "model/record_check.h"
#include "model/record_hash.h"
#include "model/record_key.h"
#include "model/term.h"
#include "proto/trace.pb.h"
#include "proto/types.pb.h"
#include "runtime/system_status.h"
#include "runtime/team/record_signature.h"
#include "runtime/team/role_signature.h"

namespace moondb::simulation {
namespace {

// A context that forwards every call to the real one. Mutants override the calls that they break.
class OtherContext : public Context {
 public:
  explicit OtherContext(Context& context) : context_(context) {}

  const Address& self() const override { return context_.self(); }
  const Address& sender() const override { return context_.sender(); }
  MonotonicTime now() const override { return context_.now(); }
  std::int64_t utc_now_ns() const override { return context_.utc_now_ns(); }
  std::mt19937_64& rng() override { return context_.rng(); }
  SendResult Send(const Address& to, OwnedMessage message) override { return context_.Send(to, std::move(message)); }
  SendResult Reply(OwnedMessage message) override { return context_.Reply(std::move(message)); }
  TimerId After(Duration delay, proto::Message message) override { return context_.After(delay, std::move(message)); }
  void Cancel(TimerId timer) override { context_.Cancel(timer); }
  void Fail(Error error) override { context_.Fail(std::move(error)); }
  void WatchPeers() override { context_.WatchPeers(); }
  void Watch(Topic topic) override { context_.Watch(topic); }
  void Publish(OwnedMessage message) override { context_.Publish(std::move(message)); }
  void Monitor(const Address& target) override { context_.Monitor(target); }
  void Demonitor(const Address& target) override { context_.Demonitor(target); }
  bool stop_requested() const override { return context_.stop_requested(); }
  void SetRoles(const proto::RoleAssignment& roles) override { context_.SetRoles(roles); }
  void RequestStop() override { context_.RequestStop(); }
  SystemStatus GetSystemStatus() const override { return context_.GetSystemStatus(); }
  proto::TraceReply GetTrace(const proto::TraceRequest& request) const override { return context_.GetTrace(request); }

 private:
  Context& context_;
};

class OtherActor : public Actor {
 public:
  explicit OtherActor(std::unique_ptr<Actor> actor) : actor_(std::move(actor)) {}
  void OnStart(Context& context) override { actor_->OnStart(context); }
  void OnMessage(Context& context, const proto::Message& message) override { actor_->OnMessage(context, message); }

 protected:
  Actor& actor() { return *actor_; }

 private:
  const std::unique_ptr<Actor> actor_;
};

// `hears` is called with each message that an actor receives, and `says` with each message that the actor sends. Each
// may change the message, or return false to drop the message.
struct Hooks {
  std::function<bool(Context& context, proto::Message& message)> hears;
  std::function<bool(Context& context, const Address& to, proto::Message& message)> says;
};

class HookedActor final : public OtherActor {
 public:
  HookedActor(std::unique_ptr<Actor> actor, Hooks hooks) : OtherActor(std::move(actor)), hooks_(std::move(hooks)) {}
  void OnStart(Context& context) override {
    Hooked hooked(context, hooks_);
    actor().OnStart(hooked);
  }
  void OnMessage(Context& context, const proto::Message& message) override {
    proto::Message changed = message;
    if (hooks_.hears && !hooks_.hears(context, changed)) return;
    Hooked hooked(context, hooks_);
    actor().OnMessage(hooked, changed);
  }

 private:
  class Hooked final : public OtherContext {
   public:
    Hooked(Context& context, const Hooks& hooks) : OtherContext(context), hooks_(hooks) {}
    SendResult Send(const Address& to, OwnedMessage message) override {
      if (hooks_.says && !hooks_.says(*this, to, *message)) return SendResult::kAccepted;
      return OtherContext::Send(to, std::move(message));
    }
    SendResult Reply(OwnedMessage message) override {
      if (hooks_.says && !hooks_.says(*this, sender(), *message)) return SendResult::kAccepted;
      return OtherContext::Reply(std::move(message));
    }
    void Publish(OwnedMessage message) override {
      if (!hooks_.says || hooks_.says(*this, self(), *message)) OtherContext::Publish(std::move(message));
    }

   private:
    const Hooks& hooks_;
  };

  const Hooks hooks_;
};

// Draws the same random numbers at each start. After the loss of its disk, the agent therefore uses the same epoch
// again.
class WithoutEpochs final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnStart(Context& context) override {
    class SameNumbers final : public OtherContext {
     public:
      using OtherContext::OtherContext;
      std::mt19937_64& rng() override { return rng_; }

     private:
      std::mt19937_64 rng_{1};
    };
    SameNumbers same(context);
    actor().OnStart(same);
  }
};

// Treats all records that a destination ever acknowledged as still covered, even after the destination has lost its
// disk.
class CachedAcknowledgments final : public OtherActor {
 public:
  using Cache = std::map<std::pair<Address, AgentId>, HaveSet>;
  CachedAcknowledgments(std::unique_ptr<Actor> actor, std::shared_ptr<Cache> cache)
      : OtherActor(std::move(actor)), cache_(std::move(cache)) {}
  void OnMessage(Context& context, const proto::Message& message) override {
    if (!message.has_have()) return OtherActor::OnMessage(context, message);
    HaveSet& known = (*cache_)[{context.self(), context.sender().agent}];
    known.Merge(*FromProto(message.have().have()));
    proto::Message changed = message;
    *changed.mutable_have()->mutable_have() = ToProto(known);
    OtherActor::OnMessage(context, changed);
  }

 private:
  const std::shared_ptr<Cache> cache_;
};

// Acknowledges a peer's records half a second before it stores them.
class AcknowledgesBeforeTheCommit final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    if (message.has_timer()) {
      if (waiting_.empty()) return;
      class Silent final : public OtherContext {
       public:
        using OtherContext::OtherContext;
        SendResult Reply(OwnedMessage) override { return SendResult::kAccepted; }
      };
      Silent silent(context);
      actor().OnMessage(silent, waiting_.front());
      waiting_.erase(waiting_.begin());
      return;
    }
    if (!message.has_store_request()) return OtherActor::OnMessage(context, message);
    HaveSet covered;
    for (const proto::StoredRecord& record : message.store_request().records()) {
      const RecordKey key = FromProto(record.key());
      covered[key.stream].held.Add(key.seq);
    }
    waiting_.push_back(message);
    context.AfterTimer(std::chrono::milliseconds(500), 1);
    proto::Message reply;
    *reply.mutable_store_reply()->mutable_covered() = ToProto(covered);
    (void)context.Reply(std::move(reply));
  }

 private:
  std::vector<proto::Message> waiting_;
};

// Accepts the role assignment that arrived last, regardless of the assignment's term.
class WithoutTerms final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    const bool is_heard = message.has_role_announce() && context.sender().agent != context.self().agent;
    if (!is_heard || message.role_announce().is_reply()) return OtherActor::OnMessage(context, message);
    proto::Message changed = message;
    proto::Term& term = *changed.mutable_role_announce()->mutable_roles()->mutable_term();
    highest_ = std::max(highest_, term.number());
    if (term.number() < highest_) term.set_number(++highest_);
    OtherActor::OnMessage(context, changed);
  }

 private:
  std::uint64_t highest_ = 0;
};

// Makes a restarted leader reuse its last term. Until the role actor saves a term, the mutant lowers the number of the
// leader's last term by one in messages to the role actor. All terms of the role actor get the same issuer_epoch.
class WithoutANewTerm final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    class SameEpoch final : public OtherContext {
     public:
      SameEpoch(Context& context, bool& has_term) : OtherContext(context), has_term_(has_term) {}
      std::mt19937_64& rng() override { return rng_; }
      SendResult Send(const Address& to, OwnedMessage message) override {
        if (message->has_save_roles_request()) has_term_ = true;
        return OtherContext::Send(to, std::move(message));
      }

     private:
      std::mt19937_64 rng_{1};
      bool& has_term_;
    };
    proto::Message changed = message;
    if (!has_term_ && changed.has_load_roles_reply() && changed.load_roles_reply().history_size() > 0) {
      Lower(*changed.mutable_load_roles_reply()->mutable_history()->rbegin(), context.self().agent);
    }
    if (!has_term_ && changed.has_role_announce()) {
      Lower(*changed.mutable_role_announce()->mutable_roles(), context.self().agent);
    }
    SameEpoch same(context, has_term_);
    actor().OnMessage(same, changed);
  }

 private:
  static void Lower(proto::RoleAssignment& roles, AgentId self) {
    proto::Term& term = *roles.mutable_term();
    if (roles.leader() == self && term.issuer() == self && term.number() > 0) term.set_number(term.number() - 1);
  }

  bool has_term_ = false;
};

// Keeps each rover's power state with the newest timestamp, and drops its other power states.
class NewestByClock final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    if (!message.has_store_request()) return OtherActor::OnMessage(context, message);
    proto::Message changed = message;
    proto::StoreRequest& request = *changed.mutable_store_request();
    request.clear_records();
    HaveSet dropped;
    for (const proto::StoredRecord& stored : message.store_request().records()) {
      proto::Record record;
      const RecordKey key = FromProto(stored.key());
      if (key.stream.type != proto::POWER || !record.ParseFromString(stored.content())) {
        *request.add_records() = stored;
        continue;
      }
      std::int64_t& newest = newest_ns_[key.stream.origin];
      if (record.timestamp_ns() >= newest) {
        newest = record.timestamp_ns();
        *request.add_records() = stored;
      } else {
        dropped[key.stream].dropped.Add(key.seq);
      }
    }
    const proto::HaveSet reported = ToProto(dropped);
    request.mutable_dropped()->MergeFrom(reported.streams());
    OtherActor::OnMessage(context, changed);
  }

 private:
  std::map<AgentId, std::int64_t> newest_ns_;
};

// Treats records of the custom type kNote as states. If several of them in one store request have the same origin and
// `latest_key`, keeps only the last one.
bool TakeTheLastNotes(Context&, proto::Message& message) {
  if (!message.has_store_request()) return true;
  proto::StoreRequest& request = *message.mutable_store_request();
  std::map<std::pair<AgentId, std::string>, RecordKey> last;
  HaveSet dropped;
  for (const proto::StoredRecord& stored : request.records()) {
    proto::Record record;
    const RecordKey key = FromProto(stored.key());
    if (key.stream.type != kNote || !record.ParseFromString(stored.content())) continue;
    const auto [known, is_first] = last.emplace(std::pair(key.stream.origin, LatestKey(record)), key);
    if (is_first) continue;
    const auto [older, newer] = std::minmax(known->second, key);
    dropped[older.stream].dropped.Add(older.seq);
    known->second = newer;
  }
  const auto is_dropped = [&dropped](const proto::StoredRecord& stored) {
    const RecordKey key = FromProto(stored.key());
    return dropped.Get(key.stream).dropped.Contains(key.seq);
  };
  auto& records = *request.mutable_records();
  records.erase(std::remove_if(records.begin(), records.end(), is_dropped), records.end());
  request.mutable_dropped()->MergeFrom(ToProto(dropped).streams());
  return true;
}

// Drops optimized poses whose node has not arrived yet, but reports them as covered.
class UpdateNeedsItsRow final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    if (!message.has_store_request()) return OtherActor::OnMessage(context, message);
    proto::Message changed = message;
    proto::StoreRequest& request = *changed.mutable_store_request();
    request.clear_records();
    HaveSet refused;
    for (const proto::StoredRecord& stored : message.store_request().records()) {
      proto::Record record;
      const RecordKey key = FromProto(stored.key());
      (void)record.ParseFromString(stored.content());
      if (record.has_pose_graph_node()) nodes_.insert(record.pose_graph_node().node().SerializeAsString());
      if (record.has_optimized_pose() && !nodes_.contains(record.optimized_pose().node().SerializeAsString())) {
        refused[key.stream].held.Add(key.seq);
      } else {
        *request.add_records() = stored;
      }
    }
    class SaysMore final : public OtherContext {
     public:
      SaysMore(Context& context, HaveSet more) : OtherContext(context), more_(std::move(more)) {}
      SendResult Reply(OwnedMessage message) override {
        if (message->has_store_reply()) {
          HaveSet covered = *FromProto(message->store_reply().covered());
          covered.Merge(more_);
          *message->mutable_store_reply()->mutable_covered() = ToProto(covered);
        }
        return OtherContext::Reply(std::move(message));
      }

     private:
      const HaveSet more_;
    };
    SaysMore says_more(context, std::move(refused));
    actor().OnMessage(says_more, changed);
  }

 private:
  std::set<std::string> nodes_;
};

// Base of mutants that drop optimized poses. Dropped poses are missing in read replies, and have-sets report them as
// dropped.
class DropsPoses : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    for (const proto::StoredRecord& stored : message.store_request().records()) {
      proto::Record record;
      if (!record.ParseFromString(stored.content()) || !record.has_optimized_pose()) continue;
      OnStored(FromProto(stored.key()), record.optimized_pose());
    }
    class Dropping final : public OtherContext {
     public:
      Dropping(Context& context, DropsPoses& mutant, const proto::InsertRequest& inserts)
          : OtherContext(context), mutant_(mutant), inserts_(inserts) {}
      SendResult Reply(OwnedMessage message) override {
        for (int i = 0; i < message->insert_reply().keys_size(); ++i) {
          if (!inserts_.records(i).has_optimized_pose()) continue;
          mutant_.OnInserted(FromProto(message->insert_reply().keys(i)), inserts_.records(i).optimized_pose());
        }
        if (message->has_have_reply()) AddTo(*message->mutable_have_reply()->mutable_have());
        if (message->has_store_reply()) AddTo(*message->mutable_store_reply()->mutable_covered());
        if (message->has_read_reply()) TakeFrom(*message->mutable_read_reply());
        return OtherContext::Reply(std::move(message));
      }

     private:
      void TakeFrom(proto::ReadReply& reply) const {
        auto* records = reply.mutable_records();
        auto* row_ids = reply.mutable_row_ids();
        for (int i = records->size() - 1; i >= 0; --i) {
          const RecordKey key = FromProto(records->Get(i).key());
          if (!mutant_.dropped_.Get(key.stream).dropped.Contains(key.seq)) continue;
          records->DeleteSubrange(i, 1);
          // Keep the last row id, which is the position for the next read.
          if (i + 1 < row_ids->size()) row_ids->erase(row_ids->begin() + i);
        }
      }
      void AddTo(proto::HaveSet& reported) const {
        HaveSet have = *FromProto(reported);
        for (const auto& [stream, dropped] : mutant_.dropped_.streams()) {
          const IntervalSet covered = have.Get(stream).Covered();
          // Report a record as dropped only if storage covers the record.
          have[stream].dropped.Add(covered.Intersection(dropped.dropped));
          have[stream].held = have[stream].held.Minus(dropped.dropped);
        }
        reported = ToProto(have);
      }
      DropsPoses& mutant_;
      const proto::InsertRequest& inserts_;
    };
    Dropping dropping(context, *this, message.insert_request());
    actor().OnMessage(dropping, message);
  }

 protected:
  virtual void OnStored(const RecordKey& key, const proto::OptimizedPose& pose) = 0;
  virtual void OnInserted(const RecordKey&, const proto::OptimizedPose&) {}
  void Drop(const RecordKey& key) { dropped_[key.stream].dropped.Add(key.seq); }

 private:
  HaveSet dropped_;
};

// Keeps only the last optimized pose of each node to arrive, regardless of its author and term.
class LastPoseHeard final : public DropsPoses {
 public:
  using DropsPoses::DropsPoses;

 private:
  void OnStored(const RecordKey& key, const proto::OptimizedPose& pose) override {
    const auto [last, is_new] = last_.emplace(pose.node().SerializeAsString(), key);
    if (!is_new && last->second != key) Drop(last->second);
    last->second = key;
  }

  std::map<std::string, RecordKey> last_;  // Key of the last pose, by node.
};

// If one agent solved a node's pose several times, keeps the pose with the highest epoch, regardless of the term.
class PosesByEpoch final : public DropsPoses {
 public:
  using DropsPoses::DropsPoses;

 private:
  void OnStored(const RecordKey& key, const proto::OptimizedPose& pose) override {
    RecordKey& highest = highest_[{key.stream.origin, pose.node().SerializeAsString()}];
    if (highest == key) return;
    if (highest.seq != 0) Drop(std::min(highest, key));
    highest = std::max(highest, key);
  }
  void OnInserted(const RecordKey& key, const proto::OptimizedPose& pose) override { OnStored(key, pose); }

  std::map<std::pair<AgentId, std::string>, RecordKey> highest_;
};

// Hides states that storage reissues under a new key, so that they are not sent to the team.
class KeepsReissuedToItself final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    class Hiding final : public OtherContext {
     public:
      Hiding(Context& context, std::map<std::string, RecordKey>& first_keys, const proto::InsertRequest& inserts)
          : OtherContext(context), first_keys_(first_keys), inserts_(inserts) {}
      SendResult Reply(OwnedMessage message) override {
        for (int i = 0; i < message->insert_reply().keys_size(); ++i) {
          first_keys_.emplace(Name(inserts_.records(i)), FromProto(message->insert_reply().keys(i)));
        }
        if (message->has_missing_reply()) Hide(*message->mutable_missing_reply()->mutable_records());
        return OtherContext::Reply(std::move(message));
      }

     private:
      // Returns the record's content without the fields that the agent sets.
      static std::string Name(proto::Record record) {
        record.clear_is_clock_suspect();
        record.clear_is_state();
        return record.SerializeAsString();
      }
      void Hide(google::protobuf::RepeatedPtrField<proto::StoredRecord>& records) const {
        for (int i = records.size() - 1; i >= 0; --i) {
          proto::Record record;
          (void)record.ParseFromString(records.Get(i).content());
          const auto first = first_keys_.find(Name(record));
          const bool is_reissued =
              first != first_keys_.end() && first->second != FromProto(records.Get(i).key()) && IsState(TypeOf(record));
          if (is_reissued) records.DeleteSubrange(i, 1);
        }
      }

      std::map<std::string, RecordKey>& first_keys_;
      const proto::InsertRequest& inserts_;
    };
    Hiding hiding(context, first_keys_, message.insert_request());
    actor().OnMessage(hiding, message);
  }

 private:
  std::map<std::string, RecordKey> first_keys_;  // First key of each record content.
};

// Adds an invented later epoch, which is based on no other epoch, for each epoch that a peer reports. Storage therefore
// reissues states even if the author of a later state knew them.
class ReissuesWhateverWasKnown final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    if (!message.has_epoch_report()) return OtherActor::OnMessage(context, message);
    proto::Message changed = message;
    std::set<std::uint64_t> epochs;
    for (const std::uint64_t epoch : message.epoch_report().epochs()) {
      epochs.insert({epoch, EpochOf({PartsOf(epoch).counter, kEpochTagMax, 0, 0}, epoch)});
    }
    while (epochs.size() > 64) epochs.erase(epochs.begin());
    *changed.mutable_epoch_report()->mutable_epochs() = {epochs.begin(), epochs.end()};
    OtherActor::OnMessage(context, changed);
  }
};

// Reports an older state as dropped as soon as a newer one arrives, but stores the newer one 2 s later.
class DropsBeforeTheSuperseder final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    class DroppingFirst final : public OtherContext {
     public:
      DroppingFirst(Context& context, const DropsBeforeTheSuperseder& mutant)
          : OtherContext(context), mutant_(mutant) {}
      SendResult Reply(OwnedMessage message) override {
        // Drop the reply to a delayed message. It would go to this actor itself.
        if (sender() == self()) return SendResult::kAccepted;
        if (message->has_have_reply()) mutant_.Drop(*message->mutable_have_reply()->mutable_have());
        if (message->has_store_reply()) mutant_.Drop(*message->mutable_store_reply()->mutable_covered());
        return OtherContext::Reply(std::move(message));
      }

     private:
      const DropsBeforeTheSuperseder& mutant_;
    };
    DroppingFirst dropping(context, *this);
    if (message.has_timer()) {
      if (!waiting_.empty()) actor().OnMessage(dropping, waiting_.front());
      if (!waiting_.empty()) waiting_.erase(waiting_.begin());
      return;
    }
    if (message.has_store_request()) {
      proto::Message states = message;
      proto::Message others = message;
      states.mutable_store_request()->clear_records();
      others.mutable_store_request()->clear_records();
      for (const proto::StoredRecord& stored : message.store_request().records()) {
        const RecordKey key = FromProto(stored.key());
        const bool is_state = key.stream.type == proto::POWER;
        if (is_state) newest_[key.stream] = std::max(newest_[key.stream], key.seq);
        *(is_state ? states : others).mutable_store_request()->add_records() = stored;
      }
      waiting_.push_back(std::move(states));
      context.AfterTimer(std::chrono::seconds(2), 1);
      return actor().OnMessage(dropping, others);
    }
    actor().OnMessage(dropping, message);
  }

 private:
  void Drop(proto::HaveSet& reported) const {
    HaveSet have = *FromProto(reported);
    for (const auto& [stream, newest] : newest_) {
      const IntervalSet held = have.Get(stream).held;
      if (held.is_empty()) continue;
      IntervalSet kept;
      kept.Add({newest, UINT64_MAX - 1});
      have[stream].dropped.Add(held.Minus(kept));
      have[stream].held = held.Intersection(kept);
    }
    reported = ToProto(have);
  }

  std::vector<proto::Message> waiting_;
  std::map<StreamKey, std::uint64_t> newest_;
};

// Answers a failed insert of a node as if the node were stored under the next key.
class AcknowledgesFailedInserts final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    class Acknowledging final : public OtherContext {
     public:
      Acknowledging(Context& context, std::optional<proto::RecordKey>& last) : OtherContext(context), last_(last) {}
      SendResult Reply(OwnedMessage message) override {
        if (message->has_insert_reply()) Acknowledge(*message->mutable_insert_reply());
        return OtherContext::Reply(std::move(message));
      }

     private:
      void Acknowledge(proto::InsertReply& reply) {
        if (!IsError(reply.error())) {
          if (reply.keys_size() == 1 && reply.keys(0).seq() != 0) last_ = reply.keys(0);
        } else if (last_) {
          last_->set_seq(last_->seq() + 1);
          reply.clear_error();
          *reply.add_keys() = *last_;
        }
      }
      std::optional<proto::RecordKey>& last_;
    };
    const bool is_node =
        message.insert_request().records_size() == 1 && message.insert_request().records(0).has_pose_graph_node();
    if (!is_node) return OtherActor::OnMessage(context, message);
    Acknowledging acknowledging(context, last_);
    actor().OnMessage(acknowledging, message);
  }

 private:
  std::optional<proto::RecordKey> last_;  // Key of the last stored node.
};

// Delivers each timer twice.
class TimersMultiply final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    class Twice final : public OtherContext {
     public:
      using OtherContext::OtherContext;
      TimerId After(Duration delay, proto::Message message) override {
        (void)OtherContext::After(delay, message);
        return OtherContext::After(delay, std::move(message));
      }
    };
    Twice twice(context);
    actor().OnMessage(twice, message);
  }
};

// Sets each timer to a tenth of the required time.
class WaitsTooShort final : public OtherActor {
 public:
  using OtherActor::OtherActor;
  void OnMessage(Context& context, const proto::Message& message) override {
    class Hasty final : public OtherContext {
     public:
      using OtherContext::OtherContext;
      TimerId After(Duration delay, proto::Message message) override {
        return OtherContext::After(delay / 10, std::move(message));
      }
    };
    Hasty hasty(context);
    actor().OnMessage(hasty, message);
  }
};

bool IsSharing(const std::string& name) { return name == actor_name::kSync || name == actor_name::kReplica; }

using Applies = std::function<void(SimOptions& options)>;

// Wraps each actor named `actor_name` in a MutantActor.
template <typename MutantActor>
Applies Wrapped(const char* actor_name) {
  return [actor_name](SimOptions& options) {
    options.wrap = [actor_name](AgentId, const std::string& name, std::unique_ptr<Actor> actor) {
      if (name == actor_name) actor = std::make_unique<MutantActor>(std::move(actor));
      return actor;
    };
  };
}

Applies Hooked(const char* actor_name, Hooks hooks) {
  return [actor_name, hooks](SimOptions& options) {
    options.wrap = [actor_name, hooks](AgentId, const std::string& name, std::unique_ptr<Actor> actor) {
      if (name == actor_name) actor = std::make_unique<HookedActor>(std::move(actor), hooks);
      return actor;
    };
  };
}

Applies Hears(const char* actor_name, decltype(Hooks::hears) hears) {
  return Hooked(actor_name, {std::move(hears), nullptr});
}
Applies Says(const char* actor_name, decltype(Hooks::says) says) {
  return Hooked(actor_name, {nullptr, std::move(says)});
}

// Every batch claims that its destination's newest order to share (ShareRequest.order) is done, even if records are
// still missing.
void ReportTheEndTooSoon(SimOptions& options) {
  using Ends = std::map<std::pair<AgentId, AgentId>, std::uint64_t>;  // Newest order, by agent and requester.
  const auto orders = std::make_shared<Ends>();
  Hooks hooks;
  hooks.hears = [orders](Context& context, proto::Message& message) {
    const std::uint64_t order = message.share_request().order();
    if (order != 0) (*orders)[{context.self().agent, context.sender().agent}] = order;
    return true;
  };
  hooks.says = [orders](Context& context, const Address& to, proto::Message& message) {
    const auto order = orders->find({context.self().agent, to.agent});
    if (message.has_batch() && order != orders->end()) {
      message.mutable_batch()->mutable_order_end()->set_order(order->second);
    }
    return true;
  };
  Hooked(actor_name::kSync, std::move(hooks))(options);
}

// Removes the incomplete pairs of agents from every progress report, and reports completion.
bool LeavePairsOut(Context&, const Address&, proto::Message& message) {
  if (!message.has_share_reply() || !message.share_reply().has_progress()) return true;
  proto::ShareProgress& progress = *message.mutable_share_reply()->mutable_progress();
  auto& pairs = *progress.mutable_pairs();
  pairs.erase(std::remove_if(pairs.begin(), pairs.end(), [](const auto& pair) { return !pair.is_complete(); }),
              pairs.end());
  progress.set_is_complete(true);
  return true;
}

// Storage holds back states that were inserted after the destination's newest order to share was accepted.
void KeepNewStatesBack(SimOptions& options) {
  struct Storage {
    std::map<std::pair<AgentId, int>, std::uint64_t> marks;  // Last MissingRequest::mark, by destination and kind.
    std::map<std::pair<AgentId, int>, std::set<RecordKey>> came_after;
    std::pair<AgentId, int> asked;
  };
  const auto storages = std::make_shared<std::map<AgentId, Storage>>();
  Hooks hooks;
  hooks.hears = [storages](Context& context, proto::Message& message) {
    if (!message.has_missing_request() || message.missing_request().mark() == 0) return true;
    Storage& storage = (*storages)[context.self().agent];
    storage.asked = {message.missing_request().destination(), message.missing_request().kind()};
    if (std::exchange(storage.marks[storage.asked], message.missing_request().mark()) !=
        message.missing_request().mark()) {
      storage.came_after[storage.asked].clear();
    }
    return true;
  };
  hooks.says = [storages](Context& context, const Address&, proto::Message& message) {
    Storage& storage = (*storages)[context.self().agent];
    for (const proto::RecordKey& key : message.insert_reply().keys()) {
      if (!IsState(key.data_type())) continue;
      for (auto& [destination, keys] : storage.came_after) keys.insert(FromProto(key));
    }
    if (!message.has_missing_reply()) return true;
    auto& records = *message.mutable_missing_reply()->mutable_records();
    const std::set<RecordKey>& after = storage.came_after[storage.asked];
    records.erase(std::remove_if(records.begin(), records.end(),
                                 [&](const auto& record) { return after.contains(FromProto(record.key())); }),
                  records.end());
    return true;
  };
  Hooked(actor_name::kStorage, std::move(hooks))(options);
}

// For 55 s after a failed insert on a full disk, an agent refuses all inserts.
void StoreNothingAfterAFullDisk(SimOptions& options) {
  for (const char* fault : {"full", "failing"}) options.faults_per_hour[fault] = 0;
  options.faults_per_hour["full_prune"] = 3;
  // The invariants allow refused inserts for one minute after a disk fault, so this time must be shorter.
  static constexpr std::chrono::seconds kRefuses(55);
  const auto full = std::make_shared<std::map<AgentId, MonotonicTime>>();
  Hooks hooks;
  hooks.hears = [full](Context& context, proto::Message& message) {
    const auto since = full->find(context.self().agent);
    const bool is_full = since != full->end() && context.now() - since->second < kRefuses;
    if (!message.has_insert_request() || !is_full) return true;
    proto::Message reply;
    reply.mutable_insert_reply()->mutable_error()->set_code(proto::ERROR_CODE_FULL);
    (void)context.Reply(std::move(reply));
    return false;
  };
  hooks.says = [full](Context& context, const Address&, proto::Message& message) {
    if (message.insert_reply().error().code() == proto::ERROR_CODE_FULL) {
      (*full)[context.self().agent] = context.now();
    }
    return true;
  };
  Hooked(actor_name::kStorage, std::move(hooks))(options);
}

void CacheAcknowledgments(SimOptions& options) {
  auto cache = std::make_shared<CachedAcknowledgments::Cache>();
  options.wrap = [cache](AgentId, const std::string& name, std::unique_ptr<Actor> actor) -> std::unique_ptr<Actor> {
    if (!IsSharing(name)) return actor;
    return std::make_unique<CachedAcknowledgments>(std::move(actor), cache);
  };
}

// Calls `keeps` to change the leases before the sync and replica actors receive them.
void HearLeases(SimOptions& options, std::function<void(AgentId self, proto::LeasesChanged& changed)> keeps) {
  Hooks hooks;
  hooks.hears = [keeps = std::move(keeps)](Context& context, proto::Message& message) {
    if (message.has_leases_changed()) keeps(context.self().agent, *message.mutable_leases_changed());
    return true;
  };
  options.wrap = [hooks](AgentId, const std::string& name, std::unique_ptr<Actor> actor) -> std::unique_ptr<Actor> {
    if (!IsSharing(name)) return actor;
    return std::make_unique<HookedActor>(std::move(actor), hooks);
  };
}

void IgnoreOthersLeases(AgentId self, proto::LeasesChanged& changed) {
  proto::LeasesChanged own;
  own.set_as_of_ns(changed.as_of_ns());
  for (const proto::AgentLease& lease : changed.leases()) {
    if (lease.agent_id() == self) *own.add_leases() = lease;
  }
  changed = std::move(own);
}

void IgnoreDriving(AgentId, proto::LeasesChanged& changed) {
  for (proto::AgentLease& lease : *changed.mutable_leases()) lease.set_driving_s(0);
}

void IgnorePauses(AgentId, proto::LeasesChanged& changed) {
  for (proto::AgentLease& lease : *changed.mutable_leases()) lease.set_paused_s(0);
}

bool IsOrderToPeer(Context& context, const Address& to, const proto::Message& message) {
  return message.has_share_request() && to.agent != context.self().agent;
}

// Removes the issuer from all terms, so that terms with the same number are equal.
bool SendTermsWithoutIssuer(Context&, const Address&, proto::Message& message) {
  const auto strip = [](proto::RoleAssignment& roles) {
    if (roles.term().number() == 0) return;
    roles.mutable_term()->set_issuer(1);
    roles.mutable_term()->set_issuer_epoch(1);
  };
  if (message.has_role_announce()) strip(*message.mutable_role_announce()->mutable_roles());
  if (message.has_role_show_reply()) strip(*message.mutable_role_show_reply()->mutable_roles());
  if (message.has_roles_changed()) strip(*message.mutable_roles_changed()->mutable_roles());
  return true;
}

// Does not notify an agent's actors that the agent has given up its roles because it cannot store them.
bool KeepRoles(Context&, const Address&, proto::Message& message) {
  const proto::RoleAssignment& roles = message.roles_changed().roles();
  return !message.has_roles_changed() || (roles.leader() != 0 && roles.survivor() != 0);
}

bool RequestNoMaps(Context&, proto::Message& message) {
  proto::RecordFilter& filter = *message.mutable_missing_request()->mutable_filter();
  const auto types = filter.data_types();
  filter.clear_data_types();
  for (const std::uint32_t type : types) {
    if (type != proto::LOCAL_TRAVERSABILITY_MAP) filter.add_data_types(type);
  }
  return true;
}

// Removes the content of optimized poses from the read replies that an actor of agent 2 receives.
bool LeavePosesOut(Context& context, proto::Message& message) {
  if (context.self().agent != 2 || !message.has_read_reply()) return true;
  for (proto::StoredRecord& record : *message.mutable_read_reply()->mutable_records()) {
    if (record.key().data_type() == proto::OPTIMIZED_POSE) record.clear_content();
  }
  return true;
}

// The gateway treats requests that a rover relays as if the base station had sent them.
class RelaysForTheBase final : public OtherActor {
 public:
  RelaysForTheBase(std::unique_ptr<Actor> actor, AgentId base) : OtherActor(std::move(actor)), base_(base) {}
  void OnMessage(Context& context, const proto::Message& message) override {
    if (message.body_case() != proto::Message::kControlRequest || !IsPeer(context.sender().agent)) {
      return OtherActor::OnMessage(context, message);
    }
    class FromTheBase final : public OtherContext {
     public:
      FromTheBase(Context& context, AgentId base) : OtherContext(context), sender_{base, actor_name::kGateway} {}
      const Address& sender() const override { return sender_; }

     private:
      const Address sender_;
    };
    FromTheBase from_the_base(context, base_);
    actor().OnMessage(from_the_base, message);
  }

 private:
  bool IsPeer(AgentId agent) const { return agent != kClients && agent < base_; }

  const AgentId base_;
};

// Gives each role assignment that a Byzantine agent announces a term of the next era, with the base station as issuer,
// and signs it with the base station's key.
void TakeRolesOfAnybody(SimOptions& options) {
  options.attacks = {"announce"};
  const auto base = static_cast<AgentId>(options.RoverCount() + 1);
  Hears(actor_name::kRole, [base, config = MakeTeamConfig(options)](Context&, proto::Message& message) {
    if (message.role_announce().roles().reason() != kByzantineReason) return true;
    proto::RoleAssignment& roles = *message.mutable_role_announce()->mutable_roles();
    roles.mutable_term()->set_number(TermNumber(EraOf(roles.term()) + 1, 0));
    roles.mutable_term()->set_issuer(base);
    roles.set_signature(SigningKeyOf(base).Sign(SignedBytes(config, roles)));
    return true;
  })(options);
}

// Signs quarantines in the name of their origins, so that storage accepts forged ones.
bool SignQuarantines(const proto::TeamConfig& config, proto::Message& message) {
  if (!message.has_store_request() || !HasSigningKeys(config)) return true;
  for (proto::StoredRecord& stored : *message.mutable_store_request()->mutable_records()) {
    const RecordKey key = FromProto(stored.key());
    proto::Record record;
    if (key.stream.type != proto::MAP_QUARANTINE || !record.ParseFromString(stored.content())) continue;
    const SigningKey signs = SigningKeyOf(key.stream.origin);
    record.mutable_map_quarantine()->set_signature(signs.Sign(SignedBytes(config, key, record)));
    stored.set_content(record.SerializeAsString());
    stored.set_hash(HashRecord(key, stored.content()));
  }
  return true;
}

// Agent 2 accepts forged poses as if the current leader had solved them.
void TakePosesOfAnybody(SimOptions& options) {
  options.attacks = {"pose"};
  Hears(actor_name::kMerge, [newest = proto::RoleAssignment()](Context& context, proto::Message& message) mutable {
    if (context.self().agent != 2 || !message.has_read_reply()) return true;
    for (proto::StoredRecord& stored : *message.mutable_read_reply()->mutable_records()) {
      proto::Record record;
      if (!record.ParseFromString(stored.content())) continue;
      if (record.has_role_assignment()) newest = record.role_assignment();
      if (newest.leader() == 0 || record.optimized_pose().run() < kForgedRunMin) continue;
      stored.mutable_key()->set_origin_agent(newest.leader());
      *record.mutable_optimized_pose()->mutable_term() = newest.term();
      stored.set_content(record.SerializeAsString());
    }
    return true;
  })(options);
}

// Storage accepts a Byzantine agent's edge between nodes of other agents, as a record of the first node's agent.
bool TakeStatements(Context&, proto::Message& message) {
  if (!message.has_store_request()) return true;
  for (proto::StoredRecord& stored : *message.mutable_store_request()->mutable_records()) {
    proto::Record record;
    if (!record.ParseFromString(stored.content()) || !CheckRecord(record) || !record.has_pose_graph_edge()) continue;
    if (CheckSpeaker(record, static_cast<AgentId>(stored.key().origin_agent()))) continue;
    stored.mutable_key()->set_origin_agent(record.pose_graph_edge().from().agent_id());
    stored.set_hash(HashRecord(FromProto(stored.key()), stored.content()));
    message.mutable_store_request()->clear_sender();
  }
  return true;
}

// Agent 2 accepts a Byzantine agent's quarantines as if the base station had issued them.
void CountQuarantinesOfAnybody(SimOptions& options) {
  options.byzantine = ByzantineSeeds::kAll;
  options.attacks = {"slander"};
  const auto base = static_cast<AgentId>(options.RoverCount() + 1);
  Hears(actor_name::kMerge, [base, liar = options.Byzantine()](Context& context, proto::Message& message) {
    if (context.self().agent != 2 || !message.has_read_reply()) return true;
    for (proto::StoredRecord& stored : *message.mutable_read_reply()->mutable_records()) {
      const bool is_slander = stored.key().data_type() == proto::MAP_QUARANTINE && stored.key().origin_agent() == liar;
      if (is_slander) stored.mutable_key()->set_origin_agent(base);
    }
    return true;
  })(options);
}

// If agent 2 cannot hold all maps, it keeps the maps that arrived first.
void MergeTheMapsThatCameFirst(SimOptions& options) {
  Hears(actor_name::kMerge, [came = std::set<RecordKey>()](Context& context, proto::Message& message) mutable {
    if (context.self().agent != 2 || !message.has_read_reply()) return true;
    for (proto::StoredRecord& stored : *message.mutable_read_reply()->mutable_records()) {
      const RecordKey key = FromProto(stored.key());
      if (key.stream.type != proto::LOCAL_TRAVERSABILITY_MAP || came.contains(key)) continue;
      if (came.size() == kFewMaps) {
        stored.clear_content();
      } else {
        came.insert(key);
      }
    }
    return true;
  })(options);
}

void RelayForTheBase(SimOptions& options) {
  options.byzantine = ByzantineSeeds::kAll;
  options.attacks = {"order"};
  const auto base = static_cast<AgentId>(options.RoverCount() + 1);
  options.wrap = [base](AgentId, const std::string& name, std::unique_ptr<Actor> actor) -> std::unique_ptr<Actor> {
    if (name != actor_name::kGateway) return actor;
    return std::make_unique<RelaysForTheBase>(std::move(actor), base);
  };
}

void KeepDamagedRows(SimOptions& options) {
  options.is_store_checked = false;
  options.faults_per_hour = {{"damage", 0}, {"damage_interval", 0}};
}

}  // namespace

const std::vector<Mutant>& Mutants() {
  using actor_name::kDownlink;
  using actor_name::kFailover;
  using actor_name::kGateway;
  using actor_name::kMerge;
  using actor_name::kPgo;
  using actor_name::kReplica;
  using actor_name::kRole;
  using actor_name::kStorage;
  using actor_name::kSync;
  static const std::vector<Mutant> mutants = {
      {"WithoutEpochs",
       "a lost disk takes an epoch again",
       {"one_content", "nothing_refused"},
       20,
       Wrapped<WithoutEpochs>(kStorage),
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/2},
      {"CachedAcknowledgments",
       "what was acknowledged once is never sent again",
       {"done_is_true", "nothing_lost", "home_again", "brought_out"},
       5,
       CacheAcknowledgments},
      {"AcknowledgesBeforeTheCommit",
       "the have-set is reported before the transaction",
       {"done_is_true", "acknowledged_held"},
       5,
       Wrapped<AcknowledgesBeforeTheCommit>(kStorage)},
      {"UpdateNeedsItsRow",
       "an optimized pose needs its node",
       {"acknowledged_held"},
       5,
       Wrapped<UpdateNeedsItsRow>(kStorage)},
      {"LastPoseHeard",
       "of a node's optimized poses the one heard last stands",
       {"pose_goes_up", "survivor_is_leader"},
       15,
       [](SimOptions& options) {
         options.faults_per_hour["swap"] = 40;
         Wrapped<LastPoseHeard>(kStorage)(options);
       },
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/3},
      {"PosesByEpoch",
       "an optimized pose of a newer term gives way to an older one in a higher epoch",
       {"history_is_own", "pose_goes_up", "nothing_lost", "survivor_is_leader", "brought_out", "home_again"},
       15,
       [](SimOptions& options) {
         options.faults_per_hour["wipe"] = 20;
         Wrapped<PosesByEpoch>(kStorage)(options);
       },
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/2},
      {"KeepsReissuedToItself",
       "states of epochs that became known later are not reissued",
       {"done_is_true", "newest_state", "survivor_is_leader", "nothing_lost"},
       30,
       [](SimOptions& options) {
         options.faults_per_hour["wipe"] = 6;
         Wrapped<KeepsReissuedToItself>(kStorage)(options);
       },
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/3},
      {"ReissuesWhateverWasKnown",
       "states are stored again whatever the later epoch's disk had known",
       {"newest_state"},
       60,
       [](SimOptions& options) {
         options.faults_per_hour["old_disk"] = 12;
         Wrapped<ReissuesWhateverWasKnown>(kStorage)(options);
       },
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/8},
      {"NewestByClock",
       "states are ordered by the wall clock",
       {"nothing_lost", "survivor_is_leader", "newest_state", "brought_out", "home_again", "done_is_true"},
       25,
       [](SimOptions& options) {
         options.faults_per_hour["clock"] = 12;
         Wrapped<NewestByClock>(kStorage)(options);
       },
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/2},
      {"StoresNothingAfterAFullDisk",
       "an agent whose disk was full stores nothing, whatever is pruned",
       {"stores_after_prune"},
       18,
       StoreNothingAfterAFullDisk,
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/6},
      {"TakesTheLastNotes",
       "a record supersedes older ones though its agent keeps all of its type",
       {"notes_kept"},
       14,
       Hears(kStorage, TakeTheLastNotes),
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/7},
      {"ReportsTheEndTooSoon",
       "a leader is notified of the end of its order before all is acknowledged",
       {"done_is_true"},
       10,
       ReportTheEndTooSoon},
      {"AnswersAfterItLeads",
       "an agent that leads no longer answers for its old term",
       {"done_is_true"},
       20,
       Hears(kReplica,
             [](Context& context, proto::Message& message) {
               return !message.has_roles_changed() || message.roles_changed().roles().leader() == context.self().agent;
             })},
      {"LeavesPairsOut", "what is not complete stands in no answer", {"done_is_true"}, 10, Says(kSync, LeavePairsOut)},
      {"AnswersBeforeItHasGathered",
       "an order is complete though the leader has yet to gather",
       {"done_is_true"},
       40,
       Hears(kSync,
             [](Context&, proto::Message& message) {
               if (message.has_gathering()) message.mutable_gathering()->clear_from();
               return true;
             })},
      {"KeepsNewStatesBack",
       "a state that came after an order was taken up is not sent with it, nor is the one that it replaced",
       {"done_is_true", "newest_state"},
       10,
       KeepNewStatesBack},
      {"DropsBeforeTheSuperseder",
       "a state is dropped before the one that replaces it comes",
       {"newest_state"},
       5,
       Wrapped<DropsBeforeTheSuperseder>(kStorage)},
      {"KeepsDamagedRows", "no store is read through as a process starts", {"one_content"}, 5, KeepDamagedRows},
      {"WithoutTerms",
       "the assignment heard last stands",
       {"comes_to_rest", "one_assignment", "one_leader"},
       15,
       Wrapped<WithoutTerms>(kRole)},
      {"PrunesBeforeTheSurvivorHasIt",
       "storage is notified only of what one of leader and survivor has",
       {"pruned_is_covered"},
       15,
       [](SimOptions& options) {
         options.faults_per_hour["prune"] = 40;
         Hears(kStorage, [](Context&, proto::Message& message) {
           if (message.prune_request().acknowledged_size() > 1) {
             message.mutable_prune_request()->mutable_acknowledged()->RemoveLast();
           }
           return true;
         })(options);
       },
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/4},
      {"TermsWithoutIssuer",
       "terms of one number are one",
       {"one_assignment", "one_leader", "comes_to_rest"},
       5,
       [](SimOptions& options) {
         options.faults_per_hour = {{"partition", 10}, {"reassign", 30}};
         Says(kRole, SendTermsWithoutIssuer)(options);
       }},
      {"OneIsNotNotified",
       "agent 3 hears of no change of roles",
       {"one_leader"},
       5,
       Hears(kRole, [](Context& context,
                       proto::Message& message) { return context.self().agent != 3 || !message.has_role_announce(); })},
      {"ForgetsItsTerm",
       "an agent begins with the team file's roles at each start",
       {"term_goes_up"},
       5,
       Hears(kRole,
             [](Context&, proto::Message& message) {
               if (message.has_load_roles_reply()) message.mutable_load_roles_reply()->clear_history();
               return true;
             })},
      {"WithoutANewTerm",
       "a leader goes on in its old term after a start",
       {"one_pose_a_run", "pose_goes_up", "one_leader"},
       15,
       Wrapped<WithoutANewTerm>(kRole)},
      {"WithoutGathering",
       "a new leader asks nobody for what it holds",
       {"nothing_lost"},
       25,
       Says(kReplica, [](Context& context, const Address& to,
                         proto::Message& message) { return !IsOrderToPeer(context, to, message); }),
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/4},
      {"GathersFromAllButOne",
       "a new leader does not ask agent 3 for what it holds",
       {"nothing_lost", "newest_state"},
       60,
       [](SimOptions& options) {
         options.faults_per_hour["wipe"] = 12;
         options.faults_per_hour["swap"] = 12;
         Says(kReplica, [](Context& context, const Address& to, proto::Message& message) {
           return to.agent != 3 || !IsOrderToPeer(context, to, message);
         })(options);
       },
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/23},
      {"ReplicatesAllButOne",
       "the survivor is not brought what agent 3 made",
       {"done_is_true", "survivor_is_leader", "nothing_lost"},
       10,
       Hears(kStorage,
             [](Context&, proto::Message& message) {
               if (!message.has_missing_request()) return true;
               proto::RecordFilter& filter = *message.mutable_missing_request()->mutable_filter();
               if (filter.ByteSizeLong() == 0) filter.add_not_origin_agents(3);
               return true;
             }),
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/3},
      {"NothingHome",
       "a leader does not bring an agent its own records",
       {"done_is_true", "home_again", "newest_state"},
       25,
       Hears(kStorage,
             [](Context&, proto::Message& message) {
               if (message.has_missing_request()) {
                 message.mutable_missing_request()->mutable_filter()->clear_own_records_of();
               }
               return true;
             })},
      {"NoMapsForGround",
       "the base station is brought no maps",
       {"done_is_true", "brought_out"},
       5,
       Hears(kStorage,
             [](Context& context, proto::Message& message) {
               return !message.has_missing_request() || RequestNoMaps(context, message);
             })},
      {"QuarantinesStay",
       "a leader brings others no quarantines of maps but its own",
       {"done_is_true", "brought_out"},
       5,
       Hears(kStorage,
             [](Context&, proto::Message& message) {
               if (message.has_missing_request()) {
                 message.mutable_missing_request()->mutable_filter()->clear_everyones_types();
               }
               return true;
             })},
      {"PosesStayRestricted",
       "a rover is brought the poses of its own nodes alone, although the policy rovers names poses",
       {"brought_out", "done_is_true"},
       20,
       Hears(kStorage,
             [](Context&, proto::Message& message) {
               if (!message.has_missing_request()) return true;
               proto::RecordFilter& filter = *message.mutable_missing_request()->mutable_filter();
               if (filter.optimized_poses_of_agent() == 0) return true;
               const auto pose = std::ranges::find(filter.everyones_types(), proto::OPTIMIZED_POSE);
               if (pose != filter.everyones_types().end()) filter.mutable_everyones_types()->erase(pose);
               return true;
             })},
      {"EndsTooEarly",
       "each batch says that it is the last",
       {"end_is_last"},
       5,
       Says(kSync,
            [](Context&, const Address&, proto::Message& message) {
              if (message.has_batch()) message.set_remaining(0);
              return true;
            })},
      {"NeverEnds",
       "no batch says that it is the last",
       {"comes_to_rest"},
       5,
       Says(kReplica,
            [](Context&, const Address&, proto::Message& message) {
              if (message.has_batch() && message.remaining() == 0) message.set_remaining(1);
              return true;
            })},
      {"WithoutCredit",
       "64 kB are in flight",
       {"unacked_bounded"},
       5,
       [](SimOptions& options) { options.session.unacked_bytes_max = 64 * 1024; }},
      {"WithoutBudget",
       "no session keeps to the radio's budget",
       {"within_budget"},
       10,
       [](SimOptions& options) { options.is_paced = false; },
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/5},
      {"TimersMultiply", "each timer comes twice", {"mailbox_bounded"}, 5, Wrapped<TimersMultiply>(kReplica)},
      {"DamagesBatches",
       "a batch is damaged where it is sent",
       {"nothing_refused"},
       5,
       Says(kSync,
            [](Context&, const Address&, proto::Message& message) {
              if (message.has_batch()) message.mutable_batch()->mutable_coded()->append("?");
              return true;
            })},
      {"WithoutWindows",
       "sharing continues while agents drive or sleep",
       {"quiet_window"},
       5,
       [](SimOptions& options) {
         HearLeases(options, [](AgentId, proto::LeasesChanged& changed) { changed.clear_leases(); });
       }},
      {"OnlyItsOwnWindow",
       "sharing knows this agent's own leases alone",
       {"quiet_window"},
       5,
       [](SimOptions& options) { HearLeases(options, IgnoreOthersLeases); }},
      {"SharesWhileDriving",
       "sharing is quiet for those who sleep alone",
       {"quiet_window"},
       5,
       [](SimOptions& options) { HearLeases(options, IgnoreDriving); }},
      {"SharesWhilePaused",
       "sharing goes on in a pause",
       {"quiet_window"},
       5,
       [](SimOptions& options) { HearLeases(options, IgnorePauses); },
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/2},
      {"NoWindowOpens",
       "sharing does not hear that nobody drives or sleeps any more",
       {"comes_to_rest", "nothing_lost", "survivor_is_leader", "home_again", "brought_out", "newest_state"},
       5,
       [](SimOptions& options) {
         options.wrap = [](AgentId, const std::string& name, std::unique_ptr<Actor> actor) -> std::unique_ptr<Actor> {
           if (!IsSharing(name)) return actor;
           const auto hears = [](Context&, proto::Message& message) {
             return !message.has_leases_changed() || !message.leases_changed().leases().empty();
           };
           return std::make_unique<HookedActor>(std::move(actor), Hooks{hears, nullptr});
         };
       }},
      {"FailoverWithoutLeases",
       "a survivor takes the lead of a leader that sleeps",
       {"failover_has_cause"},
       30,
       [](SimOptions& options) {
         options.faults_per_hour["sleep"] = 12;
         Hears(kFailover, [](Context&, proto::Message& message) { return !message.has_leases_changed(); })(options);
       },
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/3},
      {"FailoverTooSoon",
       "a survivor waits for a tenth of the time",
       {"failover_has_cause"},
       12,
       Wrapped<WaitsTooShort>(kFailover),
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/3},
      {"WithoutFailover",
       "no survivor takes the lead",
       {"failover_happens"},
       15,
       Says(kFailover,
            [](Context&, const Address&, proto::Message& message) { return !message.has_role_set_request(); }),
       SimulatedActors::kSharing,
       /*is_of_lies=*/false,
       /*likely_seed=*/3},
      {"FailsInHighTerms",
       "an actor fails at each message with a high term",
       {"starts"},
       5,
       Hears(kReplica,
             [](Context& context, proto::Message& message) {
               if (message.roles_changed().roles().term().number() > 3) {
                 context.Fail(Error{ErrorCode::kInternal, "the term is too high", ""});
               }
               return true;
             })},
      {"LeadsInATermThatIsOver",
       "a leader that cannot store a newer term goes on leading",
       {"steps_down"},
       10,
       [](SimOptions& options) {
         options.faults_per_hour["failing"] = 12;
         options.faults_per_hour["swap"] = 20;
         Says(kRole, KeepRoles)(options);
       }},
      {"AcknowledgesFailedInserts",
       "an insert is acknowledged though its commit failed",
       {"one_content", "nothing_lost", "acknowledged_held"},
       5,
       [](SimOptions& options) {
         options.faults_per_hour["failing"] = 6;
         Wrapped<AcknowledgesFailedInserts>(kStorage)(options);
       }},
      {"ForgetsSilentActors",
       "a gateway forgets requests that nobody answers",
       {"answered"},
       5,
       Hears(kGateway, [](Context&, proto::Message& message) { return !message.has_timer(); }),
       SimulatedActors::kAll},
      {"AnswersWhatIsRefused",
       "an insert that storage refuses is answered as done",
       {"answer_true", "acknowledged_held"},
       5,
       Hears(kGateway,
             [](Context&, proto::Message& message) {
               if (message.has_insert_reply()) message.mutable_insert_reply()->clear_error();
               return true;
             }),
       SimulatedActors::kAll},
      {"LeavesOutTheLast",
       "a page that a client reads lacks its last record",
       {"answer_true"},
       5,
       Hears(kGateway,
             [](Context&, proto::Message& message) {
               if (!message.has_read_reply() || message.read_reply().records().empty()) return true;
               message.mutable_read_reply()->mutable_records()->RemoveLast();
               message.mutable_read_reply()->mutable_row_ids()->RemoveLast();
               return true;
             }),
       SimulatedActors::kAll},
      {"RefusesWithoutAReason",
       "an agent that does not lead refuses to solve, and does not say why",
       {"clear_error"},
       5,
       Says(kPgo,
            [](Context&, const Address&, proto::Message& message) {
              if (message.has_optimize_reply()) message.mutable_optimize_reply()->mutable_error()->clear_text();
              return true;
            }),
       SimulatedActors::kAll},
      {"SolvesWithoutLead",
       "agent 2 solves although another agent leads",
       {"leader_solves", "answer_true"},
       5,
       Hears(kPgo,
             [](Context& context, proto::Message& message) {
               if (context.self().agent == 2 && message.has_roles_changed()) {
                 message.mutable_roles_changed()->mutable_roles()->set_leader(2);
               }
               return true;
             }),
       SimulatedActors::kAll},
      {"MergesWithoutPoses",
       "agent 2 merges maps at raw poses",
       {"map_of_records"},
       5,
       Hears(kMerge, LeavePosesOut),
       SimulatedActors::kAll},
      {"MergesWhatIsPruned",
       "merging is not notified that records are pruned",
       {"map_of_records", "same_map"},
       10,
       [](SimOptions& options) {
         options.faults_per_hour["prune"] = 40;
         Hears(kMerge, [](Context&, proto::Message& message) {
           if (message.has_records_stored()) message.mutable_records_stored()->clear_is_pruned();
           return true;
         })(options);
       },
       SimulatedActors::kAll,
       /*is_of_lies=*/false,
       /*likely_seed=*/5},
      {"SendsSomeTiles",
       "of the tiles that changed one is not sent",
       {"map_of_records"},
       5,
       Says(kMerge,
            [](Context&, const Address&, proto::Message& message) {
              if (message.map_tiles_reply().tiles().empty()) return true;
              message.mutable_map_tiles_reply()->mutable_tiles()->RemoveLast();
              return true;
            }),
       SimulatedActors::kAll},
      {"PacksTwice",
       "a bundle is packed whatever those before it hold",
       {"bundle_once"},
       5,
       Hears(kDownlink,
             [](Context&, proto::Message& message) {
               if (message.has_load_bundles_reply()) message.mutable_load_bundles_reply()->clear_taken();
               return true;
             }),
       SimulatedActors::kAll},
      {"PacksNoMaps",
       "no map comes into a bundle",
       {"bundle_once"},
       5,
       Says(kDownlink,
            [](Context& context, const Address&, proto::Message& message) {
              return !message.has_missing_request() || RequestNoMaps(context, message);
            }),
       SimulatedActors::kAll},
      {"MakesUnsavedBundles",
       "a bundle is made though the disk does not take it",
       {"bundle_kept"},
       15,
       [](SimOptions& options) {
         options.faults_per_hour["failing"] = 20;
         Hears(kDownlink, [](Context&, proto::Message& message) {
           if (message.has_save_bundle_reply()) message.mutable_save_bundle_reply()->clear_error();
           return true;
         })(options);
       },
       SimulatedActors::kAll},
      {"TakesRecordsOfAnybody",
       "a record is accepted from any agent",
       {"only_own_lies"},
       4,
       Hears(kStorage,
             [](Context&, proto::Message& message) {
               if (message.has_store_request()) message.mutable_store_request()->clear_sender();
               return true;
             }),
       SimulatedActors::kSharing,
       /*is_of_lies=*/true,
       /*likely_seed=*/4},
      {"TakesDropsOfAnybody",
       "any agent is believed that reports a record as dropped",
       {"only_own_lies", "pruned_is_covered", "newest_state"},
       4,
       [](SimOptions& options) {
         options.attacks = {"drop"};
         Hears(kStorage, [](Context&, proto::Message& message) {
           const bool is_drop = message.has_store_request() && message.store_request().records().empty();
           if (is_drop) message.mutable_store_request()->clear_sender();
           return true;
         })(options);
       },
       SimulatedActors::kSharing,
       /*is_of_lies=*/true,
       /*likely_seed=*/4},
      {"TakesRolesOfAnybody",
       "roles are accepted from any issuer",
       {"honest_roles"},
       4,
       TakeRolesOfAnybody,
       SimulatedActors::kSharing,
       /*is_of_lies=*/true,
       /*likely_seed=*/4},
      {"TakesQuarantinesOfAnybody",
       "a quarantine of maps is accepted with any signature",
       {"only_own_lies"},
       4,
       [](SimOptions& options) {
         options.attacks = {"event"};
         Hears(kStorage, [config = MakeTeamConfig(options)](Context&, proto::Message& message) {
           return SignQuarantines(config, message);
         })(options);
       },
       SimulatedActors::kSharing,
       /*is_of_lies=*/true,
       /*likely_seed=*/4},
      {"TakesPosesOfAnybody",
       "agent 2 merges maps at poses of who never led",
       {"map_of_records"},
       12,
       TakePosesOfAnybody,
       SimulatedActors::kAll,
       /*is_of_lies=*/true,
       /*likely_seed=*/8},
      {"TakesStatementsOfAnybody",
       "odometry and ranges between other agents' nodes are taken",
       {"only_own_lies"},
       4,
       [](SimOptions& options) {
         options.attacks = {"slander"};
         Hears(kStorage, TakeStatements)(options);
       },
       SimulatedActors::kSharing,
       /*is_of_lies=*/true,
       /*likely_seed=*/4},
      {"CountsQuarantinesOfAnybody",
       "agent 2 leaves out maps by the word of an agent that never led",
       {"map_of_records"},
       8,
       CountQuarantinesOfAnybody,
       SimulatedActors::kAll,
       /*is_of_lies=*/true,
       /*likely_seed=*/4},
      {"MergesTheMapsThatCameFirst",
       "agent 2 has room for few maps, and merges those that came first",
       {"map_of_records"},
       5,
       MergeTheMapsThatCameFirst,
       SimulatedActors::kAll},
      {"TakesCommandsOfAnybody",
       "a command is accepted through any relay",
       {"honest_roles", "only_own_lies", "starts"},
       4,
       RelayForTheBase,
       SimulatedActors::kAll,
       /*is_of_lies=*/true},
  };
  return mutants;
}

}  // namespace moondb::simulation
