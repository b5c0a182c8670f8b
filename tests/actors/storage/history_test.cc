// Tests the history table, in which an agent keeps its own superseded states.
#include "actors/storage/history.h"

#include <gmock/gmock.h>

#include <filesystem>

#include "actors/storage/store_file.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr std::int64_t kHour_ns = 3'600'000'000'000;
constexpr std::int64_t kNow_ns = 500'000 * kHour_ns;  // In 2027.

RecordStore::Options WithHistory(const std::string& path = ":memory:") {
  RecordStore::Options options = StoreOptionsOf(1, path);
  options.history.bytes_max = 1'000'000;
  for (const auto& [type, policy] : options.policies) {
    if (policy == proto::POLICY_LATEST) options.history.keep[type] = KeepRule{};
  }
  options.history.keep[1001] = KeepRule{};  // Custom type "beacon", under policy `latest`.
  options.history.keep[proto::OPTIMIZED_POSE] = KeepRule{milliseconds::zero()};
  return options;
}

proto::Record StateAt(double celsius, std::int64_t timestamp_ns) {
  proto::Record record = TemperatureRecord(celsius);
  record.set_timestamp_ns(timestamp_ns);
  return record;
}

proto::ReadReply ReadHistory(RecordStore& store, proto::ReadRequest request = {}) {
  request.set_is_history(true);
  const Result<proto::ReadReply> page = store.Read(request);
  EXPECT_TRUE(page) << ToString(page.error());
  return page.value_or(proto::ReadReply());
}

// Returns the temperatures in history, in degrees Celsius. Contains 0 for each record of another type.
std::vector<double> Superseded(RecordStore& store, bool is_newest_first = false) {
  proto::ReadRequest request;
  request.set_is_newest_first(is_newest_first);
  std::vector<double> degrees;
  const proto::ReadReply page = ReadHistory(store, request);
  for (const proto::StoredRecord& stored : page.records()) {
    proto::Record record;
    EXPECT_TRUE(record.ParseFromString(stored.content()));
    degrees.push_back(record.temperature().celsius());
  }
  return degrees;
}

std::uint64_t HistoryCount(RecordStore& store) {
  return static_cast<std::uint64_t>(store.GetStatus()->history_count());
}

TEST(HistoryTest, KeepsStatesThatTheRobotItselfSuperseded) {
  auto store = OpenStore(WithHistory());
  const proto::RecordKey first = InsertOne(*store, TemperatureRecord(-40));
  InsertOne(*store, TemperatureRecord(-41));
  InsertOne(*store, TemperatureRecord(-42));

  const proto::ReadReply history = ReadHistory(*store);
  EXPECT_THAT(Superseded(*store), ElementsAre(-40, -41));
  EXPECT_THAT(Superseded(*store, /*is_newest_first=*/true), ElementsAre(-41, -40));
  EXPECT_EQ(FromProto(history.records(0).key()), FromProto(first));
  EXPECT_TRUE(history.is_complete());
  // The data table holds only the newest state.
  EXPECT_THAT(Contents(*store), SizeIs(1));
}

TEST(HistoryTest, IsNotPartOfWhatIsHeldSharedVerifiedAndCounted) {
  auto with = OpenStore(WithHistory());
  auto without = OpenStore(StoreOptionsOf(1));
  auto peer = OpenStore(StoreOptionsOf(2));
  for (RecordStore* store : {with.get(), without.get()}) {
    for (int i = 0; i < 20; ++i) InsertOne(*store, TemperatureRecord(i));
    InsertOne(*store, CustomRecordOf(1001, "a", "key"));
    InsertOne(*store, CustomRecordOf(1001, "b", "key"));
  }
  ASSERT_EQ(HistoryCount(*with), 20u);
  EXPECT_EQ(with->GetHave().have().SerializeAsString(), without->GetHave().have().SerializeAsString());
  const proto::StorageStatus status = *with->GetStatus();
  EXPECT_THAT(status.counts(), SizeIs(2));
  for (const proto::RecordCount& count : status.counts()) EXPECT_EQ(count.count(), 1);

  const auto missing_of = [](RecordStore& store) {
    proto::MissingRequest question;
    const auto missing = store.GetMissing(question);
    return missing ? missing->SerializeAsString() : "";
  };
  EXPECT_EQ(missing_of(*with), missing_of(*without));
  while (Transfer(*with, *peer)) {
  }
  EXPECT_THAT(Contents(*peer), SizeIs(2));
  EXPECT_THAT(ReadHistory(*peer).records(), IsEmpty());

  proto::VerifyRequest verify;
  verify.set_part(proto::VERIFY_PART_ROWS);
  EXPECT_EQ(with->Verify(verify)->checked_count(), 2);
  verify.set_part(proto::VERIFY_PART_HELD);
  EXPECT_EQ(with->Verify(verify)->missing_count(), 0);
}

