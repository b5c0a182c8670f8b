#include "runtime/record_reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "model/record_key.h"
#include "proto/types.pb.h"
#include "runtime/simulation/simulated_team.h"
#include "tests/runtime/scripted_actor.h"

namespace moondb {
namespace {

using simulation::Fault;
using simulation::SimulatedTeam;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr AgentId kSelf = 1;
constexpr DataType kRead = proto::TEMPERATURE;
constexpr DataType kNotRead = proto::POWER;

const Address kStorage{kSelf, actor_name::kStorage};
const Address kReader{kSelf, "reader"};

// The rows of the simulated storage, which survive a restart of its actor. `rows` maps row ids to data types. The seq
// of a record is its row id.
struct FakeStore {
  std::map<std::uint64_t, DataType> rows;
  std::vector<std::uint64_t> asked_after;  // after_row_id of each ReadRequest, in order.
  std::optional<Error> error;

  std::uint64_t last_row() const { return rows.empty() ? 0 : rows.rbegin()->first; }
};

proto::ReadReply PageOf(const FakeStore& store, const proto::ReadRequest& request) {
  proto::ReadReply page;
  page.set_is_complete(true);
  for (auto row = store.rows.upper_bound(request.after_row_id()); row != store.rows.end(); ++row) {
    if (std::find(request.data_types().begin(), request.data_types().end(), row->second) ==
        request.data_types().end()) {
      continue;
    }
    if (static_cast<std::uint32_t>(page.records_size()) == request.records_max()) {
      page.set_is_complete(false);
      break;
    }
    *page.add_records()->mutable_key() = ToProto(RecordKey{{kSelf, 7, row->second}, row->first});
    page.add_row_ids(row->first);
  }
  return page;
}

// An actor with one RecordReader. Writes its observations to Seen, which survives a restart of the actor.
class ReaderActor final : public Actor {
 public:
  struct Seen {
    std::vector<std::uint64_t> seqs;
    std::vector<std::string> results;  // Errors of completed reads. An empty text means success.
    std::size_t others = 0;            // Number of answers and timers that the reader left to its actor.
    std::uint64_t refused_seq = 0;     // The actor refuses the record with this seq. 0: none.
  };

  ReaderActor(RecordReader::Options options, bool is_following, std::shared_ptr<Seen> seen)
      : is_following_(is_following),
        seen_(std::move(seen)),
        reader_(std::move(options),
                [this](Context&, const proto::StoredRecord& stored) { return Take(stored.key().seq()); }) {}

  void OnStart(Context& context) override {
    if (is_following_) reader_.Follow(context);
  }

  void OnMessage(Context& context, const proto::Message& message) override {
    const bool was_reading = reader_.is_reading();
    if (message.has_custom()) {
      Obey(context, message.custom().value());
    } else if (!reader_.OnMessage(context, message)) {
      seen_->others += message.has_read_reply() || message.has_timer() ? 1 : 0;
      return;
    }
    const bool has_ended = (was_reading || message.has_custom()) && !reader_.is_reading();
    if (!has_ended) return;
    const Result<void>& result = reader_.result();
    seen_->results.push_back(result ? "" : ToString(result.error()));
  }

 private:
  void Obey(Context& context, const std::string& order) {
    if (order == "read") reader_.Read(context);
    if (order == "read anew") reader_.ReadAgain(context);
    if (order == "stop") reader_.Stop(context);
  }

  Result<void> Take(std::uint64_t seq) {
    if (seq == seen_->refused_seq) return Fail(ErrorCode::kFull, "no more");
    seen_->seqs.push_back(seq);
    return {};
  }

  const bool is_following_;
  const std::shared_ptr<Seen> seen_;
  RecordReader reader_;
};

class RecordReaderTest : public testing::Test {
 protected:
  RecordReaderTest() {
    options_.data_types = {kRead};
    options_.page_records_max = 3;
    team_.AddAgent(kSelf);
  }

  // Spawns a simulated storage. Tests that do not call SpawnStorage answer in storage's place.
  void SpawnStorage(SpawnOptions options = {}) {
    team_.Spawn(kSelf, actor_name::kStorage, OnEachMessage([this](Context& context, const proto::Message& message) {
                  if (message.has_custom()) {
                    Commit(context);
                    return;
                  }
                  if (!message.has_read_request()) return;
                  store_.asked_after.push_back(message.read_request().after_row_id());
                  proto::Message answer;
                  *answer.mutable_read_reply() = PageOf(store_, message.read_request());
                  if (store_.error) *answer.mutable_read_reply()->mutable_error() = ToProto(*store_.error);
                  (void)context.Reply(std::move(answer));
                }),
                options);
  }

