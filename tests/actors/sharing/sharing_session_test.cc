#include "actors/sharing/sharing_session.h"

#include <gtest/gtest.h>

#include <random>

#include "actors/sharing/run_decoders.h"
#include "tests/actors/sharing/coding/records.h"
#include "tests/actors/sharing/memory_store.h"

namespace moondb {
namespace {

using std::chrono::seconds;

using Window = SharingSession::Window;

constexpr AgentId kSelf = 2;
constexpr AgentId kDestination = 1;

std::string Noise(std::size_t size) {
  static std::mt19937_64 rng(1);
  std::string bytes(size, '\0');
  for (char& byte : bytes) byte = static_cast<char>(rng());
  return bytes;
}

// A session with a store on each side. Storage answers at once; the destination answers when a test says so.
class SharingSessionTest : public testing::Test {
 protected:
  void Order() { Take(session_.Order(proto::RecordFilter(), now_)); }

  void Take(SharingActions actions) {
    for (SharingAction& action : actions) {
      if (action.to != 0) {
        EXPECT_EQ(action.to, kDestination);
        sent_.push_back(std::move(action.message));
      } else if (action.message.has_missing_request()) {
        asked_for_ = action.message.missing_request().filter();
        Take(session_.OnMissingReply(action.message.request_id(), source_.Missing(action.message.missing_request()),
                                     now_));
      } else if (action.message.has_peer_have()) {
        peer_haves_.push_back(action.message.peer_have());
      }
    }
  }

  std::vector<proto::Message> TakeSent() { return std::exchange(sent_, {}); }

  // The session id of the last Hello; forgets all else that was sent before.
  std::uint64_t TakeHello() {
    const auto sent = TakeSent();
    EXPECT_FALSE(sent.empty());
    EXPECT_TRUE(sent.back().has_hello());
    return sent.back().hello().session_id();
  }

  void AnswerHello(std::uint32_t credit = 8 * 1024) {
    proto::Have have;
    have.set_session_id(TakeHello());
    *have.mutable_have() = destination_.Have().have();
    have.set_is_whole(true);
    have.set_unacked_bytes_max(credit_ = credit);
    have.set_bytes_per_second_max(granted_rate_);
    *have.mutable_schemas() = schemas_;
    have.set_part_hash(pieces_.PartFrom(kSelf).hash);
    have.set_part_bytes(pieces_.PartFrom(kSelf).bytes);
    for (const proto::Codec codec : codecs_) have.add_codecs(codec);
    have.set_keeps_runs(are_runs_kept_ && runs_.TakePlace(kSelf, now_));
    Take(session_.OnHave(have, now_));
  }

  // The destination stores a batch; what it acknowledges.
  proto::Have Store(const proto::Message& message) {
    const proto::Batch& batch = message.batch();
    std::string coded = batch.coded();
    if (batch.has_piece()) {
      const auto whole = *pieces_.Take(kSelf, batch);
      if (!whole) return AcknowledgmentOf(batch);
      coded = *whole;
    }
    proto::StoreRequest request;
    proto::Have have = AcknowledgmentOf(batch);
    const auto records = runs_.Decode(kSelf, batch, coded, now_);
    if (!records) {
      EXPECT_EQ(records.error().code, ErrorCode::kNotFound) << ToString(records.error());
      have.set_needs_new_run(true);
      return have;
    }
    *request.mutable_records() = records->records();
    *request.mutable_dropped() = batch.dropped();
    *have.mutable_have() = destination_.Store(request).had();
    return have;
  }

  proto::Have AcknowledgmentOf(const proto::Batch& batch) const {
    proto::Have have;
    have.set_session_id(batch.session_id());
    have.set_batch_number(batch.batch_number());
    have.set_unacked_bytes_max(credit_);
    have.set_bytes_per_second_max(granted_rate_);
    return have;
  }

  void Acknowledge(const proto::Message& batch) { Take(session_.OnHave(Store(batch), now_)); }

  void InsertMaps(int count, int first = 0) {
    const proto::RecordBatch maps = MapBatch(first, count);
    for (const proto::StoredRecord& map : maps.records()) {
      source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, map.content());
    }
    codecs_ = {proto::CODEC_COMPACT};
  }

  // Orders once these are stored as well; the destination answers the Hello.
  void OrderMaps(int count, int first = 0, std::uint32_t credit = 8 * 1024) {
    InsertMaps(count, first);
    Order();
    AnswerHello(credit);
  }

  // One that is too large for a message.
  void InsertNoiseMap(int index, int side) {
    const auto any_cell = [this](int, int, int) { return static_cast<Cell>(rng_() % 3); };
    const proto::StoredRecord map = MapOf(DrawLayers(1, side, side, any_cell), index);
    source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, map.content());
  }

  static bool IsReadByItself(const proto::Message& message) {
    const proto::Batch& batch = message.batch();
    return DecodeBatch(batch.codec(), batch.coded(), batch.record_count()).has_value();
  }

  // Stores and acknowledges until nothing is sent any more; all batches.
  std::vector<proto::Message> RunToEnd() {
    std::vector<proto::Message> batches;
    while (!sent_.empty()) {
      for (proto::Message& message : TakeSent()) {
        Acknowledge(message);
        batches.push_back(std::move(message));
      }
    }
    return batches;
  }

  // The destination stores and acknowledges at once; coded bytes that came until then.
  std::size_t BytesUntil(SharingSession::Time end) {
    std::size_t bytes = 0;
    while (now_ < end) {
      for (const proto::Message& message : TakeSent()) {
        if (!message.has_batch()) continue;
        bytes += message.batch().ByteSizeLong();
        Acknowledge(message);
      }
      if (sent_.empty()) Advance(std::chrono::milliseconds(100));
    }
    return bytes;
  }

  // Time passes in small steps.
  void Advance(std::chrono::nanoseconds duration) {
    for (const auto end = now_ + duration; now_ < end;) {
      now_ += std::chrono::milliseconds(100);
      Take(session_.OnTimer(now_));
    }
  }

  static proto::RecordFilter States() {
    proto::RecordFilter states;
    states.add_origin_agents(kSelf);
    states.add_data_types(proto::POWER);
    return states;
  }

  proto::ShareSession Status() const { return session_.Status(now_); }

  static SharingSession::Options Options() {
    SharingSession::Options options;
    options.state_types = {proto::POWER, proto::MODE};
    options.schemas = SchemasOf({});
    return options;
  }