TEST(HistoryTest, HistoryRowsSupersedeNothingAndAreNotSuperseded) {
  auto store = OpenStore(WithHistory());
  for (int i = 0; i < 5; ++i) InsertOne(*store, TemperatureRecord(i));
  const RecordTable& table = *FindRecordTable(proto::TEMPERATURE);
  EXPECT_THAT(*table.FindStates(store->database(), 1, proto::TEMPERATURE, ""), SizeIs(1));
}

TEST(HistoryTest, KeepsLocalStatesOfTheRobotToo) {
  auto store = OpenStore(WithHistory());
  InsertOne(*store, TemperatureRecord(-40), /*is_local=*/true);
  InsertOne(*store, TemperatureRecord(-41), /*is_local=*/true);
  InsertOne(*store, TemperatureRecord(-42));
  EXPECT_THAT(Superseded(*store), ElementsAre(-40, -41));
  EXPECT_EQ(ReadHistory(*store).records(0).key().seq(), 0u);
}

TEST(HistoryTest, KeepsNothingOfOtherAgents) {
  auto store = OpenStore(WithHistory());
  for (std::uint64_t seq = 1; seq <= 3; ++seq) {
    const RecordKey key{{2, 5, proto::TEMPERATURE}, seq};
    EXPECT_EQ(StoreOne(*store, Packed(key, TemperatureRecord(static_cast<double>(seq)))).stored_count(), 1u);
  }
  EXPECT_EQ(HistoryCount(*store), 0u);
}

TEST(HistoryTest, KeepsOwnStatesThatPeersReturnedAndWereThenSuperseded) {
  auto store = OpenStore(WithHistory());
  // A state that was stored on this agent's lost disk.
  const RecordKey old{{1, 5, proto::TEMPERATURE}, 1};
  StoreOne(*store, Packed(old, TemperatureRecord(-40)));
  InsertOne(*store, TemperatureRecord(-41));
  EXPECT_THAT(Superseded(*store), ElementsAre(-40));
  // A peer returns an older state, whose superseder is already stored. The older state is dropped and does not enter
  // history.
  StoreOne(*store, Packed({{1, 5, proto::TEMPERATURE}, 2}, TemperatureRecord(-39)));
  EXPECT_THAT(Superseded(*store), ElementsAre(-40));
}

TEST(HistoryTest, KeepsNothingOfTypesThatKeepOnlyTheLatest) {
  auto store = OpenStore(WithHistory());
  InsertOne(*store, OptimizedPoseRecord({1, 1}, 1, 1, 0));
  InsertOne(*store, OptimizedPoseRecord({1, 1}, 1, 2, 0));
  EXPECT_EQ(HistoryCount(*store), 0u);
  RecordStore::Options options = WithHistory();
  options.history.bytes_max = 0;
  auto none = OpenStore(options);
  InsertOne(*none, TemperatureRecord(-40));
  InsertOne(*none, TemperatureRecord(-41));
  EXPECT_EQ(HistoryCount(*none), 0u);
}

TEST(HistoryTest, MovesAStateInTheTransactionOfItsSuperseder) {
  auto store = OpenStore(WithHistory());
  InsertOne(*store, TemperatureRecord(-40));
  InsertOne(*store, NodeRecord(1, 7, 0));
  // The second record contradicts the stored node 7. The store therefore refuses the whole batch.
  proto::InsertRequest request;
  *request.add_records() = TemperatureRecord(-41);
  *request.add_records() = NodeRecord(1, 7, 1);
  EXPECT_TRUE(IsError(store->Insert(request).reply.error()));
  EXPECT_EQ(HistoryCount(*store), 0u);
  EXPECT_THAT(Superseded(*store), IsEmpty());
  EXPECT_EQ(*store->database().Number("SELECT celsius FROM temperature"), -40);
  InsertOne(*store, TemperatureRecord(-42));
  EXPECT_THAT(Superseded(*store), ElementsAre(-40));
}