  void SpawnReader(bool is_following, SpawnOptions options = {}) {
    team_.Spawn(
        kSelf, kReader.actor,
        [this, is_following] { return std::make_unique<ReaderActor>(options_, is_following, seen_); }, options);
    team_.RunUntilIdle();
  }

  // Adds a row and then publishes RecordsStored, as a transaction of storage does.
  void Commit(Context& context) {
    AddRows(1);
    context.Publish(News(store_.last_row()));
  }

  void AddRows(int count, DataType type = kRead) {
    for (int i = 0; i < count; ++i) store_.rows[store_.last_row() + 1] = type;
  }

  static proto::Message News(std::uint64_t last_row_id, DataType type = kRead) {
    proto::Message news;
    news.mutable_records_stored()->set_last_row_id(last_row_id);
    news.mutable_records_stored()->add_data_types(type);
    return news;
  }

  void Post(const Address& from, const Address& to, proto::Message message) {
    ASSERT_EQ(team_.Post(from, to, std::move(message)), SendResult::kAccepted);
  }

  void Order(const std::string& order) {
    proto::Message message;
    message.mutable_custom()->set_value(order);
    Post({kSelf, "test"}, kReader, std::move(message));
    team_.RunUntilIdle();
  }

  // Returns the messages that were sent to storage since the last call. Requires: SpawnStorage was not called.
  std::vector<proto::Message> TakeQuestions() { return team_.TakeMessages(kStorage); }

  // Returns storage's answer to `question`: a page with these rows.
  static proto::Message Answer(const proto::Message& question, const std::vector<std::uint64_t>& rows,
                               bool is_complete = true) {
    proto::Message answer;
    answer.set_request_id(question.request_id());
    proto::ReadReply& page = *answer.mutable_read_reply();
    for (const std::uint64_t row : rows) {
      *page.add_records()->mutable_key() = ToProto(RecordKey{{kSelf, 7, kRead}, row});
      page.add_row_ids(row);
    }
    page.set_is_complete(is_complete);
    return answer;
  }

  void PostFromStorage(proto::Message message) {
    Post(kStorage, kReader, std::move(message));
    team_.RunUntilIdle();
  }

  FakeStore store_;
  RecordReader::Options options_;
  std::shared_ptr<ReaderActor::Seen> seen_ = std::make_shared<ReaderActor::Seen>();
  SimulatedTeam team_{/*seed=*/1};
};

TEST_F(RecordReaderTest, ReadsAllPagesInStorageOrder) {
  SpawnStorage();
  AddRows(7);
  SpawnReader(/*is_following=*/true);
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2, 3, 4, 5, 6, 7));
  EXPECT_THAT(store_.asked_after, ElementsAre(0, 3, 6));
}

TEST_F(RecordReaderTest, ReadsOnlyItsTypes) {
  SpawnStorage();
  AddRows(1);
  AddRows(5, kNotRead);
  AddRows(1);
  SpawnReader(/*is_following=*/true);
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 7));
  team_.RecordSent(kReader);
  PostFromStorage(News(/*last_row_id=*/8, kNotRead));
  EXPECT_THAT(team_.TakeSent(kReader), IsEmpty());
}

TEST_F(RecordReaderTest, AsksForPagesAsItsOptionsSay) {
  options_.data_types = {kRead, kNotRead};
  options_.page_bytes_max = 1000;
  SpawnReader(/*is_following=*/true);
  const std::vector<proto::Message> questions = TakeQuestions();
  ASSERT_THAT(questions, SizeIs(1));
  const proto::ReadRequest& request = questions[0].read_request();
  EXPECT_THAT(request.data_types(), ElementsAre(kRead, kNotRead));
  EXPECT_EQ(request.records_max(), 3u);
  EXPECT_EQ(request.content_bytes_max(), 1000u);
}

TEST_F(RecordReaderTest, FollowsNewRecords) {
  SpawnStorage();
  SpawnReader(/*is_following=*/true);
  proto::Message commit;
  commit.mutable_custom();
  for (int i = 0; i < 5; ++i) Post({kSelf, "test"}, kStorage, commit);
  team_.RunUntilIdle();
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2, 3, 4, 5));
}