  SharingSession session_{Options(), proto::SHARING_KIND_SYNC, kDestination, 1000};
  SharingSession::Time now_{};
  std::uint32_t credit_ = 8 * 1024;   // That the destination grants.
  std::uint32_t granted_rate_ = 0;    // Likewise.
  TypeSchemas schemas_;               // Of the destination, where it tells them.
  std::vector<proto::Codec> codecs_;  // That the destination reads, as it says.
  MemoryStore source_;
  MemoryStore destination_;
  PieceCollector pieces_{1'000'000};  // The destination's, as is the next.
  RunDecoders runs_{1, {}};
  bool are_runs_kept_ = true;
  std::mt19937_64 rng_{3};
  std::vector<proto::Message> sent_;
  std::vector<proto::PeerHave> peer_haves_;
  proto::RecordFilter asked_for_;  // The last filter that storage was given.
};

TEST_F(SharingSessionTest, SaysHowEachAgentsNewestOrderEnded) {
  const auto order = [this](std::uint64_t number, AgentId agent, std::uint64_t bytes_max = 0) {
    Take(session_.Order(proto::RecordFilter(), now_, bytes_max, {agent, number}));
  };
  order(41, kDestination);
  order(7, kSelf);
  source_.Insert(kSelf, proto::POWER, "a");
  AnswerHello();
  RunToEnd();
  order(42, kDestination);
  Take(session_.Close());
  const proto::ShareSession status = session_.Status(now_);
  ASSERT_EQ(status.orders_size(), 2);
  EXPECT_EQ(status.orders(0).agent(), kDestination);
  EXPECT_EQ(status.orders(0).ordered(), 42u);
  EXPECT_EQ(status.orders(0).completed(), 41u);
  EXPECT_EQ(status.orders(0).closed(), 42u);
  EXPECT_EQ(status.orders(1).agent(), kSelf);
  EXPECT_EQ(status.orders(1).completed(), 7u);
  EXPECT_EQ(status.orders(1).closed(), 0u) << "it had ended before";
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POWER, Noise(100));
  order(43, kDestination, /*bytes_max=*/1000);
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(session_.Status(now_).orders(0).limited(), 43u);
  EXPECT_EQ(session_.Status(now_).orders(0).completed(), 41u);
}

TEST_F(SharingSessionTest, IsSilentUntilOrdered) {
  EXPECT_FALSE(session_.is_open());
  EXPECT_FALSE(session_.deadline());
  Advance(seconds(100));
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(SharingSessionTest, AsksForTheHaveSetBeforeAnythingIsSent) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  const auto sent = TakeSent();
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_TRUE(sent[0].has_hello());
  EXPECT_EQ(sent[0].hello().kind(), proto::SHARING_KIND_SYNC);
}

TEST_F(SharingSessionTest, SaysThatNothingIsMissingAndCompletes) {
  Order();
  AnswerHello();
  const auto batches = RunToEnd();
  ASSERT_EQ(batches.size(), 1u);
  EXPECT_EQ(batches[0].remaining(), 0u);
  EXPECT_EQ(batches[0].batch().record_count(), 0u);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().completed_sessions(), 1);
  EXPECT_TRUE(peer_haves_.back().is_session_closed());
}

TEST_F(SharingSessionTest, AnOrderInAShutWindowWaitsForItToOpen) {
  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, "n");
  Take(session_.SetWindow(Window::kShut, now_));
  Order();
  Take(session_.OnConnected(now_));
  EXPECT_FALSE(session_.deadline());
  Advance(seconds(100));
  EXPECT_TRUE(session_.is_open());
  EXPECT_TRUE(TakeSent().empty());
  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, TakesAcknowledgmentsInAShutWindowAndGoesOnWhereItStopped) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  const auto first = TakeSent();
  ASSERT_GE(first.size(), 2u);
  Take(session_.SetWindow(Window::kShut, now_));
  Advance(seconds(100));
  for (const proto::Message& batch : first) Acknowledge(batch);
  proto::Refusal restarted;
  restarted.set_session_id(first[0].batch().session_id());
  restarted.mutable_error()->set_code(proto::ERROR_CODE_NOT_FOUND);
  Take(session_.OnRefusal(restarted, now_));
  Advance(seconds(100));
  EXPECT_TRUE(TakeSent().empty());
  const double acknowledged = Status().acknowledged_records();
  EXPECT_EQ(acknowledged, Status().sent_records());
  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().sent_records(), 300);
}

TEST_F(SharingSessionTest, CompletesInAShutWindowWhenAllIsAcknowledged) {
  Order();
  AnswerHello();
  const auto end = TakeSent();
  Take(session_.SetWindow(Window::kShut, now_));
  for (const proto::Message& batch : end) Acknowledge(batch);
  EXPECT_FALSE(session_.is_open());
  Take(session_.SetWindow(Window::kOpen, now_));
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(SharingSessionTest, StatesPassAWindowForStatesAndTheRestWaits) {
  source_.Insert(kSelf, proto::POWER, "p");
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Take(session_.SetWindow(Window::kStatesOnly, now_));
  Order();
  AnswerHello();
  auto batches = RunToEnd();
  ASSERT_EQ(batches.size(), 1u);
  EXPECT_EQ(batches[0].data_type(), static_cast<std::uint32_t>(proto::POWER));
  EXPECT_EQ(batches[0].batch().record_count(), 1u);
  EXPECT_GT(batches[0].remaining(), 0u) << "it is not the end of the order";
  EXPECT_TRUE(session_.is_open());
  EXPECT_FALSE(session_.deadline());
  Acknowledge(batches[0]);  // Once more.
  Advance(seconds(100));
  EXPECT_TRUE(TakeSent().empty());

  Order();  // Nothing new: a Hello, and no batch.
  AnswerHello();
  EXPECT_TRUE(TakeSent().empty());

  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  batches = RunToEnd();
  EXPECT_EQ(batches.back().remaining(), 0u);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().sent_records(), 101);
}

TEST_F(SharingSessionTest, ADriveThatBeginsStopsStatesTooUntilTheNextOrder) {
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  TakeSent();
  Take(session_.SetWindow(Window::kStatesOnly, now_));
  EXPECT_TRUE(TakeSent().empty());
  source_.Insert(kSelf, proto::MODE, "m");
  Order();
  AnswerHello();
  const auto sent = TakeSent();
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].data_type(), static_cast<std::uint32_t>(proto::MODE));
  Take(session_.SetWindow(Window::kShut, now_));
  Acknowledge(sent[0]);
  EXPECT_TRUE(session_.is_open()) << "what is not a state was not sent";
  EXPECT_TRUE(TakeSent().empty());
  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, AsksForStatesOnlyInAWindowForStates) {
  proto::RecordFilter filter;
  filter.add_origin_agents(kSelf);
  filter.add_data_types(proto::POWER);
  filter.add_data_types(proto::POSE_GRAPH_NODE);
  filter.set_own_records_of(kDestination);
  Take(session_.SetWindow(Window::kStatesOnly, now_));
  Take(session_.Order(filter, now_));
  AnswerHello();
  proto::RecordFilter states;
  states.add_origin_agents(kSelf);
  states.add_data_types(proto::POWER);
  EXPECT_EQ(asked_for_.DebugString(), states.DebugString());
  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  EXPECT_EQ(asked_for_.DebugString(), filter.DebugString());
}

