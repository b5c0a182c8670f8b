#include "actors/storage/peer_authority.h"

#include <gtest/gtest.h>

#include "model/have_set.h"
#include "model/term.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"
#include "tests/sample_record.h"

namespace moondb {
namespace {

// Returns the options of the store of `self`. According to the team file, agent 1 leads, agent 2 is the survivor, agent
// 9 is the base station, and agent 3 is a rover without a role. The signature "signed" is valid.
RecordStore::Options OptionsWithKeys(AgentId self = 1) {
  RecordStore::Options options = StoreOptionsOf(self);
  options.policies[proto::ROLE_ASSIGNMENT] = proto::POLICY_ALL;
  options.authority.base = 9;
  options.authority.roles.has_keys = true;
  options.authority.roles.initial.set_leader(1);
  options.authority.roles.initial.set_survivor(2);
  options.authority.roles.may_command = [](AgentId agent) { return agent == 9; };
  options.authority.is_signed = [](const proto::RoleAssignment& roles) {
    return roles.signature().starts_with("signed");
  };
  options.authority.is_record_signed = [](const RecordKey& key, const proto::Record& record) {
    return record.map_quarantine().signature() == "signed " + ToString(key);
  };
  options.sign = [](const RecordKey& key, const proto::Record&) { return "signed " + ToString(key); };
  return options;
}

proto::RoleAssignment AssignmentOf(AgentId issuer, AgentId leader, AgentId survivor, const std::string& signature) {
  proto::RoleAssignment roles;
  roles.mutable_term()->set_number(issuer == 9 ? TermNumber(1, 0) : 1);
  roles.mutable_term()->set_issuer(issuer);
  roles.set_leader(leader);
  roles.set_survivor(survivor);
  roles.set_signature(signature);
  return roles;
}

proto::Record RecordOf(const proto::RoleAssignment& roles) {
  proto::Record record;
  *record.mutable_role_assignment() = roles;
  return record;
}

proto::StoredRecord Node(AgentId origin, std::uint64_t seq, std::uint64_t epoch = 7) {
  return Packed({{origin, epoch, proto::POSE_GRAPH_NODE}, seq}, NodeRecord(origin, seq));
}

proto::StoreReply StoreFrom(RecordStore& store, AgentId sender, const std::vector<proto::StoredRecord>& records) {
  proto::StoreRequest request;
  request.set_sender(sender);
  for (const proto::StoredRecord& record : records) *request.add_records() = record;
  return store.Store(request).reply;
}

std::map<std::pair<AgentId, proto::RefusalCause>, double> RefusedBy(const RecordStore& store) {
  proto::AgentStatus status;
  store.DescribeRefused(status);
  std::map<std::pair<AgentId, proto::RefusalCause>, double> refused;
  for (const auto& entry : status.refused()) refused[{entry.agent_id(), entry.cause()}] += entry.count();
  return refused;
}

TEST(PeerAuthorityTest, AcceptsRecordsFromTheirOriginTheBaseStationAndAgentsWithARole) {
  auto store = OpenStore(OptionsWithKeys());
  EXPECT_EQ(StoreFrom(*store, 3, {Node(3, 1)}).stored_count(), 1u);
  EXPECT_EQ(StoreFrom(*store, 9, {Node(3, 2)}).stored_count(), 1u);
  EXPECT_EQ(StoreFrom(*store, 2, {Node(3, 3)}).stored_count(), 1u);
  const proto::StoreReply refused = StoreFrom(*store, 3, {Node(2, 1), Node(3, 4)});
  EXPECT_EQ(refused.stored_count(), 1u) << "what is its own is taken all the same";
  EXPECT_EQ(refused.rejected_count(), 1u);
  EXPECT_EQ(refused.covered().streams_size(), 1) << "what was refused is not acknowledged";
  EXPECT_EQ((RefusedBy(*store)[{3, proto::REFUSAL_CAUSE_ORIGIN}]), 1);
}

TEST(PeerAuthorityTest, AcceptsDropsOnlyFromTheOriginTheBaseStationAndAgentsWithARole) {
  auto store = OpenStore(OptionsWithKeys());
  const auto power = [](std::uint64_t seq) {
    proto::Record record;
    record.mutable_power()->set_battery_ratio(0.5);
    return Packed({{2, 7, proto::POWER}, seq}, record);
  };
  StoreFrom(*store, 2, {power(1)});
  StoreFrom(*store, 2, {power(5)});
  proto::StoreRequest request;
  proto::StreamHave& dropped = *request.add_dropped();
  dropped.set_origin_agent(2);
  dropped.set_epoch(7);
  dropped.set_data_type(proto::POWER);
  dropped.add_dropped()->set_first(2);
  dropped.mutable_dropped(0)->set_last(4);
  request.set_sender(3);
  EXPECT_EQ(store->Store(request).reply.rejected_count(), 1u);
  request.set_sender(2);
  EXPECT_EQ(store->Store(request).reply.rejected_count(), 0u);
}

TEST(PeerAuthorityTest, AcceptsSignedAssignmentsFromAnyAgent) {
  auto store = OpenStore(OptionsWithKeys());
  const RecordKey key{{2, 7, proto::ROLE_ASSIGNMENT}, 1};
  EXPECT_EQ(StoreFrom(*store, 3, {Packed(key, RecordOf(AssignmentOf(2, 3, 2, "forged")))}).stored_count(), 0u);
  EXPECT_EQ(StoreFrom(*store, 3, {Packed(key, RecordOf(AssignmentOf(2, 3, 2, "signed")))}).stored_count(), 1u);
}

// Rover 3 led under an assignment of which agent 1 learns only from rover 3.
TEST(PeerAuthorityTest, AcceptsRecordsFromAFormerLeaderOnceItsAssignmentArrived) {
  auto store = OpenStore(OptionsWithKeys());
  const proto::StoredRecord assignment =
      Packed({{3, 7, proto::ROLE_ASSIGNMENT}, 1}, RecordOf(AssignmentOf(2, 3, 2, "signed")));
  EXPECT_EQ(StoreFrom(*store, 3, {Node(2, 1)}).stored_count(), 0u);
  EXPECT_EQ(StoreFrom(*store, 3, {Node(2, 1), assignment}).stored_count(), 2u) << "in whatever order they come";
  EXPECT_EQ(StoreFrom(*store, 3, {Node(2, 2)}).stored_count(), 1u);
}

TEST(PeerAuthorityTest, RejectsAnAssignmentThatARoverWithoutARoleSignsForItself) {
  auto store = OpenStore(OptionsWithKeys());
  const proto::StoredRecord assignment =
      Packed({{3, 7, proto::ROLE_ASSIGNMENT}, 1}, RecordOf(AssignmentOf(3, 3, 2, "signed")));
  EXPECT_EQ(StoreFrom(*store, 3, {assignment}).stored_count(), 1u) << "it says so of itself";
  EXPECT_EQ(StoreFrom(*store, 3, {Node(2, 1)}).stored_count(), 0u);
}

TEST(PeerAuthorityTest, KnowsFormerRolesAfterARestart) {
  TemporaryFolder folder;
  RecordStore::Options options = OptionsWithKeys();
  options.path = folder.File("store.db");
  {
    auto store = OpenStore(options);
    proto::SaveRolesRequest request;
    *request.mutable_roles() = AssignmentOf(2, 3, 2, "signed");
    ASSERT_TRUE(store->SaveRoles(request));
  }
  EXPECT_EQ(StoreFrom(*OpenStore(options), 3, {Node(2, 1)}).stored_count(), 1u);
}

TEST(PeerAuthorityTest, RecordsItsOwnRoleAssignmentAndItsPredecessorsOnce) {
  auto store = OpenStore(OptionsWithKeys());
  proto::SaveRolesRequest request;
  *request.add_chain() = AssignmentOf(2, 3, 2, "signed a");
  proto::RoleAssignment last = AssignmentOf(3, 1, 3, "signed b");
  last.mutable_term()->set_number(2);
  last.set_follows("signed a");
  *request.mutable_roles() = last;
  const auto saved = store->SaveRoles(request);
  ASSERT_TRUE(saved) << ToString(saved.error());
  EXPECT_NE(saved->last_row_id(), 0u);
  EXPECT_EQ(Contents(*store).size(), 2u);
  request.clear_chain();
  ASSERT_TRUE(store->SaveRoles(request)) << "storage is asked once more when it is silent";
  EXPECT_EQ(Contents(*store).size(), 2u);
  *request.mutable_roles() = AssignmentOf(9, 2, 3, "signed c");
  ASSERT_TRUE(store->SaveRoles(request));
  EXPECT_EQ(Contents(*store).size(), 2u) << "this agent has no role there";
}

TEST(PeerAuthorityTest, OffersOtherAgentsRecordsOnlyToPeersThatAcceptThem) {
  proto::MissingRequest request;
  auto plain = OpenStore(OptionsWithKeys(3));
  StoreFrom(*plain, 1,
            {Node(2, 1), Packed({{2, 7, proto::ROLE_ASSIGNMENT}, 1}, RecordOf(AssignmentOf(2, 1, 2, "signed")))});
  InsertOne(*plain, NodeRecord(3, 1));
  EXPECT_EQ(plain->GetMissing(request)->records_size(), 2) << "its own, and the assignment";
  auto leader = OpenStore(OptionsWithKeys(1));
  StoreFrom(*leader, 2, {Node(2, 1)});
  EXPECT_EQ(leader->GetMissing(request)->records_size(), 1);
}

TEST(PeerAuthorityTest, BelievesClaimsAboutItsOwnEpochsOnlyFromAgentsWithARoleAndReportsOthers) {
  auto store = OpenStore(OptionsWithKeys());
  InsertOne(*store, NodeRecord(1, 1));
  const std::uint64_t present = store->GetHave().epoch();
  proto::EpochReport report;
  report.add_epochs(present + (1ull << 50));
  ASSERT_TRUE(store->ObserveEpochReport(3, report));
  InsertOne(*store, NodeRecord(1, 2));
  EXPECT_EQ(store->GetHave().epoch(), present) << "a plain rover's word moves nothing";
  EXPECT_EQ((RefusedBy(*store)[{3, proto::REFUSAL_CAUSE_OWN_EPOCH}]), 1) << "but people are to hear of it";
  ASSERT_TRUE(store->ObserveEpochReport(2, report));
  InsertOne(*store, NodeRecord(1, 3));
  EXPECT_GT(store->GetHave().epoch(), present);
}

TEST(PeerAuthorityTest, RepeatedClaimsCannotUseUpItsOwnEpochs) {
  auto store = OpenStore(OptionsWithKeys());
  InsertOne(*store, NodeRecord(1, 1));
  std::uint64_t claimed = store->GetHave().epoch();
  for (int i = 0; i < 8; ++i) {
    claimed += kOwnEpochJumpMax / 2;
    proto::EpochReport report;
    report.add_epochs(claimed);
    ASSERT_TRUE(store->ObserveEpochReport(2, report));
  }
  EXPECT_LE(store->GetHave().epoch(), 3 * kOwnEpochJumpMax);
  InsertOne(*store, NodeRecord(1, 2));
  EXPECT_LT(store->GetHave().epoch(), 2 * kOwnEpochJumpMax);
}

TEST(PeerAuthorityTest, ReportsAPeerThatClaimsRecordsThatThisAgentNeverStored) {
  auto store = OpenStore(OptionsWithKeys());
  InsertOne(*store, NodeRecord(1, 1));
  proto::MissingRequest request;
  request.set_destination(3);
  proto::StreamHave& claimed = *request.mutable_destination_have()->add_streams();
  claimed.set_origin_agent(1);
  claimed.set_epoch(store->GetHave().epoch());
  claimed.set_data_type(proto::POSE_GRAPH_NODE);
  claimed.add_held()->set_first(1);
  claimed.mutable_held(0)->set_last(1);
  ASSERT_TRUE(store->GetMissing(request));
  EXPECT_TRUE(RefusedBy(*store).empty());
  claimed.mutable_held(0)->set_last(2);
  ASSERT_TRUE(store->GetMissing(request));
  EXPECT_EQ((RefusedBy(*store)[{3, proto::REFUSAL_CAUSE_OWN_EPOCH}]), 1);
  InsertOne(*store, NodeRecord(1, 2));
  EXPECT_TRUE(RefusedBy(*store).empty()) << "this disk has it by now";
}

TEST(PeerAuthorityTest, WithdrawsARefusalOnceTheSendersAssignmentArrives) {
  auto store = OpenStore(OptionsWithKeys());
  EXPECT_EQ(StoreFrom(*store, 3, {Node(2, 1)}).stored_count(), 0u);
  EXPECT_EQ((RefusedBy(*store)[{3, proto::REFUSAL_CAUSE_ORIGIN}]), 1);
  const proto::RoleAssignment roles = AssignmentOf(9, 3, 2, "signed by 9");
  const proto::StoredRecord assignment = Packed({{9, 7, proto::ROLE_ASSIGNMENT}, 1}, RecordOf(roles));
  EXPECT_EQ(StoreFrom(*store, 3, {assignment, Node(2, 1)}).stored_count(), 2u);
  EXPECT_TRUE(RefusedBy(*store).empty());
}

TEST(PeerAuthorityTest, ReportsAClaimedOwnEpochUntilItsRecordsArrive) {
  auto store = OpenStore(OptionsWithKeys());
  proto::EpochReport report;
  report.add_epochs(7);
  ASSERT_TRUE(store->ObserveEpochReport(2, report));
  EXPECT_EQ((RefusedBy(*store)[{2, proto::REFUSAL_CAUSE_OWN_EPOCH}]), 1);
  ASSERT_TRUE(store->ObserveEpochReport(2, report));
  EXPECT_EQ((RefusedBy(*store)[{2, proto::REFUSAL_CAUSE_OWN_EPOCH}]), 1) << "known by now, and still not here";
  EXPECT_EQ(StoreFrom(*store, 2, {Node(1, 1, 7)}).stored_count(), 1u);
  EXPECT_TRUE(RefusedBy(*store).empty());
}

// Returns a note that agent 2 acknowledged agent 1's nodes with seqs 1 to `last` in `epoch`.
proto::PeerHave NoteOfNodes(std::uint64_t epoch, std::uint64_t last) {
  proto::PeerHave note;
  note.set_peer(2);
  proto::StreamHave& stream = *note.mutable_acknowledged()->add_streams();
  stream.set_origin_agent(1);
  stream.set_epoch(epoch);
  stream.set_data_type(proto::POSE_GRAPH_NODE);
  proto::Interval& held = *stream.add_held();
  held.set_first(1);
  held.set_last(last);
  return note;
}

TEST(PeerAuthorityTest, ReportsAClaimedOwnEpochThoughThePeerAcknowledgesNewRecordsOrReportsAnotherEpoch) {
  auto store = OpenStore(OptionsWithKeys());
  const auto is_said = [&store] { return RefusedBy(*store).contains({2, proto::REFUSAL_CAUSE_OWN_EPOCH}); };
  proto::EpochReport report;
  report.add_epochs(7);
  ASSERT_TRUE(store->ObserveEpochReport(2, report));
  InsertOne(*store, NodeRecord(1, 1));
  proto::PeerHave news = NoteOfNodes(store->GetHave().epoch(), 1);
  news.set_is_difference(true);
  ASSERT_TRUE(store->ObservePeerHave(news));
  EXPECT_TRUE(is_said()) << "after a report, and an acknowledgment of what is new";

  ASSERT_TRUE(store->ObservePeerHave(NoteOfNodes(7, 2)));
  ASSERT_TRUE(store->ObservePeerHave(news));
  EXPECT_TRUE(is_said()) << "after an answer, and an acknowledgment of what is new";
  EXPECT_EQ(StoreFrom(*store, 2, {Node(1, 1, 7)}).stored_count(), 1u);
  EXPECT_TRUE(is_said()) << "the second one is still not here";

  proto::PeerHave of_another = NoteOfNodes(store->GetHave().epoch(), 1);
  of_another.add_origin_agents(3);
  ASSERT_TRUE(store->ObservePeerHave(of_another));
  EXPECT_TRUE(is_said()) << "the peer was asked about another agent's records";

  report.set_epochs(0, 9);
  ASSERT_TRUE(store->ObserveEpochReport(2, report));
  EXPECT_EQ(StoreFrom(*store, 2, {Node(1, 1, 9)}).stored_count(), 1u);
  EXPECT_TRUE(is_said()) << "after a report of another epoch, which came home";
  EXPECT_EQ(StoreFrom(*store, 2, {Node(1, 2, 7)}).stored_count(), 1u);
  EXPECT_FALSE(is_said());
}

TEST(PeerAuthorityTest, StopsReportingAClaimThatThePeerWithdraws) {
  auto store = OpenStore(OptionsWithKeys());
  ASSERT_TRUE(store->ObservePeerHave(NoteOfNodes(7, 2)));
  EXPECT_EQ((RefusedBy(*store)[{2, proto::REFUSAL_CAUSE_OWN_EPOCH}]), 1);
  proto::PeerHave closed;
  closed.set_peer(2);
  closed.set_is_session_closed(true);
  ASSERT_TRUE(store->ObservePeerHave(closed));
  EXPECT_EQ((RefusedBy(*store)[{2, proto::REFUSAL_CAUSE_OWN_EPOCH}]), 1) << "that says nothing of what it has";
  proto::PeerHave nothing;
  nothing.set_peer(2);
  nothing.add_origin_agents(1);
  nothing.mutable_acknowledged();
  ASSERT_TRUE(store->ObservePeerHave(nothing));
  EXPECT_TRUE(RefusedBy(*store).empty()) << "the peer's own disk was lost";
}

proto::Record QuarantineRecord(AgentId agent = 2) {
  proto::Record record;
  record.mutable_map_quarantine()->set_agent_id(agent);
  record.mutable_map_quarantine()->set_to_ns(9);
  return record;
}

TEST(PeerAuthorityTest, AcceptsAQuarantineFromAnyAgentIfItsOriginSignedIt) {
  auto store = OpenStore(OptionsWithKeys());
  const RecordKey key{{2, 7, proto::MAP_QUARANTINE}, 1};
  proto::Record record = QuarantineRecord();
  EXPECT_EQ(StoreFrom(*store, 3, {Packed(key, record)}).stored_count(), 0u);
  record.mutable_map_quarantine()->set_signature("signed " + ToString(key));
  RecordKey next = key;
  ++next.seq;
  EXPECT_EQ(StoreFrom(*store, 3, {Packed(next, record)}).stored_count(), 0u) << "it is another record's";
  EXPECT_EQ((RefusedBy(*store)[{3, proto::REFUSAL_CAUSE_ORIGIN}]), 2);
  EXPECT_EQ(StoreFrom(*store, 3, {Packed(key, record)}).stored_count(), 1u);
}

TEST(PeerAuthorityTest, SignsItsOwnQuarantinesAndForwardsThoseOfOthers) {
  RecordStore::Options options = OptionsWithKeys(3);
  options.policies[proto::MAP_QUARANTINE] = proto::POLICY_ALL;
  auto store = OpenStore(options);
  proto::InsertRequest forged;
  *forged.add_records() = QuarantineRecord(3);
  forged.mutable_records(0)->mutable_map_quarantine()->set_signature("signed");
  EXPECT_EQ(store->Insert(forged).reply.error().field(), "records[0].map_quarantine.signature");
  const RecordKey own = FromProto(InsertOne(*store, QuarantineRecord(3)));
  const RecordKey others{{2, 7, proto::MAP_QUARANTINE}, 1};
  proto::Record record = QuarantineRecord();
  record.mutable_map_quarantine()->set_signature("signed " + ToString(others));
  EXPECT_EQ(StoreFrom(*store, 2, {Packed(others, record), Node(2, 1)}).stored_count(), 2u);

  proto::MissingRequest request;
  request.set_destination(1);
  const auto missing = store->GetMissing(request);
  ASSERT_TRUE(missing);
  ASSERT_EQ(missing->records_size(), 2) << "a plain rover brings no nodes of another's";
  for (const proto::StoredRecord& offered : missing->records()) {
    const RecordKey key = FromProto(offered.key());
    EXPECT_TRUE(key == own || key == others) << ToString(key);
    proto::Record content;
    ASSERT_TRUE(content.ParseFromString(offered.content()));
    EXPECT_EQ(content.map_quarantine().signature(), "signed " + ToString(key));
  }
}

TEST(PeerAuthorityTest, RefusesOwnPriorsOfOthersUnlessItMayCommand) {
  const auto prior_of = [](AgentId agent) {
    proto::InsertRequest request;
    *request.add_records() = SampleRecord(proto::POSE_PRIOR, agent);
    return request;
  };
  auto rover = OpenStore(OptionsWithKeys(3));
  EXPECT_FALSE(IsError(rover->Insert(prior_of(3)).reply.error()));
  const proto::InsertReply refused = rover->Insert(prior_of(2)).reply;
  EXPECT_EQ(refused.error().code(), proto::ERROR_CODE_REFUSED);
  EXPECT_EQ(refused.error().field(), "records[0].pose_prior.node.agent_id");
  auto base = OpenStore(OptionsWithKeys(9));
  EXPECT_FALSE(IsError(base->Insert(prior_of(2)).reply.error()));
}

TEST(PeerAuthorityTest, GivesItsOwnQuarantinesTheNewestTerm) {
  auto store = OpenStore(OptionsWithKeys());
  const auto term_of_next = [&store] {
    const RecordKey key = FromProto(InsertOne(*store, QuarantineRecord(2)));
    proto::ReadRequest request;
    request.add_data_types(proto::MAP_QUARANTINE);
    request.set_records_max(10);
    const Result<proto::ReadReply> read = store->Read(request);
    proto::Record content;
    for (const proto::StoredRecord& record : read->records()) {
      if (FromProto(record.key()) != key) continue;
      EXPECT_TRUE(content.ParseFromString(record.content()));
    }
    return content.map_quarantine().term();
  };
  EXPECT_EQ(term_of_next().number(), 0u);
  const proto::RoleAssignment second = AssignmentOf(/*issuer=*/9, /*leader=*/1, /*survivor=*/3, "signed second");
  EXPECT_EQ(StoreFrom(*store, 9, {Packed({{9, 7, proto::ROLE_ASSIGNMENT}, 1}, RecordOf(second))}).stored_count(), 1u);
  EXPECT_EQ(OrderOf(term_of_next()), OrderOf(second.term()));
  proto::InsertRequest dated;
  *dated.add_records() = QuarantineRecord(2);
  *dated.mutable_records(0)->mutable_map_quarantine()->mutable_term() = second.term();
  EXPECT_EQ(store->Insert(dated).reply.error().field(), "records[0].map_quarantine.term");
}

TEST(PeerAuthorityTest, ARoverWithoutARoleRefusesQuarantinesOfOtherAgentsMaps) {
  auto store = OpenStore(OptionsWithKeys(3));
  proto::InsertRequest request;
  *request.add_records() = QuarantineRecord(2);
  EXPECT_EQ(store->Insert(request).reply.error().code(), proto::ERROR_CODE_REFUSED);
  EXPECT_EQ(store->Insert(request).reply.error().field(), "records[0].map_quarantine.agent_id");
  request.mutable_records(0)->mutable_map_quarantine()->set_agent_id(3);
  EXPECT_FALSE(IsError(store->Insert(request).reply.error()));
  proto::MapQuarantine& lift = *request.mutable_records(0)->mutable_map_quarantine();
  lift.Clear();
  *lift.mutable_lifts() = ToProto(RecordKey{{1, 7, proto::MAP_QUARANTINE}, 1});
  EXPECT_EQ(store->Insert(request).reply.error().field(), "records[0].map_quarantine.lifts");
  lift.mutable_lifts()->set_origin_agent(3);
  EXPECT_FALSE(IsError(store->Insert(request).reply.error()));
}

// The record can never be valid. The store acknowledges the record, so the sender does not send it again. The store's
// own have-set does not list the record.
TEST(PeerAuthorityTest, AcknowledgesButDoesNotStoreARecordThatItsOriginMayNotMake) {
  auto store = OpenStore(OptionsWithKeys());
  const RecordKey key{{3, 7, proto::POSE_GRAPH_EDGE}, 5};
  const proto::StoreReply reply = StoreFrom(*store, 3, {Packed(key, RangeRecord(NodeKey{1, 1}, NodeKey{2, 1}, 3))});
  EXPECT_EQ(reply.stored_count(), 0u);
  EXPECT_EQ(reply.rejected_count(), 1u);
  const Result<HaveSet> covered = FromProto(reply.covered());
  ASSERT_TRUE(covered);
  EXPECT_TRUE(covered->Get(key.stream).held.Contains(key.seq)) << "settled for the session";
  const Result<HaveSet> have = FromProto(store->GetHave().have());
  ASSERT_TRUE(have);
  EXPECT_TRUE(have->Get(key.stream).Covered().is_empty()) << "and not held";
  EXPECT_EQ((RefusedBy(*store)[{3, proto::REFUSAL_CAUSE_STATEMENT}]), 1);
  const RecordKey own{{3, 7, proto::POSE_GRAPH_EDGE}, 6};
  EXPECT_EQ(StoreFrom(*store, 3, {Packed(own, RangeRecord(NodeKey{3, 1}, NodeKey{2, 1}, 3))}).stored_count(), 1u);
}

TEST(PeerAuthorityTest, ReportsOriginsWhoseRecordsReadersLeaveOut) {
  auto store = OpenStore(OptionsWithKeys());
  proto::LeftOutReport report;
  (*report.mutable_without_role())[3] = 4;
  store->AddExcluded("merge", report);
  (*report.mutable_without_role())[3] = 7;
  store->AddExcluded("pgo", report);
  EXPECT_EQ((RefusedBy(*store)[{3, proto::REFUSAL_CAUSE_UNCOUNTED}]), 7) << "both may read the same records";
  (*report.mutable_without_room())[2] = 5;
  store->AddExcluded("pgo", report);
  EXPECT_EQ((RefusedBy(*store)[{2, proto::REFUSAL_CAUSE_NO_ROOM}]), 5);
  store->AddExcluded("pgo", {});
  store->AddExcluded("merge", {});
  EXPECT_TRUE(RefusedBy(*store).empty());
}

// Returns a ledger with this number of streams of each origin.
HaveLedger LedgerOf(const std::map<AgentId, std::uint64_t>& streams) {
  HaveLedger ledger;
  for (const auto& [origin, count] : streams) {
    for (std::uint64_t epoch = 1; epoch <= count; ++epoch) ledger.AddHeld({origin, epoch, proto::POWER}, 1);
  }
  return ledger;
}

TEST(PeerAuthorityTest, ReservesHalfOfTheStreamsInEqualPartsAndGivesTheRestFirstComeFirstServed) {
  PeerAuthority::Options options;
  options.team = {1, 2, 3, 9};
  PeerAuthority authority(options);
  constexpr std::uint64_t kPart = kHaveStreamsMax / 8;
  const StreamKey next{2, 1'000'000, proto::POWER};
  EXPECT_TRUE(authority.CheckRoom(2, next, LedgerOf({{2, kPart + kHaveStreamsMax / 2 - 1}})));
  const HaveLedger full = LedgerOf({{2, kPart + kHaveStreamsMax / 2}, {3, 7}});
  EXPECT_FALSE(authority.CheckRoom(2, next, full)) << "all that nobody else has is used up";
  EXPECT_TRUE(authority.CheckRoom(2, {2, 1, proto::POWER}, full)) << "a stream that is there goes on";
  EXPECT_TRUE(authority.CheckRoom(3, {3, 1'000'000, proto::POWER}, full)) << "another's part is kept for it";
  const HaveLedger other = LedgerOf({{2, kPart + kHaveStreamsMax / 2}, {3, kPart}});
  EXPECT_FALSE(authority.CheckRoom(3, {3, 1'000'000, proto::POWER}, other));
}

TEST(PeerAuthorityTest, ReservesHalfOfTheDiskInEqualPartsForOtherAgents) {
  PeerAuthority::Options options;
  options.self = 1;
  options.team = {1, 2, 3, 9};
  PeerAuthority authority(options);
  // 8,000 bytes: 1,000 are reserved for each of the four agents, and 4,000 are shared.
  constexpr std::uint64_t kRoom = 8000;
  EXPECT_TRUE(authority.CheckDiskRoom(2, {{2, 4999}}, kRoom));
  EXPECT_FALSE(authority.CheckDiskRoom(2, {{2, 5000}}, kRoom));
  EXPECT_TRUE(authority.CheckDiskRoom(3, {{2, 5000}, {3, 999}}, kRoom)) << "another's part is kept for it";
  EXPECT_FALSE(authority.CheckDiskRoom(3, {{2, 5000}, {3, 1000}}, kRoom));
  EXPECT_TRUE(authority.CheckDiskRoom(1, {{1, 7000}, {2, 5000}}, kRoom)) << "its own records are not limited";
  EXPECT_TRUE(authority.CheckDiskRoom(2, {{1, 7000}, {2, 4999}}, kRoom)) << "and take no shared room";
}

// Agent 1's store has room for 2 MB. Fill stores nodes of rover 3 until the store refuses some of them.
class DiskRoomTest : public testing::Test {
 protected:
  void SetUp() override { Open(); }

