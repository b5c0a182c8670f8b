#include "apps/moonctl/match_list.h"

#include <gmock/gmock.h>

#include <numbers>

#include "proto/types.pb.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

RecordKey NextMatchListKey() {
  static std::uint64_t seq = 0;
  return RecordKey{{1, 1, proto::MAP_MATCH}, ++seq};
}

class MatchListTest : public testing::Test {
 protected:
  MatchListTest() {
    for (const std::uint32_t id : {1, 2}) {
      proto::AgentConfig& agent = *team_.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
    }
  }

  void Add(const proto::Record& record) {
    const RecordKey key = NextMatchListKey();
    ASSERT_TRUE(known_.Add(key, record).has_value());
    held_.Add(key, record);
  }

  void AddNode(const NodeKey& node, double x_m) {
    proto::Record record;
    *record.mutable_pose_graph_node()->mutable_node() = ToProto(node);
    *record.mutable_pose_graph_node()->mutable_map_from_node() = ToProto(Pose::FromPlanar(x_m, 0, 0));
    Add(record);
  }

  // Adds a match of node `index` of rover1 with the same node of rover2.
  void AddMatch(std::uint64_t index, double x_m, std::uint64_t term = 1, std::uint64_t run = 1) {
    proto::Record record;
    proto::MapMatch& match = *record.mutable_map_match();
    *match.mutable_from() = ToProto(NodeKey{1, index});
    *match.mutable_to() = ToProto(NodeKey{2, index});
    *match.mutable_relative_pose()->mutable_from_from_to() = ToProto(Pose::FromPlanar(x_m, 0, std::numbers::pi / 6));
    AddUpperTriangle(Matrix6d::Identity(), *match.mutable_relative_pose()->mutable_covariance());
    match.set_from_timestamp_ns(100);
    match.set_to_timestamp_ns(200);
    match.set_overlap(0.54);
    match.set_matched(0.92);
    match.set_second_best(0.7);
    match.mutable_term()->set_number(term);
    match.set_run(run);
    Add(record);
  }

  void AddVerdict(std::uint64_t index, bool is_inlier, double sigmas) {
    proto::Record record;
    proto::EdgeVerdict& verdict = *record.mutable_edge_verdict();
    *verdict.mutable_from() = ToProto(NodeKey{1, index});
    *verdict.mutable_to() = ToProto(NodeKey{2, index});
    verdict.set_source(std::string(kRegistrationSource));
    verdict.set_is_inlier(is_inlier);
    verdict.set_residual_sigmas(sigmas);
    verdict.mutable_term()->set_number(1);
    verdict.set_run(1);
    Add(record);
  }

  // Returns the index of the nodes of each listed match, in order.
  std::vector<std::uint64_t> Indices() const {
    std::vector<std::uint64_t> indices;
    for (const ListedMatch& match : held_.List(known_)) indices.push_back(match.from.index);
    return indices;
  }

  proto::TeamConfig team_;
  KnownGraph known_;
  MatchList held_;
};

TEST_F(MatchListTest, ListsTheMatchWithTheHighestTermAndRunOfEachPair) {
  AddMatch(5, 3, 2, 1);
  AddMatch(5, 2, 1, 9);
  AddMatch(5, 1, 2, 0);
  AddMatch(4, 7);
  const std::vector<ListedMatch> list = held_.List(known_);
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0].from.index, 4u);
  EXPECT_DOUBLE_EQ(list[1].from_from_to.position_m.x(), 3);
}

TEST_F(MatchListTest, ShowsTheVerdictOfTheLastSolve) {
  for (const std::uint64_t index : {1, 2, 3, 4}) AddMatch(index, 1);
  AddVerdict(2, true, 0.5);
  AddVerdict(3, false, 9.26);
  AddVerdict(4, false, 20);
  EXPECT_THAT(Indices(), ElementsAre(4, 3, 1, 2)) << "rejected ones come first";
  std::vector<std::string> verdicts;
  for (const ListedMatch& match : held_.List(known_)) verdicts.push_back(VerdictText(match));
  EXPECT_THAT(verdicts, ElementsAre("rejected (20.0 sigmas)", "rejected (9.3 sigmas)", "not solved yet", "kept"));
}

TEST_F(MatchListTest, ShowsQuarantinedMatches) {
  AddMatch(1, 1);
  AddMatch(2, 1);
  AddVerdict(1, false, 20);
  proto::Record record;
  *record.mutable_map_quarantine()->mutable_node() = ToProto(NodeKey{1, 1});
  Add(record);
  const std::vector<ListedMatch> list = held_.List(known_);
  EXPECT_EQ(VerdictText(list.at(0)), "quarantined");
  EXPECT_EQ(VerdictText(list.at(1)), "not solved yet");
}

TEST_F(MatchListTest, ShowsOffsetAndCorrectionOfOdometry) {
  AddNode({1, 1}, 10);
  AddNode({2, 1}, 14.5);
  AddMatch(1, 4);
  AddMatch(2, 4);  // Its nodes are missing.
  const std::string text = MatchesText(team_, held_.List(known_), 50);
  EXPECT_THAT(text, HasSubstr("rover1:1  rover2:1  4.00 m 30.0 deg  0.50 m 30.0 deg     0.92     0.54         0.70  "));
  EXPECT_THAT(text, HasSubstr("rover1:2  rover2:2  4.00 m 30.0 deg  -  "));
}