TEST(HistoryTest, OldestStatesMakeRoomForNewOnes) {
  RecordStore::Options options = WithHistory();
  options.history.bytes_max = 2000;
  auto store = OpenStore(options);
  std::uint64_t most = 0;
  for (int i = 0; i < 300; ++i) {
    InsertOne(*store, i % 10 == 0 ? CustomRecordOf(1001, std::to_string(i), "key") : TemperatureRecord(i));
    EXPECT_LE(store->GetStatus()->history_bytes(), 2000);
    most = std::max(most, HistoryCount(*store));
  }
  EXPECT_GT(most, 10u);
  const proto::ReadReply page = ReadHistory(*store);
  EXPECT_EQ(static_cast<std::uint64_t>(page.records_size()), HistoryCount(*store));
  EXPECT_TRUE(std::is_sorted(page.row_ids().begin(), page.row_ids().end()));
  EXPECT_EQ(Superseded(*store, /*is_newest_first=*/true).front(), 298);
  EXPECT_EQ(*store->database().Number("SELECT count(*) FROM history"), HistoryCount(*store));
}

TEST(HistoryTest, SurvivesARestartWithItsCounters) {
  const TemporaryFolder folder;
  const RecordStore::Options options = WithHistory(folder.path() / "a.db");
  double bytes = 0;
  {
    auto store = OpenStore(options);
    for (int i = 0; i < 10; ++i) InsertOne(*store, TemperatureRecord(i));
    bytes = store->GetStatus()->history_bytes();
  }
  auto store = OpenStore(options);
  EXPECT_EQ(HistoryCount(*store), 9u);
  EXPECT_EQ(store->GetStatus()->history_bytes(), bytes);
  InsertOne(*store, TemperatureRecord(10));
  EXPECT_THAT(Superseded(*store), SizeIs(10));
}

TEST(HistoryTest, OnlyTheDamagedRowIsRemovedAtTheNextStart) {
  const TemporaryFolder folder;
  const RecordStore::Options options = WithHistory(folder.path() / "a.db");
  {
    auto store = OpenStore(options);
    for (int i = 0; i < 4; ++i) InsertOne(*store, TemperatureRecord(i));
    ASSERT_TRUE(store->database().Execute("UPDATE history SET content = x'0102' WHERE row_id = 2"));
    // Readers skip the damaged row until the next start removes it.
    EXPECT_THAT(Superseded(*store), ElementsAre(0, 2));
  }
  auto store = OpenStore(options);
  EXPECT_TRUE(store->set_aside().empty());
  EXPECT_EQ(HistoryCount(*store), 2u);
  EXPECT_THAT(Superseded(*store), ElementsAre(0, 2));
  EXPECT_THAT(Contents(*store), SizeIs(1));
  InsertOne(*store, TemperatureRecord(4));
  EXPECT_THAT(Superseded(*store), ElementsAre(0, 2, 3));
}

TEST(HistoryTest, NoLongerKeepsAStateThatAPeerSendsBackAfterDamage) {
  const TemporaryFolder folder;
  const RecordStore::Options options = WithHistory(folder.path() / "a.db");
  auto peer = OpenStore(StoreOptionsOf(2));
  auto store = OpenStore(options);
  for (const double celsius : {0.0, 1.0, 2.0}) {
    InsertOne(*store, TemperatureRecord(celsius));
    if (celsius == 1.0) StoreOne(*peer, Contents(*store)[0]);
  }
  ASSERT_TRUE(store->database().Execute("UPDATE temperature SET content = CAST(content || x'00' AS BLOB)"));
  store.reset();
  store = OpenStore(options);
  ASSERT_THAT(Superseded(*store), ElementsAre(0, 1));

  StoreOne(*store, Contents(*peer)[0]);
  EXPECT_THAT(Contents(*store), SizeIs(1));
  EXPECT_THAT(Superseded(*store), ElementsAre(0));
  EXPECT_EQ(HistoryCount(*store), 1u);
  InsertOne(*store, TemperatureRecord(3));
  EXPECT_THAT(Superseded(*store), ElementsAre(0, 1));
  store.reset();
  EXPECT_THAT(Superseded(*OpenStore(options)), ElementsAre(0, 1));
}

TEST(HistoryTest, ExpiresStatesByTheirTimestamp) {
  RecordStore::Options options = WithHistory();
  options.history.keep[proto::TEMPERATURE] = KeepRule{hours(12)};
  auto store = OpenStore(options);
  for (int hour = 0; hour < 24; ++hour) InsertOne(*store, StateAt(hour, kNow_ns - (23 - hour) * kHour_ns));
  EXPECT_EQ(HistoryCount(*store), 23u);
  EXPECT_FALSE(*store->TrimHistory(std::nullopt)) << "an agent that does not know the time";
  EXPECT_EQ(HistoryCount(*store), 23u);
  EXPECT_FALSE(*store->TrimHistory(kNow_ns));
  EXPECT_THAT(Superseded(*store), SizeIs(12));
  EXPECT_EQ(Superseded(*store).front(), 11);
}