  void Open() {
    store_.reset();
    RecordStore::Options options = OptionsWithKeys();
    options.path = folder_.File("store.db");
    options.bytes_max = 2'000'000;
    store_ = OpenStore(options);
  }

  proto::StoreReply Fill() {
    while (true) {
      std::vector<proto::StoredRecord> nodes;
      for (int i = 0; i < 500; ++i) nodes.push_back(Node(3, ++last_seq_));
      const proto::StoreReply reply = StoreFrom(*store_, 3, nodes);
      EXPECT_FALSE(IsError(reply.error())) << reply.error().text();
      if (reply.rejected_count() > 0 || IsError(reply.error()) || last_seq_ > 50'000) return reply;
    }
  }

  TemporaryFolder folder_;
  std::unique_ptr<RecordStore> store_;
  std::uint64_t last_seq_ = 0;
};

TEST_F(DiskRoomTest, RefusesAndReportsAnOriginThatUsesMoreThanItsShare) {
  const proto::StoreReply refused = Fill();
  EXPECT_GT(refused.rejected_count(), 0u);
  EXPECT_EQ((RefusedBy(*store_)[{3, proto::REFUSAL_CAUSE_DISK_ROOM}]), refused.rejected_count());
  const Result<HaveSet> covered = FromProto(refused.covered());
  ASSERT_TRUE(covered);
  EXPECT_FALSE(covered->Get({3, 7, proto::POSE_GRAPH_NODE}).Covered().Contains(last_seq_)) << "it is not acknowledged";
  for (std::uint64_t seq = 1; seq <= 1000; ++seq) {
    ASSERT_EQ(StoreFrom(*store_, 2, {Node(2, seq)}).stored_count(), 1u) << "another agent has its part";
  }
  EXPECT_FALSE(IsError(store_
                           ->Insert([] {
                             proto::InsertRequest request;
                             *request.add_records() = NodeRecord(1, 1);
                             return request;
                           }())
                           .reply.error()));
}

TEST_F(DiskRoomTest, AcceptsRecordsAgainOnceSomeWerePruned) {
  Fill();
  proto::PruneRequest request;
  const Result<HaveSet> have = FromProto(store_->GetHave().have());
  ASSERT_TRUE(have);
  *request.add_acknowledged() = ToProto(*have);
  *request.add_acknowledged() = ToProto(*have);
  request.add_data_types(proto::POSE_GRAPH_NODE);
  request.set_content_bytes_max(30'000);
  const Result<proto::PruneReply> pruned = store_->Prune(request, 0);
  ASSERT_TRUE(pruned) << ToString(pruned.error());
  ASSERT_FALSE(pruned->pruned().empty());
  EXPECT_EQ(StoreFrom(*store_, 3, {Node(3, last_seq_)}).stored_count(), 1u);
}

TEST_F(DiskRoomTest, CountsHeldRecordsAfterARestart) {
  Fill();
  Open();
  EXPECT_EQ(StoreFrom(*store_, 3, {Node(3, last_seq_)}).rejected_count(), 1u);
  EXPECT_EQ(StoreFrom(*store_, 2, {Node(2, 1)}).stored_count(), 1u);
}

TEST_F(DiskRoomTest, ReplacesAStateByOneThatIsNoLarger) {
  const auto state = [](std::uint64_t seq, const std::string& payload) {
    return Packed({{3, 7, 1001}, seq}, CustomRecordOf(1001, payload));
  };
  ASSERT_EQ(StoreFrom(*store_, 3, {state(1, "12345")}).stored_count(), 1u);
  Fill();
  EXPECT_EQ(StoreFrom(*store_, 3, {state(2, "54321")}).stored_count(), 1u);
  EXPECT_EQ(StoreFrom(*store_, 3, {state(3, "123456")}).rejected_count(), 1u);
}

TEST(PeerAuthorityTest, AcceptsRecordsFromAnyAgentInATeamWithoutKeys) {
  auto store = OpenStore(StoreOptionsOf(1));
  EXPECT_EQ(StoreFrom(*store, 3, {Node(2, 1)}).stored_count(), 1u);
}

}  // namespace
}  // namespace moondb
