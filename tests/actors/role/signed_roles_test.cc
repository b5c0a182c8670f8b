// Tests roles in a team with keys: several RoleLogics exchange messages, and some agents announce forged roles.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>

#include "actors/role/role_logic.h"
#include "model/term.h"

namespace moondb {
namespace {

using testing::HasSubstr;

constexpr AgentId kBase = 9;

// Returns a text that takes the place of `agent`'s signature.
std::string SignAs(AgentId agent, proto::RoleAssignment roles) {
  roles.clear_signature();
  return "agent " + std::to_string(agent) + ": " + std::to_string(std::hash<std::string>()(roles.SerializeAsString()));
}

// A team of RoleLogics: rovers 1, 2 and so on, and optionally base station kBase. In the team file, agent 1 is the
// leader and agent 2 the survivor.
class SignedTeam {
 public:
  explicit SignedTeam(int rovers, bool has_base = false) {
    for (AgentId agent = 1; agent <= static_cast<AgentId>(rovers); ++agent) agents_.push_back(agent);
    if (has_base) agents_.push_back(kBase);
    for (const AgentId agent : agents_) Start(agent, {});
  }

  // Restarts the agent. `disk`: the stored assignments that the agent acted on. `records`: assignments that its storage
  // contains as records.
  void Start(AgentId agent, std::vector<proto::RoleAssignment> disk,
             const std::vector<proto::RoleAssignment>& records = {}) {
    logics_[agent] = std::make_unique<RoleLogic>(OptionsOf(agent));
    logics_[agent]->SetNow(now_);
    disks_[agent] = disk;
    Perform(agent, logics_[agent]->OnLoaded(std::move(disk), ++epoch_, 0, records));
    Perform(agent, logics_[agent]->OnLeaderTimer(0));
    Settle();
  }

  RoleLogic::Options OptionsOf(AgentId agent) const {
    RoleLogic::Options options;
    options.self = agent;
    options.agents = agents_;
    options.left = left_;
    options.initial.set_leader(1);
    options.initial.set_survivor(2);
    options.check = [](const proto::RoleAssignment& roles) -> Result<void> {
      if (roles.leader() == kBase || roles.survivor() == kBase) return Fail(ErrorCode::kRefused, "is a base station");
      return {};
    };
    options.sign = [agent](const proto::RoleAssignment& roles) { return SignAs(agent, roles); };
    options.is_signed = [](const proto::RoleAssignment& roles) {
      return roles.signature() == SignAs(roles.term().issuer(), roles);
    };
    options.may_command = [](AgentId other) { return other == kBase; };
    return options;
  }

  // Stops `gone`. The other agents restart with a team file that marks `gone` as left.
  void Leave(AgentId gone) {
    left_.insert(gone);
    logics_.erase(gone);
    for (const AgentId agent : agents_) {
      if (!left_.contains(agent)) Start(agent, std::vector<proto::RoleAssignment>(disks_[agent]));
    }
  }

  // From now on, the agents in `together` cannot exchange messages with the other agents. Messages in flight are lost.
  void Divide(std::set<AgentId> together) {
    together_ = std::move(together);
    queue_.clear();
  }
  // Connects all agents again. Each agent then announces its roles to the others.
  void Heal() {
    together_.clear();
    for (const auto& [agent, logic] : logics_) {
      for (const AgentId peer : agents_) {
        if (peer != agent) Perform(agent, logic->OnPeerConnected(peer));
      }
    }
    Settle();
    // Repeats the announcements that are not confirmed yet.
    for (const auto& [agent, logic] : logics_) Perform(agent, logic->OnAnnounceTimer());
    Settle();
  }

  Result<void> Set(AgentId at, AgentId leader, AgentId survivor) {
    proto::RoleSetRequest request;
    request.set_leader(leader);
    request.set_survivor(survivor);
    Result<proto::RoleAssignment> roles = logics_[at]->Propose(request, 0);
    if (!roles) return tl::unexpected(roles.error());
    Perform(at, logics_[at]->Adopt(*std::move(roles)));
    Settle();
    return {};
  }

  // `liar` announces the forged `roles` to all other agents. If an agent requests the predecessors of `roles`, `liar`
  // sends its earlier forgeries.
  void Announce(AgentId liar, const proto::RoleAssignment& roles) {
    lies_[roles.signature()] = roles;
    proto::RoleAnnounce announce;
    *announce.mutable_roles() = roles;
    for (const AgentId agent : agents_) {
      if (agent != liar)
        queue_.push_back({liar, agent, [=, this] { Take(agent, logics_[agent]->OnAnnounce(liar, announce)); }});
    }
    Settle();
  }