// The mailbox merges a later RecordsStored into one that already waits. The merged message may then arrive before a
// page that lacks the new rows.
TEST_F(RecordReaderTest, NewsThatPrecedeAPageWithoutTheNewRowsAreNotLost) {
  SpawnReader(/*is_following=*/true);
  const proto::Message question = TakeQuestions().at(0);
  PostFromStorage(News(/*last_row_id=*/2));
  PostFromStorage(Answer(question, {1}));
  const std::vector<proto::Message> questions = TakeQuestions();
  ASSERT_THAT(questions, SizeIs(1));
  EXPECT_EQ(questions[0].read_request().after_row_id(), 1u);
  PostFromStorage(Answer(questions[0], {2}));
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2));
  EXPECT_THAT(TakeQuestions(), IsEmpty());
}

TEST_F(RecordReaderTest, NewsOfRowsAlreadyReadCauseNoRequest) {
  SpawnReader(/*is_following=*/true);
  PostFromStorage(Answer(TakeQuestions().at(0), {1, 2}));
  PostFromStorage(News(/*last_row_id=*/2));
  EXPECT_THAT(TakeQuestions(), IsEmpty());
}

TEST_F(RecordReaderTest, HasOneRequestInFlightHoweverManyNewsArrive) {
  SpawnReader(/*is_following=*/true);
  for (std::uint64_t row = 1; row <= 100; ++row) PostFromStorage(News(row));
  const std::vector<proto::Message> first = TakeQuestions();
  ASSERT_THAT(first, SizeIs(1));
  PostFromStorage(Answer(first[0], {1, 2, 3}, /*is_complete=*/false));
  EXPECT_THAT(TakeQuestions(), SizeIs(1));
}

TEST_F(RecordReaderTest, RequestsALostPageAgain) {
  SpawnReader(/*is_following=*/true);
  PostFromStorage(Answer(TakeQuestions().at(0), {1}, /*is_complete=*/false));
  const proto::Message lost = TakeQuestions().at(0);
  team_.AdvanceTime(seconds(34));
  EXPECT_THAT(TakeQuestions(), IsEmpty());
  team_.AdvanceTime(seconds(2));
  const std::vector<proto::Message> again = TakeQuestions();
  ASSERT_THAT(again, SizeIs(1));
  EXPECT_EQ(again[0].read_request().after_row_id(), 1u);
  // The page was late, not lost. The reader ignores it, because it has requested the page again.
  PostFromStorage(Answer(lost, {2}));
  EXPECT_THAT(seen_->seqs, ElementsAre(1));
  PostFromStorage(Answer(again[0], {2}));
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2));
  team_.AdvanceTime(seconds(100));
  EXPECT_THAT(TakeQuestions(), IsEmpty());
}

TEST_F(RecordReaderTest, LeavesAnswersToOtherRequestsToTheActor) {
  SpawnReader(/*is_following=*/true);
  const proto::Message question = TakeQuestions().at(0);
  Post({kSelf, "other"}, kReader, Answer(question, {9}));
  proto::Message other_question = question;
  other_question.set_request_id(question.request_id() + 1);
  PostFromStorage(Answer(other_question, {9}));
  proto::Message timer;
  timer.mutable_timer()->set_kind(RecordReader::kTimerKind);
  timer.mutable_timer()->set_value(question.request_id());
  Post({kSelf, "other"}, kReader, std::move(timer));
  team_.RunUntilIdle();
  EXPECT_EQ(seen_->others, 3u);
  EXPECT_THAT(TakeQuestions(), IsEmpty());
  PostFromStorage(Answer(question, {1}));
  PostFromStorage(Answer(question, {2}));  // The reader ignores a repeated answer.
  EXPECT_THAT(seen_->seqs, ElementsAre(1));
}

TEST_F(RecordReaderTest, IgnoresNewsFromOtherActors) {
  SpawnReader(/*is_following=*/true);
  PostFromStorage(Answer(TakeQuestions().at(0), {}));
  Post({kSelf, "other"}, kReader, News(/*last_row_id=*/5));
  team_.RunUntilIdle();
  EXPECT_THAT(TakeQuestions(), IsEmpty());
}