TEST_F(SharingSessionTest, AnOrderWithoutStatesWaits) {
  source_.Insert(kSelf, proto::POWER, "p");
  proto::RecordFilter filter;
  filter.add_data_types(proto::POSE_GRAPH_NODE);
  filter.set_own_records_of(kDestination);
  Take(session_.SetWindow(Window::kStatesOnly, now_));
  Take(session_.Order(filter, now_));
  EXPECT_TRUE(session_.is_open());
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(SharingSessionTest, TellsWhatIsAcknowledgedSinceTheDestinationAnswered) {
  for (int i = 0; i < 200; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(100));
  Order();
  Advance(seconds(3));
  EXPECT_FALSE(Status().is_remaining_known());
  EXPECT_EQ(Status().session_s(), 0);
  AnswerHello();
  EXPECT_TRUE(Status().is_remaining_known());
  EXPECT_EQ(Status().remaining(), 200);
  Advance(seconds(2));
  Acknowledge(TakeSent().front());
  EXPECT_EQ(Status().session_s(), 2);
  EXPECT_GT(Status().session_acknowledged_records(), 0);
  EXPECT_EQ(Status().session_acknowledged_records() + Status().remaining(), 200);
  EXPECT_GT(Status().session_acknowledged_bytes(), 100 * Status().session_acknowledged_records());

  // Reached again: what is left is not known, and time counts from the new answer.
  Advance(seconds(1));
  Take(session_.OnConnected(now_));
  EXPECT_FALSE(Status().is_remaining_known());
  EXPECT_EQ(Status().session_s(), 0);
  Advance(seconds(1));
  AnswerHello();
  Advance(seconds(1));
  EXPECT_EQ(Status().session_s(), 1);
  EXPECT_EQ(Status().session_acknowledged_records(), 0);
  EXPECT_GT(Status().acknowledged_records(), 0);
  RunToEnd();
  EXPECT_TRUE(Status().is_remaining_known());
  EXPECT_EQ(Status().session_s(), 0);

  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, "one more");
  Order();
  Take(session_.Close());
  EXPECT_FALSE(Status().is_remaining_known());
}

TEST_F(SharingSessionTest, BringsWhatIsMissingAndNothingElse) {
  for (int i = 0; i < 300; ++i) {
    const RecordKey key = source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(60));
    if (i % 3 == 0) destination_.Insert(kSelf, proto::POSE_GRAPH_NODE, source_.records().at(key));
  }
  // The destination holds seqs 1 to 100 by now; 200 are missing.
  for (const auto& [key, content] : destination_.records()) ASSERT_LE(key.seq, 100u);
  Order();
  AnswerHello();
  std::uint32_t count = 0;
  for (const auto& message : RunToEnd()) count += message.batch().record_count();
  EXPECT_EQ(count, 200u);
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().sent_records(), 200);
  EXPECT_EQ(Status().acknowledged_records(), 200);
  EXPECT_EQ(Status().remaining(), 0);
  EXPECT_EQ(Status().resends(), 0);
}

TEST_F(SharingSessionTest, FillsThePapersFieldsTruthfully) {
  const RecordKey first = source_.Insert(3, proto::POSE_GRAPH_NODE, Noise(2000));
  source_.Insert(3, proto::POSE_GRAPH_NODE, Noise(3900));
  Order();
  AnswerHello();
  const auto batches = RunToEnd();
  ASSERT_EQ(batches.size(), 2u);
  EXPECT_EQ(batches[0].ms_type(), proto::DATA);
  EXPECT_EQ(batches[0].agent_id(), 3u);
  EXPECT_EQ(batches[0].destination_id(), kDestination);
  EXPECT_EQ(batches[0].data_type(), static_cast<std::uint32_t>(proto::POSE_GRAPH_NODE));
  EXPECT_EQ(batches[0].record_id(), ToString(first));
  EXPECT_EQ(batches[0].remaining(), 1u);
  EXPECT_EQ(batches[1].remaining(), 0u);
}

TEST_F(SharingSessionTest, CountsRemainingDownToZero) {
  for (int i = 0; i < 500; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(90));
  Order();
  AnswerHello();
  std::uint64_t left = 500;
  for (const auto& message : RunToEnd()) {
    left -= message.batch().record_count();
    EXPECT_EQ(message.remaining(), left);
  }
  EXPECT_EQ(left, 0u);
}

TEST_F(SharingSessionTest, KeepsMessagesSmallAndUnacknowledgedBytesWithinTheCredit) {
  for (int i = 0; i < 500; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  std::vector<proto::Message> under_way;
  std::size_t most_under_way = 0;
  while (session_.is_open()) {
    for (proto::Message& message : TakeSent()) {
      EXPECT_LE(message.batch().coded().size(), 4096u);
      under_way.push_back(std::move(message));
    }
    std::size_t bytes = 0;
    for (const auto& message : under_way) bytes += message.batch().ByteSizeLong();
    EXPECT_LE(bytes, 8u * 1024);
    most_under_way = std::max(most_under_way, under_way.size());
    ASSERT_FALSE(under_way.empty());
    Acknowledge(under_way.front());
    under_way.erase(under_way.begin());
  }
  EXPECT_GE(most_under_way, 2u);  // The radio is never idle while an acknowledgment travels.
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, FillsMessagesWellWhateverTheContentIsLike) {
  for (int i = 0; i < 2000; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, std::string(90, 'x') + Noise(3));
  Order();
  AnswerHello();
  const auto batches = RunToEnd();
  std::size_t bytes = 0;
  for (const auto& message : batches) bytes += message.batch().coded().size();
  EXPECT_GT(static_cast<double>(bytes) / static_cast<double>(batches.size()), 2500.0);
}

TEST_F(SharingSessionTest, SendsALargeRecordInPieces) {
  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(100));
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(100'000));
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(100));
  Order();
  AnswerHello();
  std::size_t pieces = 0;
  std::uint64_t remaining = 3;
  while (!sent_.empty()) {
    std::size_t unacked = 0;
    for (const proto::Message& message : sent_) unacked += message.batch().ByteSizeLong();
    EXPECT_LE(unacked, 8 * 1024u);
    for (const proto::Message& message : TakeSent()) {
      pieces += message.batch().has_piece() ? 1 : 0;
      EXPECT_LE(message.batch().coded().size(), 4096u);
      EXPECT_LE(message.remaining(), remaining);
      remaining = message.remaining();
      Acknowledge(message);
    }
  }
  EXPECT_EQ(pieces, 25u);
  EXPECT_EQ(remaining, 0u);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().acknowledged_records(), 3);
  EXPECT_EQ(Status().remaining(), 0);
}