TEST(HistoryTest, StatesFromASuspectClockDoNotExpireByAge) {
  RecordStore::Options options = WithHistory();
  options.history.keep[proto::TEMPERATURE] = KeepRule{hours(12)};
  auto store = OpenStore(options);
  proto::Record suspect = StateAt(1, 5);
  suspect.set_is_clock_suspect(true);
  InsertOne(*store, suspect);
  InsertOne(*store, StateAt(2, kNow_ns - 20 * kHour_ns));
  InsertOne(*store, StateAt(3, kNow_ns - 2 * kHour_ns));
  InsertOne(*store, StateAt(4, kNow_ns));
  EXPECT_FALSE(*store->TrimHistory(kNow_ns));
  EXPECT_THAT(Superseded(*store), ElementsAre(1, 3));
  EXPECT_FALSE(*store->TrimHistory(kNow_ns + 100 * kHour_ns));
  EXPECT_THAT(Superseded(*store), ElementsAre(1));
}

TEST(HistoryTest, IsTrimmedSomeRowsAtATimeToALowerLimit) {
  const TemporaryFolder folder;
  RecordStore::Options options = WithHistory(folder.path() / "a.db");
  constexpr int kCount = static_cast<int>(kHistoryTrimRowsMax) + 500;
  {
    auto store = OpenStore(options);
    std::vector<proto::Record> records;
    for (int i = 0; i <= kCount; ++i) records.push_back(TemperatureRecord(i));
    ASSERT_FALSE(IsError(InsertAll(*store, records).error()));
    ASSERT_EQ(HistoryCount(*store), static_cast<std::uint64_t>(kCount));
  }
  options.history.keep[proto::TEMPERATURE] = KeepRule{milliseconds::zero()};
  auto store = OpenStore(options);
  EXPECT_TRUE(*store->TrimHistory(std::nullopt));
  EXPECT_EQ(HistoryCount(*store), 500u);
  EXPECT_FALSE(*store->TrimHistory(std::nullopt));
  EXPECT_EQ(HistoryCount(*store), 0u);
}

TEST(HistoryTest, IsPrunedByAgeTypeAndSizeAfterADryRunShowsIt) {
  auto store = OpenStore(WithHistory());
  for (int hour = 0; hour < 24; ++hour) InsertOne(*store, StateAt(hour, kNow_ns - (23 - hour) * kHour_ns));
  for (int i = 0; i < 3; ++i) InsertOne(*store, CustomRecordOf(1001, std::to_string(i), "key"));
  proto::PruneRequest request;
  request.set_is_history(true);
  request.set_is_dry_run(true);
  const auto all = store->Prune(request, kNow_ns);
  ASSERT_TRUE(all) << ToString(all.error());
  ASSERT_EQ(all->pruned_size(), 2);
  EXPECT_EQ(all->pruned(0).record_count(), 23);
  EXPECT_EQ(all->pruned(1).record_count(), 2);
  EXPECT_EQ(HistoryCount(*store), 25u);

  request.set_is_dry_run(false);
  request.add_data_types(proto::TEMPERATURE);
  request.set_older_than_s(12 * 3600);
  EXPECT_EQ(store->Prune(request, kNow_ns)->pruned(0).record_count(), 11);
  EXPECT_EQ(Superseded(*store).front(), 11);
  request.clear_older_than_s();
  request.set_content_bytes_max(1);
  EXPECT_EQ(store->Prune(request, kNow_ns)->pruned(0).record_count(), 1);
  request.clear_content_bytes_max();
  EXPECT_EQ(store->Prune(request, kNow_ns)->pruned(0).record_count(), 11);
  EXPECT_EQ(HistoryCount(*store), 2u);
  request.set_older_than_s(-1);
  EXPECT_EQ(store->Prune(request, kNow_ns).error().field, "older_than_s");
  // Pruning history removes no current records.
  EXPECT_THAT(Contents(*store), SizeIs(2));
}

