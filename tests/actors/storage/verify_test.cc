#include "actors/storage/verify.h"

#include <gmock/gmock.h>

#include <fstream>

#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Sums of the counts in all replies of a complete verification.
struct Found {
  double rows = 0, held = 0, damaged = 0, missing = 0, orphaned = 0;
  int slices = 0;
  std::vector<std::string> findings;  // "KEY: TEXT"
};

Found VerifyAll(RecordStore& store) {
  Found found;
  for (const auto part : {proto::VERIFY_PART_FILE, proto::VERIFY_PART_ROWS, proto::VERIFY_PART_HELD}) {
    proto::VerifyRequest request;
    request.set_part(part);
    for (bool is_complete = false; !is_complete; ++found.slices) {
      const Result<proto::VerifyReply> reply = store.Verify(request);
      if (!reply) {
        ADD_FAILURE() << ToString(reply.error());
        return found;
      }
      (part == proto::VERIFY_PART_HELD ? found.held : found.rows) += reply->checked_count();
      found.damaged += reply->damaged_count();
      found.missing += reply->missing_count();
      found.orphaned += reply->orphaned_count();
      for (const proto::VerifyFinding& finding : reply->findings()) {
        found.findings.push_back(ToString(FromProto(finding.key())) + ": " + finding.text());
      }
      is_complete = reply->is_complete();
      request.set_after_row_id(reply->last_row_id());
      *request.mutable_after_key() = reply->last_key();
    }
  }
  return found;
}

// Returns the fingerprint of the seqs `first` to `last` of a stream, combined from as many replies as needed. Adds the
// number of replies to `*answers`.
proto::FingerprintReply FingerprintOf(RecordStore& store, const StreamKey& stream, std::uint64_t first,
                                      std::uint64_t last, int* answers = nullptr) {
  proto::FingerprintReply whole;
  while (true) {
    if (answers != nullptr) ++*answers;
    proto::FingerprintRequest request;
    request.mutable_stream()->set_origin_agent(stream.origin);
    request.mutable_stream()->set_epoch(stream.epoch);
    request.mutable_stream()->set_data_type(stream.type);
    request.mutable_stream()->add_held()->set_first(first);
    request.mutable_stream()->mutable_held(0)->set_last(last);
    const Result<proto::FingerprintReply> part = store.TakeFingerprint(request);
    if (!part) {
      ADD_FAILURE() << ToString(part.error());
      return whole;
    }
    whole.set_fingerprint(whole.fingerprint() ^ part->fingerprint());
    whole.set_record_count(whole.record_count() + part->record_count());
    if (part->is_complete()) return whole;
    EXPECT_GE(part->last_seq(), first);
    first = part->last_seq() + 1;
  }
}

class VerifyTest : public testing::Test {
 protected:
  // Changes the database without the store's knowledge, to simulate a damaged disk.
  void Execute(const std::string& sql) {
    const Result<void> done = store_->database().Execute(sql);
    ASSERT_TRUE(done) << ToString(done.error());
  }