TEST_F(RecordReaderTest, SkipsRowsThatArePrunedBetweenTwoPages) {
  SpawnStorage();
  AddRows(10);
  team_.SetFault([this](const Address& actor, const proto::Message& message) {
    if (actor == kReader && message.has_read_reply()) {
      for (const std::uint64_t row : {1, 3, 4, 6, 10}) store_.rows.erase(row);
    }
    return Fault::kNone;
  });
  SpawnReader(/*is_following=*/true);
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2, 3, 5, 7, 8, 9));
}

TEST_F(RecordReaderTest, RepeatsItsRequestAtOnceIfStorageFailsWhileHandlingIt) {
  SpawnStorage();
  AddRows(7);
  int faults = 0;
  team_.SetFault([&faults](const Address& actor, const proto::Message& message) {
    const bool is_question = actor == kStorage && message.read_request().after_row_id() == 3;
    return is_question && faults++ == 0 ? Fault::kBeforeHandler : Fault::kNone;
  });
  SpawnReader(/*is_following=*/true);
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2, 3, 4, 5, 6, 7));
  EXPECT_EQ(faults, 2);
}

// Storage may have committed a record just before it failed.
TEST_F(RecordReaderTest, ReadsAgainWhenStorageFails) {
  SpawnStorage();
  SpawnReader(/*is_following=*/true);
  AddRows(1);
  team_.CrashActor(kStorage);
  team_.RunUntilIdle();
  EXPECT_THAT(seen_->seqs, ElementsAre(1));
}

TEST_F(RecordReaderTest, RetriesWhenTheMailboxOfStorageIsFull) {
  SpawnStorage({.messages_max = 1});
  AddRows(1);
  Post({kSelf, "test"}, kStorage, Numbered(1));
  team_.Spawn(kSelf, kReader.actor, [this] { return std::make_unique<ReaderActor>(options_, true, seen_); });
  team_.RunUntilIdle();
  EXPECT_THAT(store_.asked_after, IsEmpty());
  team_.AdvanceTime(seconds(6));
  EXPECT_THAT(seen_->seqs, ElementsAre(1));
}

TEST_F(RecordReaderTest, RetriesWhenItsOwnMailboxHadNoRoomForThePage) {
  SpawnStorage();
  AddRows(1);
  bool is_full = true;
  team_.SetFault([&](const Address& actor, const proto::Message& message) {
    if (actor == kStorage && message.has_read_request() && std::exchange(is_full, false)) {
      EXPECT_EQ(team_.Post({kSelf, "test"}, kReader, Numbered(1)), SendResult::kAccepted);
    }
    return Fault::kNone;
  });
  SpawnReader(/*is_following=*/true, {.messages_max = 1});
  EXPECT_THAT(seen_->seqs, IsEmpty());
  team_.AdvanceTime(seconds(36));
  EXPECT_THAT(seen_->seqs, ElementsAre(1));
}

TEST_F(RecordReaderTest, KeepsFollowingAfterAnErrorOfStorage) {
  SpawnStorage();
  AddRows(1);
  store_.error = Error{ErrorCode::kInternal, "the disk does not answer", {}};
  SpawnReader(/*is_following=*/true);
  team_.AdvanceTime(seconds(12));
  EXPECT_THAT(store_.asked_after, SizeIs(3));
  store_.error.reset();
  team_.AdvanceTime(seconds(5));
  EXPECT_THAT(seen_->seqs, ElementsAre(1));
}

TEST_F(RecordReaderTest, ReadsPresentRecordsOnRequest) {
  SpawnStorage();
  AddRows(4);
  SpawnReader(/*is_following=*/false);
  EXPECT_THAT(seen_->seqs, IsEmpty());
  Order("read");
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2, 3, 4));
  EXPECT_THAT(seen_->results, ElementsAre(""));
  AddRows(1);
  PostFromStorage(News(store_.last_row()));
  EXPECT_THAT(seen_->seqs, SizeIs(4));
  Order("read");
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2, 3, 4, 5));
  EXPECT_THAT(seen_->results, ElementsAre("", ""));
}

TEST_F(RecordReaderTest, ARepeatedRequestCoversRecordsStoredUntilThen) {
  SpawnReader(/*is_following=*/false);
  Order("read");
  const proto::Message question = TakeQuestions().at(0);
  Order("read");
  EXPECT_THAT(TakeQuestions(), IsEmpty());
  PostFromStorage(Answer(question, {1}));
  EXPECT_THAT(seen_->results, IsEmpty());
  PostFromStorage(Answer(TakeQuestions().at(0), {2}));
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2));
  EXPECT_THAT(seen_->results, ElementsAre(""));
}