TEST_F(SharingSessionTest, AnOrderInTheMiddleOfTheLastRecordPutsOffTheEnd) {
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(10'000));
  Order();
  AnswerHello();
  const auto first = TakeSent();
  ASSERT_EQ(first.size(), 2u) << "two pieces fit into the credit";
  Acknowledge(first[0]);
  Acknowledge(first[1]);
  EXPECT_TRUE(sent_.back().batch().has_piece());
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(100));
  Order();
  std::size_t pieces = first.size();
  for (const proto::Message& message : RunToEnd()) {
    pieces += message.batch().has_piece() ? 1 : 0;
    EXPECT_EQ(message.remaining() == 0, destination_.records().size() == 2u);
  }
  EXPECT_EQ(pieces, 3u) << "nothing was cut anew";
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
}

// Pieces are acknowledged before anything is stored: that is no progress.
TEST_F(SharingSessionTest, TriesALargeRecordLessAndLessOftenWhereItCannotBeStored) {
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(10'000));
  Order();
  std::size_t hellos = 0;
  for (int i = 0; i < 1000; ++i) {  // 100 s.
    Advance(std::chrono::milliseconds(100));
    for (const proto::Message& message : TakeSent()) {
      if (message.has_hello()) {
        ++hellos;
        sent_.push_back(message);
        AnswerHello();
      } else if (const auto whole = *pieces_.Take(kSelf, message.batch()); !whole) {
        Take(session_.OnHave(AcknowledgmentOf(message.batch()), now_));
      } else {
        proto::Refusal full;
        full.set_session_id(message.batch().session_id());
        full.mutable_error()->set_code(proto::ERROR_CODE_UNAVAILABLE);
        Take(session_.OnRefusal(full, now_));
      }
    }
  }
  EXPECT_GE(hellos, 3u);
  EXPECT_LE(hellos, 6u) << "after 5, 10, 20 and 30 s";
}

TEST_F(SharingSessionTest, GoesOnInALargeRecordWhereACutEndedIt) {
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(100'000));
  Order();
  AnswerHello();
  std::size_t pieces = 0;
  for (; pieces < 10; ++pieces) {
    const proto::Message piece = sent_.front();
    sent_.erase(sent_.begin());
    Acknowledge(piece);
  }
  TakeSent();  // Lost.
  Take(session_.OnConnected(now_));
  AnswerHello();
  pieces += RunToEnd().size();
  EXPECT_EQ(pieces, 25u) << "what had arrived was not sent again";
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, SendsOneMessageAtATimeWithoutCredit) {
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello(/*credit=*/0);
  while (session_.is_open()) {
    const auto sent = TakeSent();
    ASSERT_EQ(sent.size(), 1u);
    Acknowledge(sent[0]);
  }
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, KeepsToTheCreditThatItWasGrantedLast) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  std::vector<proto::Message> sent = TakeSent();
  ASSERT_EQ(sent.size(), 2u);
  credit_ = 2048;  // Others have begun to send there.
  for (const proto::Message& batch : sent) Acknowledge(batch);
  for (int i = 0; i < 4; ++i) {
    sent = TakeSent();
    ASSERT_EQ(sent.size(), 1u);
    EXPECT_LE(sent[0].batch().coded().size(), i == 0 ? 4096u : 2048u) << "the first was ready before";
    if (i == 3) credit_ = 8192;
    Acknowledge(sent[0]);
  }
  EXPECT_EQ(TakeSent().size(), 2u);
  sent_ = {};
}

TEST_F(SharingSessionTest, ResendsUntilAcknowledgedWithAGrowingDelay) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  std::vector<double> hellos_s;
  for (int step = 0; step < 1400; ++step) {
    for (const auto& message : TakeSent()) {
      ASSERT_TRUE(message.has_hello());
      hellos_s.push_back(std::chrono::duration<double>(now_.time_since_epoch()).count());
    }
    Advance(std::chrono::milliseconds(100));
  }
  const std::vector<double> expected_s = {0, 5, 15, 35, 65, 95, 125};
  ASSERT_EQ(hellos_s.size(), expected_s.size());
  for (std::size_t i = 0; i < expected_s.size(); ++i) EXPECT_NEAR(hellos_s[i], expected_s[i], 0.15);
  EXPECT_EQ(Status().resends(), 6);
  Take(session_.OnConnected(now_));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  Advance(seconds(1000));
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(SharingSessionTest, StartsOverFromTheHaveSetWhenAnAcknowledgmentIsLost) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  AnswerHello();
  const auto sent = TakeSent();
  ASSERT_EQ(sent.size(), 1u);
  Store(sent[0]);  // Its acknowledgment does not arrive.
  Advance(seconds(6));
  AnswerHello();
  for (const auto& batch : RunToEnd()) EXPECT_EQ(batch.batch().record_count(), 0u);
  EXPECT_EQ(Status().completed_sessions(), 1);
  EXPECT_EQ(Status().sent_records(), 1);
}

TEST_F(SharingSessionTest, SendsALostBatchAgainBeforeTheRestEnds) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  bool is_first = true;
  while (session_.is_open()) {
    const auto sent = TakeSent();
    ASSERT_FALSE(sent.empty());
    for (const auto& message : sent) {
      if (!std::exchange(is_first, false)) Acknowledge(message);
    }
  }
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 1);
}

// Whoever gets a batch with nothing remaining has all: so nothing that comes before it is still open.
TEST_F(SharingSessionTest, SaysTheEndOnlyWhenAllBeforeItIsAcknowledged) {
  for (int i = 0; i < 3; ++i) source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(3000));
  Order();
  AnswerHello();
  std::vector<proto::Message> sent = TakeSent();
  ASSERT_EQ(sent.size(), 2u) << "the last one waits for these";
  EXPECT_EQ(sent[1].remaining(), 1u);
  Acknowledge(sent[1]);
  EXPECT_TRUE(TakeSent().empty()) << "the first one is still open";
  const proto::Have late = Store(sent[0]);
  Take(session_.OnHave(late, now_));
  sent = TakeSent();
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].remaining(), 0u);
  EXPECT_EQ(destination_.records().size() + sent[0].batch().record_count(), 3u);
}

TEST_F(SharingSessionTest, GivesUpALostBatchBeforeItSaysTheEnd) {
  for (int i = 0; i < 4; ++i) source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(3000));
  Order();
  AnswerHello();
  const std::vector<proto::Message> sent = TakeSent();
  ASSERT_EQ(sent.size(), 2u);
  Acknowledge(sent[1]);  // The first one was lost.
  std::uint64_t had = 1;
  for (const proto::Message& message : RunToEnd()) {
    had += message.batch().record_count();
    EXPECT_EQ(message.remaining() == 0, had == 4u);
  }
  EXPECT_EQ(destination_.records().size(), 4u);
  EXPECT_FALSE(session_.is_open());
}