  // Notifies the agent's RoleLogic that storage received `roles` as a record.
  void Record(AgentId agent, const proto::RoleAssignment& roles) {
    Perform(agent, logics_[agent]->OnRecord(roles));
    Settle();
  }

  // From now on, storage does not confirm any save until FinishSaving is called.
  void HoldSaving() { is_saving_held_ = true; }
  void FinishSaving(AgentId agent) {
    is_saving_held_ = false;
    Perform(agent, logics_[agent]->OnSaved());
    Settle();
  }

  void RunAnnounceTimer(AgentId agent) {
    Perform(agent, logics_[agent]->OnAnnounceTimer());
    Settle();
  }

  void AdvanceTime(std::chrono::nanoseconds time) {
    now_ += time;
    for (auto& [agent, logic] : logics_) logic->SetNow(now_);
  }

  const proto::RoleAssignment& Of(AgentId agent) const { return logics_.at(agent)->current(); }
  std::string Term(AgentId agent) const { return TermText(Of(agent).term()); }
  AgentId LeaderAt(AgentId agent) const { return Of(agent).leader(); }
  const std::vector<proto::RoleAssignment>& disk(AgentId agent) const { return disks_.at(agent); }
  const std::string& last_refusal() const { return last_refusal_; }
  int refusals() const { return refusals_; }
  std::size_t chain_pages() const { return chain_pages_; }
  int announce_timers() const { return announce_timers_; }  // Number of announce timers that were started.

 private:
  struct Said {
    AgentId from;
    AgentId to;
    std::function<void()> hear;
  };

  bool CanHear(AgentId from, AgentId to) const {
    return together_.empty() || together_.contains(from) == together_.contains(to);
  }

  void Take(AgentId agent, Result<RoleLogic::Actions> actions) {
    if (actions) return Perform(agent, *std::move(actions));
    ++refusals_;
    last_refusal_ = ToString(actions.error());
  }

  void Perform(AgentId agent, RoleLogic::Actions actions) {
    announce_timers_ += actions.announce_timer ? 1 : 0;
    for (const RoleLogic::Announcement& said : actions.announcements) {
      queue_.push_back(
          {agent, said.to, [=, this] { Take(said.to, logics_[said.to]->OnAnnounce(agent, said.announce)); }});
    }
    if (actions.question) {
      const RoleLogic::ChainQuestion question = *actions.question;
      queue_.push_back({agent, question.to, [=, this] {
                          const proto::RoleChainReply reply = ChainFrom(question.to, question.request);
                          EXPECT_LE(reply.ByteSizeLong(), 2 * RoleLogic::kChainPageBytesMax);
                          ++chain_pages_;
                          queue_.push_back({question.to, agent, [=, this] {
                                              Take(agent, logics_[agent]->OnChainReply(question.to, reply));
                                            }});
                        }});
    }
    if (actions.save) {
      for (const proto::RoleAssignment& roles : logics_[agent]->SavingChain()) disks_[agent].push_back(roles);
      disks_[agent].push_back(*actions.save);
      if (is_saving_held_) return;
      Perform(agent, logics_[agent]->OnSaved());
    }
  }

  proto::RoleChainReply ChainFrom(AgentId agent, const proto::RoleChainRequest& request) {
    proto::RoleChainReply reply;
    for (auto lie = lies_.find(request.signature()); lie != lies_.end() && reply.chain_size() < 100;) {
      *reply.add_chain() = lie->second;
      lie = lies_.find(lie->second.follows());
    }
    return reply.chain().empty() ? logics_[agent]->OnChainRequest(request) : reply;
  }