TEST_F(RecordReaderTest, AReadingReportsAnErrorAndTheNextOneContinues) {
  SpawnReader(/*is_following=*/false);
  Order("read");
  PostFromStorage(Answer(TakeQuestions().at(0), {1}, /*is_complete=*/false));
  team_.AdvanceTime(seconds(31));
  Order("read");
  std::vector<proto::Message> questions = TakeQuestions();
  proto::Message failed = Answer(questions.back(), {});
  *failed.mutable_read_reply()->mutable_error() = ToProto(Error{ErrorCode::kInternal, "the disk does not answer", {}});
  PostFromStorage(std::move(failed));
  Order("read");
  questions = TakeQuestions();
  EXPECT_EQ(questions.at(0).read_request().after_row_id(), 1u);
  PostFromStorage(Answer(questions.at(0), {2}));
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2));
  EXPECT_THAT(seen_->results, ElementsAre("storage did not answer", "the disk does not answer", ""));
}

TEST_F(RecordReaderTest, AReadingEndsAtOnceIfStorageCannotBeReached) {
  SpawnStorage({.messages_max = 1});
  SpawnReader(/*is_following=*/false);
  proto::Message order;
  order.mutable_custom()->set_value("read");
  Post({kSelf, "test"}, kReader, std::move(order));
  Post({kSelf, "test"}, kStorage, Numbered(1));
  team_.RunUntilIdle();
  EXPECT_THAT(seen_->results, ElementsAre("storage does not accept requests: full"));
}

TEST_F(RecordReaderTest, ARefusedRecordEndsTheReadingAndIsPassedAgain) {
  SpawnStorage();
  AddRows(5);
  seen_->refused_seq = 2;
  SpawnReader(/*is_following=*/false);
  Order("read");
  EXPECT_THAT(seen_->seqs, ElementsAre(1));
  EXPECT_THAT(seen_->results, ElementsAre("no more"));
  seen_->refused_seq = 0;
  Order("read");
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2, 3, 4, 5));
}

TEST_F(RecordReaderTest, RestartsAtTheFirstRecordAndIgnoresEarlierPages) {
  SpawnReader(/*is_following=*/false);
  Order("read");
  PostFromStorage(Answer(TakeQuestions().at(0), {1, 2}, /*is_complete=*/false));
  const proto::Message before = TakeQuestions().at(0);
  Order("read anew");
  PostFromStorage(Answer(before, {3}));
  const std::vector<proto::Message> questions = TakeQuestions();
  ASSERT_THAT(questions, SizeIs(1));
  EXPECT_EQ(questions[0].read_request().after_row_id(), 0u);
  PostFromStorage(Answer(questions[0], {1, 2, 3}));
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2, 1, 2, 3));
}

TEST_F(RecordReaderTest, IgnoresAnswersWhileStopped) {
  SpawnReader(/*is_following=*/false);
  Order("read");
  const proto::Message question = TakeQuestions().at(0);
  Order("stop");
  PostFromStorage(Answer(question, {1}));
  team_.AdvanceTime(seconds(60));
  EXPECT_THAT(seen_->seqs, IsEmpty());
  EXPECT_THAT(TakeQuestions(), IsEmpty());
  Order("read");
  PostFromStorage(Answer(TakeQuestions().at(0), {1}));
  EXPECT_THAT(seen_->seqs, ElementsAre(1));
}

// Storage never sends a page without a record. A reader that continued after such a page would send requests forever.
TEST_F(RecordReaderTest, APageWithoutARecordIsTheLast) {
  SpawnReader(/*is_following=*/false);
  Order("read");
  PostFromStorage(Answer(TakeQuestions().at(0), {}, /*is_complete=*/false));
  EXPECT_THAT(TakeQuestions(), IsEmpty());
  EXPECT_THAT(seen_->results, ElementsAre(""));
}

TEST_F(RecordReaderTest, ARestartedActorReadsFromTheFirstRecord) {
  SpawnStorage();
  AddRows(4);
  SpawnReader(/*is_following=*/true);
  seen_->seqs.clear();
  team_.CrashActor(kReader);
  team_.RunUntilIdle();
  EXPECT_THAT(seen_->seqs, ElementsAre(1, 2, 3, 4));
}

}  // namespace
}  // namespace moondb