TEST_F(SharingSessionTest, StartsOverAtOnceWhenTheDestinationIsReachedAgain) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  const std::uint64_t first = TakeHello();
  Advance(seconds(1));
  Take(session_.OnConnected(now_));
  const std::uint64_t second = TakeHello();
  EXPECT_NE(first, second);
  Take(session_.OnConnected(now_));
  AnswerHello();
  RunToEnd();
  Take(session_.OnConnected(now_));  // Nothing is unfinished.
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(SharingSessionTest, IgnoresWhatBelongsToAnEarlierSession) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  proto::Have old;
  old.set_session_id(TakeHello());
  old.set_is_whole(true);
  Advance(seconds(6));
  Take(session_.OnHave(old, now_));
  for (const auto& message : TakeSent()) EXPECT_TRUE(message.has_hello());
  proto::Refusal refusal;
  refusal.set_session_id(old.session_id());
  refusal.mutable_error()->set_code(proto::ERROR_CODE_REFUSED);
  Take(session_.OnRefusal(refusal, now_));
  EXPECT_TRUE(session_.is_open());
}

TEST_F(SharingSessionTest, StartsOverOnceWhenTheDestinationForgotTheSession) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  proto::Refusal refusal;
  refusal.set_session_id(TakeHello());
  refusal.mutable_error()->set_code(proto::ERROR_CODE_NOT_FOUND);
  Take(session_.OnRefusal(refusal, now_));
  refusal.set_session_id(TakeHello());
  Take(session_.OnRefusal(refusal, now_));
  EXPECT_TRUE(TakeSent().empty());  // No tight loop: the delay serves from here.
  Advance(seconds(6));
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, EndsWithTheReasonWhenItIsRefused) {
  Order();
  proto::Refusal refusal;
  refusal.set_session_id(TakeHello());
  refusal.mutable_error()->set_code(proto::ERROR_CODE_REFUSED);
  refusal.mutable_error()->set_text("this agent is of another team");
  Take(session_.OnRefusal(refusal, now_));
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().last_error(), "the destination refused: this agent is of another team");
  Advance(seconds(100));
  EXPECT_TRUE(TakeSent().empty());
}

TEST_F(SharingSessionTest, DoesNotRepeatWhatTheDestinationDoesNotTake) {
  destination_.Reject(proto::POWER);
  source_.Insert(kSelf, proto::POWER, "p");
  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, "n");
  Order();
  AnswerHello();
  EXPECT_EQ(RunToEnd().size(), 1u);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().acknowledged_records(), 1);
  EXPECT_EQ(Status().last_error(), "the destination did not take 1 records");
}

TEST_F(SharingSessionTest, TellsInSmallMessagesWhatIsDropped) {
  for (int i = 0; i < 4000; ++i) {
    const RecordKey key = source_.Insert(kSelf, proto::OPTIMIZED_POSE, "p");
    if (i % 2 == 1) source_.Drop(key);
  }
  Order();
  AnswerHello();
  for (const auto& message : RunToEnd()) EXPECT_LE(message.batch().ByteSizeLong(), 4u * 1024 + 64);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, TellsWhatIsDroppedOnlyWithTheLastRecords) {
  // What packs well comes first, so that more records than fit are asked for when the noise comes.
  for (int i = 0; i < 2000; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, std::string(90, 'x'));
  for (int i = 0; i < 40; ++i) source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(500));
  source_.Drop(source_.Insert(kSelf, proto::POWER, "old"));
  Order();
  AnswerHello();
  const auto batches = RunToEnd();
  ASSERT_GT(batches.size(), 6u);
  for (const auto& message : batches) {
    if (message.remaining() > 0) {
      EXPECT_EQ(message.batch().dropped_size(), 0);
    }
  }
  EXPECT_EQ(destination_.have(), source_.have());
  Order();
  AnswerHello();
  for (const auto& batch : RunToEnd()) EXPECT_EQ(batch.batch().dropped_size(), 0);  // Once is enough.
}

TEST_F(SharingSessionTest, TellsWhatIsDroppedWhenNoRecordIsMissing) {
  source_.Drop(source_.Insert(kSelf, proto::POWER, "old"));
  Order();
  AnswerHello();
  const auto batches = RunToEnd();
  ASSERT_EQ(batches.size(), 1u);
  EXPECT_EQ(batches[0].batch().record_count(), 0u);
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, IncludesWhatWasStoredBeforeALaterOrder) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  AnswerHello();
  auto sent = TakeSent();
  ASSERT_EQ(sent.size(), 1u);
  source_.Insert(kSelf, proto::POWER, "q");
  Order();
  Acknowledge(sent[0]);
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().completed_sessions(), 1);
}

TEST_F(SharingSessionTest, TellsStorageWhatItHandedOverAndWhatCameOfIt) {
  const RecordKey key = source_.Insert(kSelf, proto::POWER, "p");
  Order();
  AnswerHello();
  const auto sent = TakeSent();
  ASSERT_EQ(peer_haves_.back().handed_over_size(), 1);
  EXPECT_EQ(FromProto(peer_haves_.back().handed_over(0)), key);
  EXPECT_EQ(peer_haves_.back().peer(), kDestination);
  Acknowledge(sent[0]);
  EXPECT_TRUE(peer_haves_.back().is_session_closed());
  EXPECT_TRUE(FromProto(peer_haves_.back().acknowledged())->Get(key.stream).held.Contains(key.seq));
}

TEST_F(SharingSessionTest, StaysOpenWhenStorageCannotSayWhatIsMissing) {
  source_.Insert(kSelf, proto::POWER, "p");
  SharingActions actions = session_.Order(proto::RecordFilter(), now_);
  proto::Have have;
  have.set_session_id(actions.back().message.hello().session_id());
  have.set_is_whole(true);
  actions = session_.OnHave(have, now_);
  ASSERT_TRUE(actions.back().message.has_missing_request());
  proto::MissingReply failed;
  failed.set_remaining(1);
  EXPECT_TRUE(session_.OnMissingReply(actions.back().message.request_id(), failed, now_).empty());
  EXPECT_TRUE(session_.is_open());
  Advance(seconds(6));
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, ForgetsTheOrderWhenClosed) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  TakeSent();
  Take(session_.Close());
  Advance(seconds(100));
  EXPECT_TRUE(TakeSent().empty());
  EXPECT_FALSE(session_.deadline());
}

