#include "model/role_chain.h"

#include <gtest/gtest.h>

#include "model/term.h"

namespace moondb {
namespace {

using Standing = RoleChain::Standing;

constexpr AgentId kBase = 4;

// Returns options for a team in which rover 1 leads and rover 2 is the designated survivor. Only the base station may
// command.
RoleChain::Options ChainOptions() {
  RoleChain::Options options;
  options.initial.set_leader(1);
  options.initial.set_survivor(2);
  options.may_command = [](AgentId agent) { return agent == kBase; };
  return options;
}

// Returns a successor of `follows`. RoleChain does not verify signatures, so `signature` may be any text that
// distinguishes assignments.
proto::RoleAssignment After(const proto::RoleAssignment& follows, AgentId issuer, AgentId leader, AgentId survivor,
                            const std::string& signature) {
  proto::RoleAssignment roles = RoleChain::Next(follows, /*is_command=*/issuer == kBase);
  roles.mutable_term()->set_issuer(issuer);
  roles.set_leader(leader);
  roles.set_survivor(survivor);
  roles.set_signature(signature);
  return roles;
}

TEST(TermTest, TextShowsEraAndRevision) {
  proto::Term term;
  term.set_number(7);
  EXPECT_EQ(TermText(term), "7");
  term.set_number(TermNumber(2, 7));
  EXPECT_EQ(TermText(term), "2.7");
  EXPECT_EQ(EraOf(term), 2u);
  EXPECT_EQ(RevisionOf(term), 7u);
}

TEST(RoleChainTest, AcceptsDecisionsOfThePreviousLeaderOrSurvivor) {
  RoleChain chain(ChainOptions());
  const proto::RoleAssignment first = After(ChainOptions().initial, 1, 3, 2, "a");
  const proto::RoleAssignment second = After(first, 2, 2, 3, "b");
  EXPECT_EQ(chain.Add(first), Standing::kCounts);
  EXPECT_EQ(chain.Add(second), Standing::kCounts);
  EXPECT_EQ(chain.newest().signature(), "b");
  EXPECT_EQ(TermText(chain.newest().term()), "2");
  EXPECT_TRUE(chain.HasHadRole(3));
  EXPECT_TRUE(chain.HasLedIn(2, second.term()));
  EXPECT_FALSE(chain.HasLedIn(3, second.term()));
  EXPECT_TRUE(chain.HasLedIn(1, ChainOptions().initial.term()));
}

TEST(RoleChainTest, RejectsDecisionsOfOtherAgents) {
  RoleChain chain(ChainOptions());
  EXPECT_EQ(chain.Add(After(ChainOptions().initial, 3, 3, 2, "a")), Standing::kNever);
  proto::RoleAssignment era = RoleChain::Next(ChainOptions().initial, /*is_command=*/true);
  era.mutable_term()->set_issuer(1);
  era.set_leader(1);
  era.set_signature("b");
  EXPECT_EQ(chain.Add(era), Standing::kNever) << "only an agent that may command begins an era";
  // Rover 2 deposes rover 1. Then rover 1 issues a successor, although it has no role any more.
  const proto::RoleAssignment deposed = After(ChainOptions().initial, 2, 2, 3, "c");
  EXPECT_EQ(chain.Add(deposed), Standing::kCounts);
  EXPECT_EQ(chain.Add(After(deposed, 1, 1, 3, "d")), Standing::kNever);
  EXPECT_FALSE(chain.HasLedIn(1, deposed.term()));
}

TEST(RoleChainTest, RejectsATermThatIsNotTheNext) {
  RoleChain chain(ChainOptions());
  proto::RoleAssignment far = After(ChainOptions().initial, 1, 1, 3, "a");
  far.mutable_term()->set_number(1000);
  EXPECT_EQ(chain.Add(far), Standing::kNever);
  proto::RoleAssignment without = After(ChainOptions().initial, 1, 1, 3, "");
  EXPECT_EQ(chain.Add(without), Standing::kNever);
}

TEST(RoleChainTest, ACommandingAgentCanStartAnEraAfterAnUnknownAssignment) {
  RoleChain chain(ChainOptions());
  proto::RoleAssignment unknown = After(ChainOptions().initial, 1, 1, 3, "unknown");
  const proto::RoleAssignment era = After(unknown, kBase, 3, 2, "a");
  EXPECT_EQ(chain.Add(era), Standing::kCounts);
  EXPECT_EQ(TermText(era.term()), "1.0");
  EXPECT_EQ(chain.newest().leader(), 3u);
  proto::RoleAssignment wrong = After(ChainOptions().initial, kBase, 3, 2, "b");
  wrong.mutable_term()->set_number(TermNumber(9, 0));
  EXPECT_EQ(chain.Add(wrong), Standing::kNever) << "it names a wrong era as its predecessor";
}

TEST(RoleChainTest, KeepsTwoBranchesAndTheNewerTermWins) {
  RoleChain chain(ChainOptions());
  proto::RoleAssignment left = After(ChainOptions().initial, 1, 1, 3, "a0");
  const proto::RoleAssignment right = After(ChainOptions().initial, 2, 2, 3, "b0");
  EXPECT_EQ(chain.Add(right), Standing::kCounts);
  EXPECT_EQ(chain.Add(left), Standing::kCounts);
  EXPECT_EQ(chain.newest().signature(), "b0") << "of one number the higher issuer's";
  for (int i = 1; i < 10; ++i) {
    left = After(left, 1, 1, 3, "a" + std::to_string(i));
    EXPECT_EQ(chain.Add(left), Standing::kCounts);
  }
  EXPECT_EQ(chain.newest().signature(), "a9");
  EXPECT_TRUE(chain.HasLedIn(2, right.term())) << "the other branch stays history";
}

TEST(RoleChainTest, KeepsAnAssignmentUntilItsPredecessorArrives) {
  RoleChain chain(ChainOptions());
  const proto::RoleAssignment first = After(ChainOptions().initial, 1, 3, 2, "a");
  const proto::RoleAssignment second = After(first, 3, 3, 1, "b");
  const proto::RoleAssignment third = After(second, 1, 1, 3, "c");
  EXPECT_EQ(chain.Add(third), Standing::kLacksPredecessor);
  EXPECT_EQ(chain.Add(second), Standing::kLacksPredecessor);
  EXPECT_FALSE(chain.HasHadRole(3));
  EXPECT_EQ(chain.Add(first), Standing::kCounts);
  EXPECT_EQ(chain.newest().signature(), "c");
  EXPECT_EQ(chain.Add(third), Standing::kCounts);
}

TEST(RoleChainTest, ReturnsAChainInPagesBackToTheStartOfAnEra) {
  RoleChain chain(ChainOptions());
  proto::RoleAssignment last = After(ChainOptions().initial, kBase, 1, 2, "reign");
  chain.Add(last);
  for (int i = 0; i < 99; ++i) {
    last = After(last, 1, 1, 2, "change" + std::to_string(i));
    ASSERT_EQ(chain.Add(last), Standing::kCounts);
  }
  const auto all = chain.ChainOf(last.signature(), 1 << 20);
  ASSERT_EQ(all.size(), 100u);
  EXPECT_EQ(all.front().signature(), last.signature());
  EXPECT_EQ(all.back().signature(), "reign");
  EXPECT_EQ(chain.ChainOf(last.signature(), 1).size(), 1u) << "a page holds one at least";
  const auto page = chain.ChainOf(last.signature(), 1000);
  EXPECT_GT(page.size(), 5u);
  EXPECT_LT(page.size(), 50u);
  EXPECT_TRUE(chain.ChainOf("unknown", 1000).empty());
}

TEST(RoleChainTest, LimitsAssignmentsPerIssuer) {
  RoleChain chain(ChainOptions());
  proto::RoleAssignment last = ChainOptions().initial;
  for (std::size_t i = 0; i < kAssignmentsOfIssuerMax; ++i) {
    last = After(last, 1, 1, 2, std::to_string(i));
    ASSERT_EQ(chain.Add(last), Standing::kCounts) << i;
  }
  EXPECT_EQ(chain.Add(After(last, 1, 1, 2, "more")), Standing::kNever);
  EXPECT_EQ(chain.Add(After(last, 2, 2, 1, "another's")), Standing::kCounts);
}

TEST(RoleChainTest, CountsAllInATeamWithoutKeys) {
  RoleChain::Options options = ChainOptions();
  options.has_keys = false;
  RoleChain chain(options);
  proto::RoleAssignment any = After(options.initial, 3, 3, 2, "");
  any.mutable_term()->set_number(5);
  EXPECT_EQ(chain.Add(any), Standing::kCounts);
  EXPECT_EQ(chain.newest().leader(), 3u);
}

TEST(RoleChainTest, AnIssuerWithTooManyPendingAssignmentsDisplacesNoOthers) {
  RoleChain chain(ChainOptions());
  const proto::RoleAssignment first = After(ChainOptions().initial, 1, 2, 3, "a");
  const proto::RoleAssignment second = After(first, 2, 3, 2, "b");
  for (std::size_t i = 0; i < kWaitingAssignmentsMax + 10; ++i) {
    proto::RoleAssignment floods = After(ChainOptions().initial, 5, 5, 5, "f" + std::to_string(i));
    floods.set_follows("unknown" + std::to_string(i));
    EXPECT_EQ(chain.Add(floods), Standing::kLacksPredecessor);
  }
  EXPECT_EQ(chain.Add(second), Standing::kLacksPredecessor);
  EXPECT_EQ(chain.Add(first), Standing::kCounts);
  EXPECT_EQ(chain.newest().signature(), "b") << "it waited although another issuer had filled the room";
}

}  // namespace
}  // namespace moondb