TEST(HistoryTest, IsDroppedFirstIfTheFileIsFull) {
  RecordStore::Options options = WithHistory();
  options.bytes_max = 1'500'000;
  options.custom_types.Mutable(0)->set_bytes_max(100'000);
  auto store = OpenStore(options);
  while (store->GetStatus()->history_bytes() < 700'000) {
    std::vector<proto::Record> records;
    for (int i = 0; i < 500; ++i) records.push_back(TemperatureRecord(i));
    ASSERT_FALSE(IsError(InsertAll(*store, records).error()));
  }
  const std::uint64_t before = HistoryCount(*store);
  // Inserts records under policy `all` until the file is full. These records use the free space first, and then the
  // space of history.
  int stored = 0;
  while (true) {
    proto::InsertRequest request;
    *request.add_records() = CustomRecordOf(1000, std::string(50'000, 'x'));
    if (IsError(store->Insert(request).reply.error())) break;
    ASSERT_LT(++stored, 100);
  }
  EXPECT_EQ(HistoryCount(*store), 0u);
  EXPECT_GT(before, 1000u);
  EXPECT_GT(stored, 15);
}

TEST(HistoryTest, DropsAsManyBytesAsRequested) {
  auto store = OpenStore(WithHistory());
  for (int i = 0; i < 100; ++i) InsertOne(*store, TemperatureRecord(i));
  const double before = store->GetStatus()->history_bytes();
  const Result<std::uint64_t> freed = store->DropHistory(1000);
  ASSERT_TRUE(freed) << ToString(freed.error());
  EXPECT_GE(*freed, 1000u);
  EXPECT_LT(*freed, 1300u);
  EXPECT_EQ(store->GetStatus()->history_bytes(), before - static_cast<double>(*freed));
  EXPECT_GT(Superseded(*store).front(), 5);
  EXPECT_GT(*store->DropHistory(1'000'000'000), 0u);
  EXPECT_EQ(*store->DropHistory(1), 0u);
}

TEST(HistoryTest, IsPagedAndFiltered) {
  auto store = OpenStore(WithHistory());
  for (int i = 0; i < 10; ++i) InsertOne(*store, TemperatureRecord(i));
  for (int i = 0; i < 3; ++i) InsertOne(*store, CustomRecordOf(1001, std::to_string(i), "key"));
  proto::ReadRequest request;
  request.set_records_max(4);
  std::vector<std::uint64_t> row_ids;
  while (true) {
    const proto::ReadReply page = ReadHistory(*store, request);
    row_ids.insert(row_ids.end(), page.row_ids().begin(), page.row_ids().end());
    if (page.is_complete()) break;
    request.set_after_row_id(row_ids.back());
  }
  EXPECT_THAT(row_ids, SizeIs(11));
  EXPECT_TRUE(std::is_sorted(row_ids.begin(), row_ids.end()));
  proto::ReadRequest customs;
  customs.add_data_types(1001);
  EXPECT_THAT(ReadHistory(*store, customs).records(), SizeIs(2));
  proto::ReadRequest others;
  others.add_origin_agents(2);
  EXPECT_THAT(ReadHistory(*store, others).records(), IsEmpty());
}

TEST(HistoryTest, ShowsReadableColumnsToSql) {
  const TemporaryFolder folder;
  auto store = OpenStore(WithHistory(folder.path() / "a.db"));
  InsertOne(*store, TemperatureRecord(-40.5));
  InsertOne(*store, TemperatureRecord(-41));
  InsertOne(*store, CustomRecordOf(1001, "0.31", "hole 3"));
  InsertOne(*store, CustomRecordOf(1001, "0.32", "hole 3"));
  const auto answer =
      QueryStore(folder.path() / "a.db",
                 "SELECT type, timestamp_ns, json_extract(fields, '$.celsius'), CAST(latest_key AS TEXT), "
                 "CAST(payload AS TEXT), record_id IS NOT NULL FROM v_history ORDER BY row_id",
                 10);
  ASSERT_TRUE(answer) << ToString(answer.error());
  ASSERT_THAT(answer->rows, SizeIs(2));
  const auto texts = [&](int row) {
    std::vector<std::string> cells;
    for (const QueryCell& cell : answer->rows[row]) cells.push_back(cell.text);
    return cells;
  };
  EXPECT_THAT(texts(0), ElementsAre("temperature", "1", "-40.5", "", "", "1"));
  EXPECT_THAT(texts(1), ElementsAre("beacon", "5", "", "hole 3", "0.31", "1"));
}

TEST(HistoryTest, DoesNotUseTheStoresBudget) {
  const TemporaryFolder folder;
  auto with = OpenStore(WithHistory(folder.path() / "a.db"));
  std::vector<proto::Record> records;
  for (int i = 0; i < 4800; ++i) records.push_back(TemperatureRecord(i));
  const double before = with->GetStatus()->database_bytes() - with->GetStatus()->wal_bytes();
  ASSERT_FALSE(IsError(InsertAll(*with, records).error()));
  const proto::StorageStatus status = *with->GetStatus();
  EXPECT_GT(status.history_bytes(), 300'000);
  EXPECT_LT(std::abs(status.database_bytes() - status.wal_bytes() - before), 50'000);
}

}  // namespace
}  // namespace moondb
