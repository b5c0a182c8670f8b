#include "apps/moondb_sim/rare_states.h"

#include <algorithm>

#include "apps/moondb_sim/byzantine_agent.h"

namespace moondb::simulation {
namespace {

bool IsMapQuestion(const proto::Message& message) {
  return message.has_merge_request() || message.has_map_tiles_request() || message.has_map_why_request() ||
         message.has_map_stats_request();
}

bool IsMapAnswer(const proto::Message& message) {
  return message.has_merge_reply() || message.has_map_tiles_reply() || message.has_map_why_reply() ||
         message.has_map_stats_reply();
}

}  // namespace

const std::vector<RareState>& RareStateKinds() {
  static const std::vector<RareState> kinds = [] {
    std::vector<RareState> all = {
        {"fragment_resumed", "a large record goes on in another session where a cut ended it"},
        {"fragment_after_roles", "it goes on after a change of roles"},
        {"roles_at_the_end", "roles change while the last batch of a session is not acknowledged"},
        {"batch_on_bad_disk", "a disk that is full or fails does not take a batch"},
        {"roles_amid_merge", "roles change while a client waits for a map"},
        {"roles_amid_solve", "roles change while the pose graph is solved"},
        {"bundle_outlives", "a bundle is acknowledged after the process that made it restarted"},
        {"tiles_in_time", "a client that waits for changes of the map is sent them"},
        {"feed_in_time", "a client that waits for records is sent them"},
        {"insert_unanswered", "an agent ends while its storage works on an insert"},
        {"relay_lost", "the agent that a client asks through another is lost before it answers"},
        {"sync_done", "an order to sync is answered as complete"},
        {"replication_done", "an order to replicate is answered as complete"},
        {"maps_left_out", "maps of an agent find no room in the merged map"},
        {"failover", "a survivor takes the lead by itself"},
    };
    for (const AttackKind& kind : AttackKinds()) {
      all.push_back({RareStateOf(kind), "an honest agent hears a Byzantine one that " + kind.what});
    }
    return all;
  }();
  return kinds;
}

void RareStates::OnHandle(const Address& actor, const proto::Message& message) {
  switch (message.body_case()) {
    case proto::Message::kRolesChanged:
      return OnRoles(actor, message.roles_changed().roles().term().number());
    case proto::Message::kHave:
      ending_.erase({actor.agent, actor.actor, message.hop_sender()});
      return;
    case proto::Message::kLeftOutReport:
      if (!message.left_out_report().without_room().empty()) Count("maps_left_out");
      return;
    case proto::Message::kOptimizeRequest:
      ++solving_[actor.agent];
      return;
    case proto::Message::kOptimizeReply:
      solving_[actor.agent] = std::max(0, solving_[actor.agent] - 1);
      return;
    default:
      break;
  }
  if (IsMapQuestion(message)) ++merging_[actor.agent];
  if (IsMapAnswer(message)) merging_[actor.agent] = std::max(0, merging_[actor.agent] - 1);
}

// Call when the actor receives roles of term number `term`. The first roles since the actor's start do not count as a
// change of roles, because they were valid before the start.
void RareStates::OnRoles(const Address& actor, std::uint64_t term) {
  const auto [known, is_first] = term_of_.try_emplace(actor, term);
  const bool is_new = !is_first && term > known->second;
  known->second = std::max(known->second, term);
  std::uint64_t& newest = newest_term_[actor.agent];
  const bool is_first_of_agent = is_new && term > newest;
  newest = std::max(newest, term);
  if (!is_new) return;
  for (const auto& [sender, name, receiver] : ending_) {
    if (sender == actor.agent && name == actor.actor) Count("roles_at_the_end");
  }
  if (actor.actor == actor_name::kPgo && solving_[actor.agent] > 0) Count("roles_amid_solve");
  if (is_first_of_agent && merging_[actor.agent] > 0) Count("roles_amid_merge");
}

void RareStates::OnRadio(AgentId from, AgentId to, const proto::Message& message) {
  if (!message.has_batch() && !message.has_hello()) return;
  const Session session{from, message.source_actor(), to};
  if (message.has_hello()) {
    ending_.erase(session);
    return;
  }
  if (message.remaining() == 0) ending_.insert(session);
  if (message.batch().has_fragment()) OnFragment(session, message.batch());
}

void RareStates::OnFragment(const Session& session, const proto::Batch& batch) {
  const auto& [from, actor, to] = session;
  const Fragment now{batch.session_id(), newest_term_[from]};
  const auto [known, is_new] = fragments_.try_emplace({to, batch.fragment().hash()}, now);
  if (!is_new && batch.fragment().first_byte() > 0 && known->second.session_id != now.session_id) {
    Count("fragment_resumed");
    if (known->second.term < now.term) Count("fragment_after_roles");
  }
  known->second = now;
}

void RareStates::OnAgentEnded(AgentId agent) {
  merging_.erase(agent);
  solving_.erase(agent);
  newest_term_.erase(agent);
  std::erase_if(term_of_, [agent](const auto& entry) { return entry.first.agent == agent; });
  std::erase_if(ending_, [agent](const Session& session) { return std::get<0>(session) == agent; });
}

}  // namespace moondb::simulation