  void Settle() {
    for (int i = 0; !queue_.empty(); ++i) {
      ASSERT_LT(i, 100'000) << "they never end";
      const Said said = queue_.front();
      queue_.pop_front();
      if (logics_.contains(said.to) && CanHear(said.from, said.to)) said.hear();
    }
  }

  std::vector<AgentId> agents_;
  std::set<AgentId> left_;  // The agents of `agents_` that have left.
  std::map<AgentId, std::unique_ptr<RoleLogic>> logics_;
  std::map<AgentId, std::vector<proto::RoleAssignment>> disks_;
  std::map<std::string, proto::RoleAssignment> lies_;  // Forged assignments by signature.
  std::set<AgentId> together_;
  std::deque<Said> queue_;
  RoleLogic::Time now_{};
  std::uint64_t epoch_ = 100;
  bool is_saving_held_ = false;
  std::string last_refusal_;
  int refusals_ = 0;
  std::size_t chain_pages_ = 0;
  int announce_timers_ = 0;
};

// Returns a forged successor of `follows`, issued and signed by `liar`. Without `is_command`, only the leader or the
// survivor in `follows` may issue a successor.
proto::RoleAssignment ForgedAfter(const proto::RoleAssignment& follows, AgentId liar, AgentId leader, AgentId survivor,
                                  bool is_command = false) {
  proto::RoleAssignment roles = RoleChain::Next(follows, is_command);
  roles.mutable_term()->set_issuer(liar);
  roles.mutable_term()->set_issuer_epoch(666);
  roles.set_leader(leader);
  roles.set_survivor(survivor);
  roles.set_signature(SignAs(liar, roles));
  return roles;
}

TEST(SignedRolesTest, MayBeChangedByLeaderSurvivorAndCommandingAgents) {
  SignedTeam team(3, /*has_base=*/true);
  ASSERT_TRUE(team.Set(1, 3, 2));
  EXPECT_EQ(team.LeaderAt(kBase), 3u);
  ASSERT_TRUE(team.Set(2, 2, 3));
  EXPECT_EQ(team.LeaderAt(1), 2u);
  const std::string before = team.Term(1);
  ASSERT_TRUE(team.Set(kBase, 1, 2));
  for (const AgentId agent : {1, 2, 3}) EXPECT_EQ(team.LeaderAt(agent), 1u);
  EXPECT_EQ(EraOf(team.Of(3).term()), 1u) << before;

  const Result<void> refused = team.Set(3, 3, 2);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_THAT(refused.error().text, HasSubstr("send the command to the leader (agent 1), to the survivor (agent 2)"));
  EXPECT_EQ(team.refusals(), 0);
}

TEST(SignedRolesTest, CannotBeChangedByARoverWithoutARole) {
  SignedTeam team(3, /*has_base=*/true);
  const std::string before = team.Term(1);
  team.Announce(3, ForgedAfter(team.Of(1), 3, 3, 2));
  EXPECT_THAT(team.last_refusal(), HasSubstr("agent 3 is neither leader nor survivor in the assignment before it"));
  team.Announce(3, ForgedAfter(team.Of(1), 3, 3, 2, /*is_command=*/true));
  proto::RoleAssignment far = ForgedAfter(team.Of(1), 3, 3, 2);
  far.mutable_term()->set_number(kTermNumberMax);
  far.set_signature(SignAs(3, far));
  team.Announce(3, far);
  proto::RoleAssignment another = ForgedAfter(team.Of(1), 3, 3, 2);
  another.mutable_term()->set_issuer(1);
  team.Announce(3, another);
  EXPECT_THAT(team.last_refusal(), HasSubstr("does not match its issuer's signing key"));
  for (const AgentId agent : {1, 2, 3, 9}) EXPECT_EQ(team.Term(agent), before) << agent;
  EXPECT_EQ(team.refusals(), 12);
}

TEST(SignedRolesTest, ConvergeAfterAPartitionWithTenTermsAgainstOne) {
  SignedTeam team(4);
  team.Divide({1, 3});
  for (int i = 0; i < 10; ++i) ASSERT_TRUE(team.Set(1, 1, i % 2 == 0 ? 3 : 2));
  ASSERT_TRUE(team.Set(2, 2, 4));
  EXPECT_EQ(team.LeaderAt(3), 1u);
  EXPECT_EQ(team.LeaderAt(4), 2u);
  team.Heal();
  for (const AgentId agent : {1, 2, 3, 4}) {
    EXPECT_EQ(team.LeaderAt(agent), 1u) << agent;
    EXPECT_EQ(team.Term(agent), team.Term(1)) << agent;
  }
  EXPECT_EQ(team.refusals(), 0);
}

TEST(SignedRolesTest, MayBeChangedByEitherAgentOfATeamOfTwo) {
  SignedTeam team(2);
  ASSERT_TRUE(team.Set(2, 2, 1));
  EXPECT_EQ(team.LeaderAt(1), 2u);
  ASSERT_TRUE(team.Set(1, 1, 2));
  EXPECT_EQ(team.LeaderAt(2), 1u);
  // Agent 1, the leader, loses its disk while agent 2 cannot hear it.
  team.Divide({1});
  team.Start(1, {});
  team.Heal();
  EXPECT_EQ(team.LeaderAt(1), 1u);
  EXPECT_EQ(team.Term(1), team.Term(2));
}

TEST(SignedRolesTest, ReturnToAnAgentThatWasWipedAtRevision5000) {
  SignedTeam team(3);
  team.Divide({1});
  for (int i = 0; i < 5000; ++i) ASSERT_TRUE(team.Set(1, 1, i % 2 == 0 ? 3 : 2));
  const std::string term = team.Term(1);
  team.Heal();
  EXPECT_EQ(team.Term(2), term);
  team.Divide({3});
  team.Start(3, {});
  EXPECT_EQ(team.Term(3), "0");
  const std::size_t pages = team.chain_pages();
  team.Heal();
  EXPECT_EQ(team.Term(3), team.Term(1));
  EXPECT_GT(team.chain_pages(), pages + 10) << "a chain of 5,000 comes page by page";
  // Agent 3 restarts from its disk. No other agent can help it.
  team.Divide({3});
  team.Start(3, team.disk(3));
  EXPECT_EQ(team.Term(3), term);
}

TEST(SignedRolesTest, StayValidAfterARestartThoughPredecessorsAreOnlyRecords) {
  SignedTeam team(3);
  ASSERT_TRUE(team.Set(1, 1, 3));
  ASSERT_TRUE(team.Set(1, 1, 2));
  const std::string term = team.Term(3);
  std::vector<proto::RoleAssignment> acted_on = team.disk(3);
  std::vector<proto::RoleAssignment> records(acted_on.begin(), acted_on.end() - 1);
  acted_on.erase(acted_on.begin(), acted_on.end() - 1);
  team.Divide({3});
  team.Start(3, acted_on);
  EXPECT_EQ(team.Term(3), "0") << "nothing shows that it counts";
  team.Start(3, acted_on, records);
  EXPECT_EQ(team.Term(3), term);
}

TEST(SignedRolesTest, CannotBeForgedForAWipedAgent) {
  SignedTeam team(3);
  ASSERT_TRUE(team.Set(1, 1, 2));
  const std::string before = team.Term(1);
  team.Divide({2});
  team.Start(2, {});
  proto::RoleAssignment invented = ForgedAfter(team.Of(1), 3, 3, 2);
  for (int i = 0; i < 5; ++i) {
    const proto::RoleAssignment next = ForgedAfter(invented, 3, 3, 2);
    invented = next;
  }
  team.Divide({2, 3});
  team.Announce(3, invented);
  EXPECT_EQ(team.Term(2), "0") << "its chain begins nowhere";
  team.Heal();
  EXPECT_EQ(team.Term(2), before);
}

TEST(SignedRolesTest, OneBaseStationAssignmentSupersedesAThousandOfADeposedLiar) {
  SignedTeam team(3, /*has_base=*/true);
  ASSERT_TRUE(team.Set(1, 3, 2));  // Rover 3 leads, and later forges assignments.
  proto::RoleAssignment lie = team.Of(1);
  ASSERT_TRUE(team.Set(2, 1, 2));
  EXPECT_EQ(team.LeaderAt(3), 1u);
  for (int i = 0; i < 1000; ++i) {
    team.AdvanceTime(std::chrono::minutes(1));
    lie = ForgedAfter(lie, 3, 3, 2);
    team.Announce(3, lie);
  }
  EXPECT_EQ(team.LeaderAt(kBase), 3u) << "it led once: as a half that went on alone";
  ASSERT_TRUE(team.Set(kBase, 1, 2));
  for (int i = 0; i < 10; ++i) {
    team.AdvanceTime(std::chrono::minutes(1));
    lie = ForgedAfter(lie, 3, 3, 2);
    team.Announce(3, lie);
  }
  for (const AgentId agent : {1, 2, 9}) EXPECT_EQ(team.LeaderAt(agent), 1u) << agent;
}

TEST(SignedRolesTest, AreRateLimitedPerIssuerToTwentyAtOnceAndThenOnePerMinute) {
  SignedTeam team(3);
  const std::uint64_t before = RevisionOf(team.Of(2).term());
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(team.Set(1, 1, i % 2 == 0 ? 3 : 2));
  EXPECT_LE(RevisionOf(team.Of(2).term()), before + 20);
  team.AdvanceTime(std::chrono::minutes(2));
  team.Heal();
  EXPECT_EQ(team.Term(2), team.Term(1)) << "the newest of what waited";
}

TEST(SignedRolesTest, AreRateLimitedAlsoIfTheyArriveAsRecords) {
  SignedTeam team(4);
  ASSERT_TRUE(team.Set(1, 3, 2));  // Rover 3 leads, and later forges assignments.
  proto::RoleAssignment lie = team.Of(4);
  const std::uint64_t before = RevisionOf(lie.term());
  team.Divide({4});
  for (int i = 0; i < 100; ++i) {
    lie = ForgedAfter(lie, 3, 3, i % 2 == 0 ? 1 : 2);
    team.Record(4, lie);
  }
  const std::uint64_t acted_on = RevisionOf(team.Of(4).term()) - before;
  EXPECT_GE(acted_on, 15u);
  EXPECT_LE(acted_on, 20u);
  const int timers = team.announce_timers();
  lie = ForgedAfter(lie, 3, 3, 1);
  team.Record(4, lie);
  EXPECT_EQ(team.announce_timers(), timers) << "a further record does not postpone the announcements";
  team.RunAnnounceTimer(4);
  EXPECT_EQ(RevisionOf(team.Of(4).term()) - before, acted_on) << "there is no room for another change yet";
  team.AdvanceTime(std::chrono::minutes(2));
  team.RunAnnounceTimer(4);
  EXPECT_EQ(team.Of(4).signature(), lie.signature()) << "the newest of what waited";
}

TEST(SignedRolesTest, AreActedOnAfterThePreviousRecordIsStored) {
  SignedTeam team(4);
  const proto::RoleAssignment first = ForgedAfter(team.Of(4), 1, 3, 2);
  const proto::RoleAssignment second = ForgedAfter(first, 3, 2, 3);
  team.Divide({4});
  team.HoldSaving();
  team.Record(4, first);
  team.Record(4, second);
  EXPECT_NE(team.Of(4).signature(), first.signature());
  team.FinishSaving(4);
  EXPECT_EQ(team.Of(4).signature(), second.signature());
}

// Agent 3 has an empty disk. While it waits for the predecessors of one assignment, it receives a newer assignment,
// which it cannot store.
TEST(SignedRolesTest, FromALateChainDoNotReplaceNewerOnesThatCannotBeStored) {
  SignedTeam team(3, /*has_base=*/true);
  ASSERT_TRUE(team.Set(1, 3, 2));
  ASSERT_TRUE(team.Set(2, 1, 2));
  const std::vector<proto::RoleAssignment> chain = team.disk(1);
  ASSERT_TRUE(team.Set(kBase, 2, 1));
  const auto of_base = std::find_if(team.disk(kBase).begin(), team.disk(kBase).end(),
                                    [](const auto& roles) { return roles.term().issuer() == kBase; });
  ASSERT_NE(of_base, team.disk(kBase).end());

  RoleLogic logic(team.OptionsOf(3));
  (void)logic.OnLoaded({}, /*epoch=*/999, 0, {});
  proto::RoleAnnounce announce;
  *announce.mutable_roles() = chain.back();
  const auto asks = logic.OnAnnounce(1, announce);
  ASSERT_TRUE(asks);
  ASSERT_TRUE(asks->question);
  *announce.mutable_roles() = *of_base;
  const auto hears = logic.OnAnnounce(kBase, announce);
  ASSERT_TRUE(hears && hears->save);
  const RoleLogic::Actions acts = logic.OnSaveFailed();
  ASSERT_TRUE(acts.apply);
  EXPECT_EQ(acts.apply->signature(), of_base->signature());

  proto::RoleChainReply reply;
  for (auto roles = chain.rbegin() + 1; roles != chain.rend(); ++roles) *reply.add_chain() = *roles;
  const auto late = logic.OnChainReply(1, reply);
  ASSERT_TRUE(late);
  EXPECT_FALSE(late->save);
  EXPECT_FALSE(late->apply);
}

TEST(SignedRolesTest, IssuedByAnAgentThatLeftStayValidUntilTheBaseStationSupersedesThem) {
  SignedTeam team(4, /*has_base=*/true);
  ASSERT_TRUE(team.Set(1, 1, 3));
  const std::string before = team.Term(3);
  team.Leave(1);
  EXPECT_EQ(team.Term(3), before) << "read back from its disk";
  EXPECT_EQ(team.LeaderAt(3), 1u);
  // Agent 4 has lost its disk. The other agents send it the current assignment and its predecessors, which agent 1
  // issued before it left.
  team.Start(4, {});
  team.Heal();
  EXPECT_EQ(team.Term(4), before);
  ASSERT_FALSE(team.Set(kBase, 1, 2));
  ASSERT_TRUE(team.Set(kBase, 3, 2));
  for (const AgentId agent : {2, 3, 4, 9}) EXPECT_EQ(team.LeaderAt(agent), 3u) << agent;
}

}  // namespace
}  // namespace moondb