// What the destination has not been asked for, it has not said that it lacks.
TEST_F(SharingSessionTest, AsksOnlyForTheOriginsThatItsFilterMeansAndAgainForOthers) {
  for (int i = 0; i < 20; ++i) {
    const RecordKey other = source_.Insert(kSelf + 1, proto::POSE_GRAPH_NODE, Noise(60));
    destination_.Insert(kSelf + 1, proto::POSE_GRAPH_NODE, source_.records().at(other));
    source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(60));
  }
  proto::RecordFilter own;
  own.add_origin_agents(kSelf);
  Take(session_.Order(own, now_));
  ASSERT_EQ(sent_.size(), 1u);
  ASSERT_EQ(sent_[0].hello().origin_agents_size(), 1);
  EXPECT_EQ(sent_[0].hello().origin_agents(0), kSelf);
  proto::Have have;
  have.set_session_id(TakeHello());
  have.set_is_whole(true);
  have.set_unacked_bytes_max(8 * 1024);
  Take(session_.OnHave(have, now_));
  Take(session_.Order(proto::RecordFilter(), now_));  // While the first batch is under way: now everybody's.
  EXPECT_TRUE(sent_.back().has_hello());
  EXPECT_EQ(sent_.back().hello().origin_agents_size(), 0);
  AnswerHello();
  for (const auto& message : RunToEnd()) {
    const proto::Batch& batch = message.batch();
    const auto records = DecodeBatch(batch.codec(), batch.coded(), batch.record_count());
    for (const proto::StoredRecord& record : records->records()) EXPECT_EQ(record.key().origin_agent(), kSelf);
  }
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, ClosedItHasNothingLeftToDo) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  EXPECT_GT(Status().remaining(), 0);
  Take(session_.Close());
  EXPECT_EQ(Status().remaining(), 0);
}

TEST_F(SharingSessionTest, RefusesAMalformedHaveSet) {
  Order();
  proto::Have have;
  have.set_session_id(TakeHello());
  have.set_is_whole(true);
  have.mutable_have()->add_streams()->set_origin_agent(0);
  Take(session_.OnHave(have, now_));
  EXPECT_TRUE(TakeSent().empty());
  EXPECT_NE(Status().last_error(), "");
  EXPECT_EQ(Status().refused_haves(), 1);
}

TEST_F(SharingSessionTest, RefusesAnAcknowledgmentOfWhatWasNeverSent) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  const auto sent = TakeSent();
  ASSERT_GE(sent.size(), 2u);
  proto::Have have;
  have.set_session_id(sent.front().batch().session_id());
  for (const std::uint32_t number : {0u, sent.back().batch().batch_number() + 1, UINT32_MAX}) {
    have.set_batch_number(number);
    Take(session_.OnHave(have, now_));
  }
  EXPECT_TRUE(TakeSent().empty()) << "nothing is sent again";
  EXPECT_EQ(Status().resends(), 0);
  EXPECT_EQ(Status().acknowledged_records(), 0);
  EXPECT_EQ(Status().refused_haves(), 3);
  sent_ = sent;
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, BoundsWhatItKeepsOfADestinationsWords) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  const proto::Batch first = TakeSent().front().batch();
  proto::Have have;
  have.set_session_id(first.session_id());
  have.set_batch_number(first.batch_number());
  for (std::uint64_t epoch = 0; epoch < 30; ++epoch) {
    have.clear_have();
    for (AgentId origin = 1; origin <= 4096; ++origin) {
      proto::StreamHave& stream = *have.mutable_have()->add_streams();
      stream.set_origin_agent(1 + origin % kAgentIdMax);
      stream.set_epoch(epoch << 32 | origin);
      stream.set_data_type(proto::POWER);
    }
    Take(session_.OnHave(have, now_));
    TakeSent();
  }
  EXPECT_GE(Status().refused_haves(), 14);
  for (const proto::PeerHave& told : std::exchange(peer_haves_, {})) {
    EXPECT_LE(told.acknowledged().streams_size(), kHaveStreamsMax);
  }
}

TEST_F(SharingSessionTest, ShowsOfARefusalNoMoreThanALine) {
  Order();
  proto::Refusal refusal;
  refusal.set_session_id(TakeHello());
  refusal.mutable_error()->set_code(proto::ERROR_CODE_REFUSED);
  refusal.mutable_error()->set_text("no\n\xFF" + std::string(1'000'000, 'x'));
  Take(session_.OnRefusal(refusal, now_));
  EXPECT_LT(Status().last_error().size(), 400u);
  EXPECT_TRUE(proto::ShareSession().ParseFromString(Status().SerializeAsString())) << "UTF-8 as a client needs it";
}