TEST_F(MatchListTest, CountsTheRowsThatItLeavesOut) {
  EXPECT_EQ(MatchesText(team_, {}, 50), "this agent holds no map match\n");
  for (const std::uint64_t index : {1, 2, 3}) AddMatch(index, 1);
  const std::vector<ListedMatch> list = held_.List(known_);
  EXPECT_THAT(MatchesText(team_, list, 2), HasSubstr("and 1 more matches; --all lists all\n"));
  EXPECT_THAT(MatchesText(team_, list, 2), Not(HasSubstr("rover1:3")));
  EXPECT_THAT(MatchesText(team_, list, 3), Not(HasSubstr("more")));
  JsonWriter json;
  WriteMatches(list, json);
  EXPECT_THAT(json.text(), HasSubstr("\"verdict\":\"not solved yet\""));
  EXPECT_THAT(json.text(), HasSubstr("\"correction_m\":null"));
}

TEST(RegistrationTextTest, CountsResultsAndGivesTheReasonWhyNothingIsMatched) {
  proto::RegistrationReply state;
  state.set_map_count(8);
  state.set_pass_count(2);
  state.set_stored_count(7);
  state.set_left_count(3);
  state.set_seconds(1.25);
  for (const auto& [verdict, count] : {std::pair("accepted", 9), std::pair("few points", 4)}) {
    state.add_counts()->set_verdict(verdict);
    state.mutable_counts()->rbegin()->set_count(count);
  }
  EXPECT_EQ(
      RegistrationText({}, state),
      "matched 13 pairs of 8 maps in 2 passes: 9 accepted, 4 few points; 7 matches stored; 3 pairs left; 1.2 s\n");
  proto::RegistrationReply none;
  none.set_other_map_count(3);
  none.set_unposed_map_count(1);
  none.set_is_due(true);
  none.set_removed_map_match_count(1);
  none.set_text("the leader has not solved the pose graph yet");
  EXPECT_EQ(RegistrationText({}, none),
            "matched 0 pairs of 0 maps in 0 passes; 0 matches stored; 0 pairs left; 0.0 s; 1 map had no optimized pose "
            "yet; 2 maps "
            "quarantined, or newer than the last pass; the next pass will begin; the leader has not solved the pose "
            "graph yet\n1 stored match of maps that were removed since: the solver still uses them\n");
  EXPECT_EQ(MatchingLeftText(none), "the matching of maps will begin");
  EXPECT_EQ(MatchingLeftText(state), "3 pairs of maps left to match");
  EXPECT_EQ(MatchingLeftText({}), "");
  none.set_other_map_count(0);
  EXPECT_EQ(MatchingLeftText(none), "") << "there are no maps";
}

TEST(RegistrationTextTest, SaysHowFarTheSearchForStartsCame) {
  proto::TeamConfig team;
  for (const AgentId id : {1, 2, 3}) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(id);
    agent.set_name("rover" + std::to_string(id));
  }
  proto::RegistrationReply state;
  proto::SearchedStart& found = *state.add_starts();
  found.set_agent_id(1);
  found.set_other_agent_id(2);
  found.set_is_accepted(true);
  found.set_evidence(160.66);
  found.set_rival(8.9);
  found.set_matched(0.92);
  found.set_contradicted(0.04);
  proto::SearchedStart& lost = *state.add_starts();
  lost.set_agent_id(1);
  lost.set_other_agent_id(3);
  lost.set_evidence(5.6);
  lost.set_text("too little looks alike");
  lost.set_remedy("drive one of them through places that the other has seen");
  EXPECT_THAT(
      RegistrationText(team, state),
      HasSubstr(
          "found the pose of rover2 relative to rover1: evidence 160.7, best alternative 8.9, matched 92 %, "
          "contradicted 4 %\n"
          "did not find the pose of rover3 relative to rover1: too little looks alike (evidence 5.6, best alternative "
          "0.0, "
          "matched 0 %, contradicted 0 %); drive one of them through places that the other has seen, or give one of "
          "them a start\n"));
}

TEST(RegistrationTextTest, NamesTheAgentsWhosePairsWereLeftOut) {
  proto::TeamConfig team;
  for (const AgentId id : {1u, 3u}) {
    team.add_agents()->set_id(id);
    team.mutable_agents()->rbegin()->set_name("rover" + std::to_string(id));
  }
  proto::RegistrationReply state;
  for (const auto& [first, second] : {std::pair(1u, 3u), std::pair(3u, 3u)}) {
    proto::LeftOutPairs& pairs = *state.add_left_out();
    pairs.set_agent_id(first);
    pairs.set_other_agent_id(second);
    pairs.set_count(900);
  }
  EXPECT_THAT(RegistrationText(team, state),
              HasSubstr("excluded 900 pairs of maps of rover1 and rover3 from the last pass, because they exceed their "
                        "share of a pass\nexcluded 900 pairs of maps of rover3 from the last pass"));
}

}  // namespace
}  // namespace moondb