  void ChangeAByte(const std::string& table, int seq) {
    Execute("UPDATE " + table +
            " SET content = CAST(x'FF' || substr(content, 2) AS BLOB) WHERE seq = " + std::to_string(seq));
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.File("store.db");
  std::unique_ptr<RecordStore> store_ = OpenStore(StoreOptionsOf(2, path_));
};

TEST_F(VerifyTest, FindsNothingInASoundStore) {
  EXPECT_EQ(VerifyAll(*store_).rows, 0);
  for (int i = 0; i < 5; ++i) InsertOne(*store_, NodeRecord(2, i));
  for (int i = 0; i < 3; ++i) InsertOne(*store_, TemperatureRecord(i));  // The third state supersedes the other two.
  InsertOne(*store_, CustomRecordOf(1000, "wet"));
  InsertOne(*store_, NodeRecord(2, 9), /*is_local=*/true);
  StoreOne(*store_, Packed({{3, 7, proto::POSE_GRAPH_NODE}, 4}, NodeRecord(3, 4)));
  const Found found = VerifyAll(*store_);
  EXPECT_EQ(found.rows, 9);
  EXPECT_EQ(found.held, 8);
  EXPECT_THAT(found.findings, IsEmpty());
}

TEST_F(VerifyTest, FindsAChangedByteInSharedAndLocalRecords) {
  for (int i = 0; i < 5; ++i) InsertOne(*store_, NodeRecord(2, i));
  InsertOne(*store_, NodeRecord(2, 9), /*is_local=*/true);
  ChangeAByte("pose_graph_node", 3);
  Execute("UPDATE pose_graph_node SET hash = hash + 1 WHERE seq IS NULL");
  const Found found = VerifyAll(*store_);
  EXPECT_EQ(found.damaged, 2);
  EXPECT_EQ(found.missing + found.orphaned, 0);
  const std::string epoch = ToString(RecordKey{{2, store_->GetHave().epoch(), proto::POSE_GRAPH_NODE}, 3});
  EXPECT_THAT(found.findings, ElementsAre(epoch + ": its content does not match its hash",
                                          "2.0000000000000000.20.0: its content does not match its hash"));
}

TEST_F(VerifyTest, FindsMissingRowsAndOrphanedRows) {
  for (int i = 0; i < 5; ++i) InsertOne(*store_, NodeRecord(2, i));
  InsertOne(*store_, TemperatureRecord(1));
  InsertOne(*store_, TemperatureRecord(2));
  const StreamKey nodes{2, store_->GetHave().epoch(), proto::POSE_GRAPH_NODE};
  Execute("DELETE FROM pose_graph_node WHERE seq IN (2, 5)");
  // Adds a row of a superseded record that the have-set counts as dropped.
  Execute(
      "INSERT INTO temperature(row_id, origin, epoch, seq, timestamp_ns, latest_key, natural_key, hash, content, "
      "celsius) "
      "SELECT 99, origin, epoch, 1, timestamp_ns, latest_key, natural_key, hash, content, celsius FROM temperature");
  const Found found = VerifyAll(*store_);
  EXPECT_EQ(found.missing, 2);
  EXPECT_EQ(found.orphaned, 1);
  // The orphaned row counts as damaged too, because its hash was computed for another key.
  EXPECT_EQ(found.damaged, 1);
  EXPECT_THAT(found.findings,
              testing::IsSupersetOf({ToString({nodes, 2}) + ": the have-set lists it, but no row exists",
                                     ToString({nodes, 5}) + ": the have-set lists it, but no row exists"}));
}

TEST_F(VerifyTest, CountsMoreFindingsThanItNames) {
  constexpr int kCount = 2 * static_cast<int>(kVerifyRecordsMax) + 7;
  std::vector<proto::Record> records;
  for (int i = 0; i < kCount; ++i) records.push_back(NodeRecord(2, i));
  ASSERT_EQ(InsertAll(*store_, records).keys_size(), kCount);
  InsertOne(*store_, TemperatureRecord(1));
  Execute("DELETE FROM pose_graph_node WHERE seq > 3");
  const Found found = VerifyAll(*store_);
  EXPECT_EQ(found.rows, 4);
  EXPECT_EQ(found.held, kCount + 1);
  EXPECT_EQ(found.missing, kCount - 3);
  EXPECT_EQ(found.findings.size(), static_cast<std::size_t>(kVerifyFindingsMax));
}

TEST_F(VerifyTest, ContinuesAfterAFullSlice) {
  constexpr int kCount = 2 * static_cast<int>(kVerifyRecordsMax) + 7;
  std::vector<proto::Record> records;
  for (int i = 0; i < kCount; ++i) records.push_back(NodeRecord(2, i));
  ASSERT_EQ(InsertAll(*store_, records).keys_size(), kCount);
  InsertOne(*store_, TemperatureRecord(1));
  const Found found = VerifyAll(*store_);
  EXPECT_EQ(found.rows, kCount + 1);
  EXPECT_EQ(found.held, kCount + 1);
  EXPECT_THAT(found.findings, IsEmpty());
  EXPECT_EQ(found.slices, 1 + 3 + 3);
}

TEST_F(VerifyTest, EndsWhateverTheHaveSetClaims) {
  InsertOne(*store_, NodeRecord(2, 1));
  HaveSet have;
  for (AgentId origin = 1; origin <= kVerifyRecordsMax + 1; ++origin) {
    have[{origin, 7, proto::POSE_GRAPH_NODE}].held.Add({1, UINT64_MAX - 1});
  }
  proto::VerifyRequest request;
  request.set_part(proto::VERIFY_PART_HELD);
  double missing = 0;
  for (const bool is_complete : {false, true}) {
    const Result<proto::VerifyReply> reply = Verify(store_->database(), have, request);
    ASSERT_TRUE(reply);
    EXPECT_EQ(reply->is_complete(), is_complete);
    missing += reply->missing_count();
    *request.mutable_after_key() = reply->last_key();
  }
  EXPECT_GT(missing, 1e19 * kVerifyRecordsMax);
}

TEST_F(VerifyTest, FindsADamagedFile) {
  for (int i = 0; i < 200; ++i) InsertOne(*store_, NodeRecord(2, i));
  const std::int64_t page =
      *store_->database().Number("SELECT rootpage FROM sqlite_master WHERE name = 'pose_graph_node_natural'");
  Execute("PRAGMA wal_checkpoint(TRUNCATE)");
  RecordStore::Options checked = StoreOptionsOf(2, path_);
  checked.is_checked = true;
  store_.reset();
  std::fstream(path_, std::ios::in | std::ios::out | std::ios::binary).seekp((page - 1) * 4096)
      << std::string(4096, '\x5a');
  store_ = OpenStore(checked);
  proto::VerifyRequest request;
  request.set_part(proto::VERIFY_PART_FILE);
  const Result<proto::VerifyReply> reply = store_->Verify(request);
  ASSERT_TRUE(reply);
  EXPECT_TRUE(reply->is_complete());
  ASSERT_EQ(reply->findings_size(), 1);
  EXPECT_FALSE(reply->findings(0).has_key());
  EXPECT_THAT(reply->findings(0).text(), HasSubstr("is damaged"));
}

TEST_F(VerifyTest, FindsADamagedHaveSet) {
  for (int i = 0; i < 3; ++i) InsertOne(*store_, NodeRecord(2, i));
  Execute("UPDATE have_interval SET last = 2");
  proto::VerifyRequest request;
  request.set_part(proto::VERIFY_PART_FILE);
  EXPECT_THAT(store_->Verify(request)->findings(0).text(), HasSubstr("its have-set"));
}

TEST_F(VerifyTest, RefusesARequestWithoutAPart) { EXPECT_EQ(store_->Verify({}).error().field, "part"); }

TEST_F(VerifyTest, TwoAgentsWithTheSameRecordsHaveTheSameFingerprint) {
  auto other = OpenStore(StoreOptionsOf(3));
  for (int i = 0; i < 5; ++i) InsertOne(*store_, NodeRecord(2, i));
  const StreamKey stream{2, store_->GetHave().epoch(), proto::POSE_GRAPH_NODE};
  while (Transfer(*store_, *other, 2)) {
  }
  const proto::FingerprintReply ours = FingerprintOf(*store_, stream, 1, 5);
  EXPECT_EQ(ours.record_count(), 5);
  EXPECT_EQ(ours.SerializeAsString(), FingerprintOf(*other, stream, 1, 5).SerializeAsString());
  EXPECT_EQ(FingerprintOf(*store_, stream, 1, 3).fingerprint() ^ FingerprintOf(*store_, stream, 4, 5).fingerprint(),
            ours.fingerprint());

  // Changes a byte of seq 4, as a faulty disk would. The stored hash still belongs to the old content.
  ChangeAByte("pose_graph_node", 4);
  EXPECT_NE(FingerprintOf(*store_, stream, 1, 5).fingerprint(), ours.fingerprint());
  EXPECT_EQ(FingerprintOf(*store_, stream, 1, 3).fingerprint(), FingerprintOf(*other, stream, 1, 3).fingerprint());
  Execute("DELETE FROM pose_graph_node WHERE seq = 2");
  EXPECT_EQ(FingerprintOf(*store_, stream, 1, 3).record_count(), 2);
}

TEST_F(VerifyTest, ComputesAFingerprintInSlices) {
  constexpr int kCount = 2 * static_cast<int>(kVerifyRecordsMax) + 7;
  std::vector<proto::Record> records;
  for (int i = 0; i < kCount; ++i) records.push_back(NodeRecord(2, i));
  InsertAll(*store_, records);
  const StreamKey stream{2, store_->GetHave().epoch(), proto::POSE_GRAPH_NODE};
  int answers = 0;
  const proto::FingerprintReply whole = FingerprintOf(*store_, stream, 1, kCount, &answers);
  EXPECT_EQ(answers, 3);
  EXPECT_EQ(whole.record_count(), kCount);
  const std::uint64_t half = FingerprintOf(*store_, stream, 1, kCount / 2).fingerprint();
  EXPECT_EQ(half ^ FingerprintOf(*store_, stream, kCount / 2 + 1, kCount).fingerprint(), whole.fingerprint());
}

TEST_F(VerifyTest, RefusesAFingerprintOfAnInvalidStream) {
  proto::FingerprintRequest request;
  EXPECT_EQ(store_->TakeFingerprint(request).error().field, "stream.data_type");
  request.mutable_stream()->set_data_type(proto::TEMPERATURE);
  EXPECT_EQ(store_->TakeFingerprint(request).error().field, "streams[0].origin_agent");
  request.mutable_stream()->set_origin_agent(2);
  request.mutable_stream()->add_held()->set_first(7);
  EXPECT_EQ(store_->TakeFingerprint(request).error().code, ErrorCode::kInvalid);
}

TEST_F(VerifyTest, AcceptsAnImpossibleKeyAsAStart) {
  InsertOne(*store_, NodeRecord(2, 1));
  proto::VerifyRequest request;
  request.set_part(proto::VERIFY_PART_HELD);
  *request.mutable_after_key() = ToProto(RecordKey{{2, store_->GetHave().epoch(), proto::POSE_GRAPH_NODE}, UINT64_MAX});
  const Result<proto::VerifyReply> reply = store_->Verify(request);
  ASSERT_TRUE(reply);
  EXPECT_EQ(reply->checked_count(), 0);
}

}  // namespace
}  // namespace moondb