TEST_F(SharingSessionTest, KeepsToTheSmallerOfItsOwnAndTheGrantedRate) {
  for (int i = 0; i < 2000; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  session_.SetRate(5'000, now_);
  granted_rate_ = 2'000;
  Order();
  AnswerHello();
  EXPECT_EQ(Status().bytes_per_second_max(), 2'000);
  const std::size_t granted = BytesUntil(now_ + seconds(60));
  EXPECT_GT(granted, 2'000u * 50);
  EXPECT_LT(granted, 2'000u * 60 + 12 * 1024);
  EXPECT_EQ(Status().resends(), 0) << "waiting for the rate is no silence";

  granted_rate_ = 0;
  (void)BytesUntil(now_ + seconds(3));
  EXPECT_EQ(Status().bytes_per_second_max(), 5'000);
  const std::size_t own = BytesUntil(now_ + seconds(20));
  EXPECT_GT(own, 5'000u * 16);
  EXPECT_LT(own, 5'000u * 21);
}

TEST_F(SharingSessionTest, AVerySlowRateStartsNothingAnew) {
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  session_.SetRate(125, now_);
  Order();
  AnswerHello();
  (void)BytesUntil(now_ + seconds(300));
  EXPECT_EQ(Status().resends(), 0);
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_FALSE(session_.is_open());
}

TEST_F(SharingSessionTest, ALostBatchIsNoticedAtASlowRateToo) {
  for (int i = 0; i < 100; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  session_.SetRate(125, now_);
  Order();
  AnswerHello();
  TakeSent();  // Lost.
  Advance(seconds(10));
  EXPECT_TRUE(TakeSent().back().has_hello());
}

TEST_F(SharingSessionTest, ALimitedOrderEndsWithItsBytes) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/10'000));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().completed_sessions(), 0);
  EXPECT_EQ(Status().closed_sessions(), 0);
  EXPECT_EQ(Status().limited_sessions(), 1);
  EXPECT_GE(Status().coded_bytes(), 10'000);
  EXPECT_LE(Status().coded_bytes(), 10'000 + 1200);
  EXPECT_EQ(Status().acknowledged_records(), Status().sent_records());
  EXPECT_NE(Status().last_error().find("its order's bytes"), std::string::npos) << Status().last_error();

  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/1'000'000));  // The rest fits.
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(Status().completed_sessions(), 1);
  EXPECT_EQ(Status().sent_records(), 300);
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, ALimitDoesNotNarrowAnOpenOrderWithoutOne) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Order();
  AnswerHello();
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/1'000));
  RunToEnd();
  EXPECT_EQ(Status().completed_sessions(), 1);
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, ALimitHoldsForRecordsInPiecesToo) {
  source_.Insert(kSelf, proto::LOCAL_TRAVERSABILITY_MAP, Noise(30'000));
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/10'000));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  EXPECT_LE(Status().coded_bytes(), 10'000 + 1200);
  Order();
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_LT(Status().coded_bytes(), 33'000) << "it goes on where it ended";
}

TEST_F(SharingSessionTest, CodesCompactlyForADestinationThatReadsIt) {
  OrderMaps(60);
  std::size_t batches = 0;
  for (const proto::Message& message : RunToEnd()) {
    EXPECT_EQ(message.batch().codec(), proto::CODEC_COMPACT);
    EXPECT_LE(message.batch().coded().size(), 4096u);
    ++batches;
  }
  EXPECT_LE(batches, 12u);
  EXPECT_EQ(destination_.records().size(), 60u);
  EXPECT_EQ(Status().codec(), proto::CODEC_COMPACT);
}

TEST_F(SharingSessionTest, ItsBatchesOfMapsLeanOnThoseBefore) {
  OrderMaps(60);
  const std::vector<proto::Message> batches = RunToEnd();
  ASSERT_GE(batches.size(), 3u);
  EXPECT_TRUE(IsReadByItself(batches.front()));
  for (std::size_t i = 1; i < batches.size(); ++i) EXPECT_FALSE(IsReadByItself(batches[i])) << i;
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 0);
}

TEST_F(SharingSessionTest, ARunGoesOnInTheNextOrder) {
  OrderMaps(20);
  RunToEnd();
  OrderMaps(4, 20);
  for (const proto::Message& message : RunToEnd()) EXPECT_FALSE(IsReadByItself(message));
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 0);
}

TEST_F(SharingSessionTest, ARunBeginsAnewWhereTheDestinationForgotIt) {
  OrderMaps(20);
  RunToEnd();
  InsertMaps(4, 20);
  Order();
  runs_ = RunDecoders(1, {});
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 1);
}

TEST_F(SharingSessionTest, ARunBeginsAnewWhereABatchOfItWasUnderWay) {
  OrderMaps(60, 0, 2048);
  Acknowledge(sent_.front());
  ASSERT_GT(sent_.back().remaining(), 0u);
  sent_.clear();
  Take(session_.OnConnected(now_));
  AnswerHello();
  EXPECT_TRUE(IsReadByItself(sent_.front()));
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, CodesEachBatchByItselfForADestinationThatKeepsNoRuns) {
  are_runs_kept_ = false;
  OrderMaps(60);
  for (const proto::Message& message : RunToEnd()) EXPECT_TRUE(IsReadByItself(message));
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, AnOrderBeforeTheEndCostsTheRunNothing) {
  OrderMaps(20);
  ASSERT_GT(sent_.back().remaining(), 0u) << "the end waits for these";
  InsertMaps(4, 20);
  Order();
  const std::vector<proto::Message> batches = RunToEnd();
  for (std::size_t i = 1; i < batches.size(); ++i) EXPECT_FALSE(IsReadByItself(batches[i])) << i;
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 0);
}

// Of what was coded behind the lost batch nothing leaves any more.
TEST_F(SharingSessionTest, SendsNothingMoreOfARunThatIsBroken) {
  OrderMaps(60, 0, 2048);
  const proto::Message first = sent_.front();
  sent_.erase(sent_.begin());
  Acknowledge(first);
  runs_ = RunDecoders(1, {});
  runs_.TakePlace(kSelf, now_);
  for (const proto::Message& message : TakeSent()) Acknowledge(message);
  ASSERT_FALSE(sent_.empty());
  for (const proto::Message& message : RunToEnd()) EXPECT_TRUE(IsReadByItself(message));
}

TEST_F(SharingSessionTest, ALargeMapThatLeansOnOthersIsCodedAnewWhereTheyAreNotThere) {
  OrderMaps(20);
  RunToEnd();
  InsertMaps(1, 20);
  for (int i = 21; i < 23; ++i) InsertNoiseMap(i, 200);
  runs_ = RunDecoders(1, {});
  Order();
  AnswerHello();
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 1);
}

TEST_F(SharingSessionTest, AnAcknowledgmentThatComesAfterGivingUpCounts) {
  OrderMaps(60);
  const std::vector<proto::Message> sent = TakeSent();
  ASSERT_GE(sent.size(), 2u);
  const proto::Have stored = Store(sent[1]);  // Before the first: it asks for a new run.
  EXPECT_TRUE(stored.needs_new_run());
  Take(session_.OnHave(stored, now_));
  for (std::size_t i = 0; i < sent.size(); ++i) {
    if (i != 1) Acknowledge(sent[i]);
  }
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, SendsALostBatchOfARunAgainWithoutWaiting) {
  for (std::size_t lost = 0; lost < 4; ++lost) {
    SCOPED_TRACE(lost);
    source_ = MemoryStore();
    destination_ = MemoryStore();
    runs_ = RunDecoders(1, {});
    session_ = SharingSession(Options(), proto::SHARING_KIND_SYNC, kDestination, 1000);
    OrderMaps(60);
    std::size_t number = 0;
    while (!sent_.empty()) {
      for (const proto::Message& message : TakeSent()) {
        if (number++ != lost) Acknowledge(message);
      }
    }
    EXPECT_EQ(destination_.have(), source_.have());
    EXPECT_FALSE(session_.is_open());
    EXPECT_GE(Status().resends(), 1);
    EXPECT_LE(Status().resends(), 8 * 1024 / 1500) << "what was under way";
  }
}

TEST_F(SharingSessionTest, ADamagedBatchEndsItsRun) {
  OrderMaps(60);
  const std::vector<proto::Message> sent = TakeSent();
  ASSERT_GE(sent.size(), 2u);
  std::string damaged = sent[0].batch().coded();
  damaged[damaged.size() / 2] = static_cast<char>(damaged[damaged.size() / 2] ^ 1);
  EXPECT_FALSE(runs_.Decode(kSelf, sent[0].batch(), damaged, now_));
  for (std::size_t i = 1; i < sent.size(); ++i) Acknowledge(sent[i]);
  RunToEnd();
  EXPECT_EQ(destination_.have(), source_.have());
}

TEST_F(SharingSessionTest, ADestinationThatNeverReadsARunIsTriedLessAndLessOften) {
  OrderMaps(60);
  const auto answer_all = [this] {
    std::size_t count = 0;
    for (std::vector<proto::Message> sent = TakeSent(); !sent.empty() && count < 100; sent = TakeSent()) {
      for (const proto::Message& message : sent) {
        if (!message.has_batch()) continue;
        proto::Have have = AcknowledgmentOf(message.batch());
        have.set_needs_new_run(true);
        Take(session_.OnHave(have, now_));
        ++count;
      }
    }
    return count;
  };
  constexpr std::size_t kUnderWayMax = 6;
  EXPECT_LE(answer_all(), 2 * kUnderWayMax);
  Advance(seconds(6));
  AnswerHello();
  EXPECT_LE(answer_all(), kUnderWayMax);
}

TEST_F(SharingSessionTest, MapsThatTravelInPiecesArePartsOfTheRun) {
  InsertNoiseMap(0, 300);
  OrderMaps(20);
  bool has_pieces = false;
  for (const proto::Message& message : RunToEnd()) has_pieces |= message.batch().has_piece();
  EXPECT_TRUE(has_pieces);
  EXPECT_EQ(destination_.have(), source_.have());
  EXPECT_EQ(Status().resends(), 0);
}

TEST_F(SharingSessionTest, CodesWithZstdForAnOlderDestination) {
  const proto::RecordBatch rows = RowBatch(300);
  for (const proto::StoredRecord& record : rows.records()) {
    source_.Insert(kSelf, proto::TEMPERATURE, record.content());
  }
  Order();
  AnswerHello();
  for (const proto::Message& message : RunToEnd()) EXPECT_EQ(message.batch().codec(), proto::CODEC_ZSTD);
  EXPECT_EQ(destination_.records().size(), 300u);
  EXPECT_EQ(Status().codec(), proto::CODEC_ZSTD);
}

TEST_F(SharingSessionTest, CodesAsItsOptionsSay) {
  SharingSession::Options options = Options();
  options.codec = proto::CODEC_PLAIN;
  session_ = SharingSession(options, proto::SHARING_KIND_SYNC, kDestination, 1000);
  source_.Insert(kSelf, proto::TEMPERATURE, std::string(1000, 'a'));
  codecs_ = {proto::CODEC_COMPACT};
  Order();
  AnswerHello();
  for (const proto::Message& message : RunToEnd()) EXPECT_EQ(message.batch().codec(), proto::CODEC_PLAIN);
}

TEST_F(SharingSessionTest, SaysWhatIsLeftByType) {
  for (int i = 0; i < 3; ++i) source_.Insert(kSelf, proto::POWER, Noise(1500));
  for (int i = 0; i < 9; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(1500));
  Order();
  AnswerHello();
  const proto::ShareSession status = Status();
  double left = 0;
  for (const proto::TypeBacklog& type : status.backlog()) left += type.records();
  ASSERT_EQ(status.backlog_size(), 1);  // States are under way or ready.
  EXPECT_EQ(status.backlog(0).data_type(), static_cast<std::uint32_t>(proto::POSE_GRAPH_NODE));
  EXPECT_LT(left, 9);
  EXPECT_GT(left, 4);
  RunToEnd();
  EXPECT_TRUE(Status().backlog().empty());
}

TEST_F(SharingSessionTest, LeavesOutWhatTheDestinationUnderstandsDifferently) {
  schemas_ = SchemasOf({});
  for (proto::TypeSchema& schema : schemas_) {
    if (schema.data_type() == proto::MODE) schema.set_hash(schema.hash() + 1);
  }
  source_.Insert(kSelf, proto::MODE, "m");
  Order();
  AnswerHello();
  RunToEnd();
  ASSERT_EQ(asked_for_.not_data_types_size(), 1);
  EXPECT_EQ(asked_for_.not_data_types(0), static_cast<std::uint32_t>(proto::MODE));
  EXPECT_EQ(Status().other_schema_types_size(), 1);
  schemas_.Clear();  // It was updated.
  Order();
  AnswerHello();
  EXPECT_TRUE(asked_for_.not_data_types().empty());
  EXPECT_TRUE(Status().other_schema_types().empty());
}

TEST_F(SharingSessionTest, BringsStatesUnaskedWithoutCountingOrTellingAnEnd) {
  source_.Insert(kSelf, proto::POWER, "p");
  source_.Insert(kSelf, proto::POSE_GRAPH_NODE, "n");
  Take(session_.BringUnasked(States(), now_));
  EXPECT_TRUE(Status().is_unasked());
  AnswerHello();
  const auto batches = RunToEnd();
  ASSERT_EQ(batches.size(), 1u);
  EXPECT_EQ(batches[0].data_type(), static_cast<std::uint32_t>(proto::POWER));
  EXPECT_GT(batches[0].remaining(), 0u);
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().completed_sessions() + Status().closed_sessions(), 0);

  Take(session_.BringUnasked(States(), now_));  // Nothing new.
  AnswerHello();
  EXPECT_TRUE(TakeSent().empty());
  EXPECT_FALSE(session_.is_open());
}

TEST_F(SharingSessionTest, AnOrderTakesThePlaceOfUnaskedStatesWithItsOwnLimit) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  source_.Insert(kSelf, proto::POWER, "p");
  Take(session_.BringUnasked(States(), now_));
  AnswerHello();
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/10'000));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(Status().limited_sessions(), 1);
  EXPECT_EQ(Status().closed_sessions(), 0);
  EXPECT_LE(Status().coded_bytes(), 10'000 + 1300);
  const std::string error = Status().last_error();
  EXPECT_FALSE(error.empty());
  Take(session_.BringUnasked(States(), now_));
  EXPECT_EQ(Status().last_error(), error) << "the order's end is still to be seen";
}

TEST_F(SharingSessionTest, RemindersNeitherHoldUpAnOrderNorWidenIt) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(200));
  Take(session_.Order(proto::RecordFilter(), now_, /*bytes_max=*/30'000));
  AnswerHello();
  while (!sent_.empty()) {
    for (const proto::Message& message : TakeSent()) {
      Take(session_.BringUnasked(States(), now_));
      Acknowledge(message);
      if (session_.is_open()) Take(session_.BringUnasked(States(), now_));
    }
  }
  EXPECT_FALSE(session_.is_ordered());
  EXPECT_EQ(Status().limited_sessions(), 1);
  EXPECT_LE(Status().coded_bytes(), 30'000 + 1300);
}

TEST_F(SharingSessionTest, UnaskedStatesWaitForAShutWindowWithoutCountingResends) {
  source_.Insert(kSelf, proto::POWER, "p");
  Take(session_.SetWindow(Window::kShut, now_));
  for (int i = 0; i < 10; ++i) Take(session_.BringUnasked(States(), now_));
  EXPECT_TRUE(TakeSent().empty());
  EXPECT_EQ(Status().resends(), 0);
  Take(session_.SetWindow(Window::kOpen, now_));
  AnswerHello();
  RunToEnd();
  EXPECT_FALSE(session_.is_open());
  EXPECT_EQ(destination_.have(), source_.have());
}

}  // namespace
}  // namespace moondb
