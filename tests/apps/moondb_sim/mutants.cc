#include "tests/apps/moondb_sim/mutants.h"

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <utility>

#include "model/have_set.h"
#include "model/record_key.h"

namespace moondb::simulation {
namespace {

// Passes everything on; mutants override what they break.
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

// An epoch that a lost disk takes again.
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

// Trusts what a destination once acknowledged, as a log per destination does.
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

// Acknowledges what a peer sent, and stores it a moment later.
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
    HaveSet had;
    for (const proto::StoredRecord& record : message.store_request().records()) {
      const RecordKey key = FromProto(record.key());
      had[key.stream].held.Add(key.seq);
    }
    waiting_.push_back(message);
    context.AfterTimer(std::chrono::milliseconds(500), 1);
    proto::Message reply;
    *reply.mutable_store_reply()->mutable_had() = ToProto(had);
    (void)context.Reply(std::move(reply));
  }

 private:
  std::vector<proto::Message> waiting_;
};

// Takes whatever assignment it heard last, whatever its term.
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

// A leader that starts again takes the term that it already had: until it has one it reads and hears that the last one
// was never given, and its epoch is always the same.
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

// Of a rover's states it keeps the one with the newest stamp.
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
      if (record.stamp_ns() >= newest) {
        newest = record.stamp_ns();
        *request.add_records() = stored;
      } else {
        dropped[key.stream].dropped.Add(key.seq);
      }
    }
    const proto::HaveSet told = ToProto(dropped);
    request.mutable_dropped()->MergeFrom(told.streams());
    OtherActor::OnMessage(context, changed);
  }

 private:
  std::map<AgentId, std::int64_t> newest_ns_;
};

// Takes an optimized pose only where it holds the node, and says that it had it in any case.
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
          HaveSet had = *FromProto(message->store_reply().had());
          had.Merge(more_);
          *message->mutable_store_reply()->mutable_had() = ToProto(had);
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

bool IsSharing(const std::string& name) { return name == actor_name::kSync || name == actor_name::kReplica; }

template <typename MutantActor>
Mutant Of(const char* actor_name, std::string name, std::string what) {
  return {std::move(name), std::move(what), [actor_name] {
            return [actor_name](AgentId, const std::string& wrapped, std::unique_ptr<Actor> actor) {
              if (wrapped == actor_name) actor = std::make_unique<MutantActor>(std::move(actor));
              return actor;
            };
          }};
}

}  // namespace

const std::vector<Mutant>& Mutants() {
  static const std::vector<Mutant> mutants = {
      Of<WithoutEpochs>(actor_name::kStorage, "WithoutEpochs", "a lost disk takes an epoch again"),
      {"CachedAcknowledgments", "what was acknowledged once is never sent again",
       [] {
         auto cache = std::make_shared<CachedAcknowledgments::Cache>();
         return [cache](AgentId, const std::string& name, std::unique_ptr<Actor> actor) -> std::unique_ptr<Actor> {
           if (!IsSharing(name)) return actor;
           return std::make_unique<CachedAcknowledgments>(std::move(actor), cache);
         };
       }},
      Of<AcknowledgesBeforeTheCommit>(actor_name::kStorage, "AcknowledgesBeforeTheCommit",
                                      "the have-set is told before the transaction"),
      Of<WithoutTerms>(actor_name::kRole, "WithoutTerms", "the assignment heard last stands"),
      Of<WithoutANewTerm>(actor_name::kRole, "WithoutANewTerm", "a leader goes on in its old term after a start"),
      Of<NewestByClock>(actor_name::kStorage, "NewestByClock", "states are ordered by the wall clock"),
      Of<UpdateNeedsItsRow>(actor_name::kStorage, "UpdateNeedsItsRow", "an optimized pose needs its node"),
  };
  return mutants;
}

}  // namespace moondb::simulation
