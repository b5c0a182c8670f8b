// Tests stores that exchange missing records in any order. Batches are lost, repeated or late, and disks are lost.
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <iostream>
#include <map>
#include <random>

#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

// Returns the contents of all shared records by key. Leaves out local records, whose seq is 0.
std::map<std::string, std::string> Shared(RecordStore& store) {
  std::map<std::string, std::string> shared;
  for (const proto::StoredRecord& record : Contents(store)) {
    if (record.key().seq() != 0) shared[ToString(FromProto(record.key()))] = record.content();
  }
  return shared;
}

// Three agents insert random records and send batches to each other. Batches wait in `bag_`, from which they are lost,
// repeated or delivered in random order.
class Exchange {
 public:
  explicit Exchange(std::uint64_t seed) : random_(seed), seed_(seed) {
    for (AgentId agent : {1u, 2u, 3u}) stores_[agent] = OpenStore(StoreOptionsOf(agent, ":memory:", seed));
  }

  void Step() {
    const AgentId agent = 1 + Draw(3);
    const std::uint64_t action = Draw(100);
    if (action < 45) {
      InsertSomething(agent);
    } else if (action < 75) {
      Pack(agent, 1 + Draw(3));
    } else if (action < 98) {
      Deliver();
    } else {
      // The agent loses its disk. The other agents can return its records.
      stores_[agent].reset();
      stores_[agent] = OpenStore(StoreOptionsOf(agent, ":memory:", seed_ + Draw(1'000'000)));
    }
  }

  // Exchanges records until no store lacks any. Returns false if some store still lacks records after 1,000 rounds.
  bool Quieten() {
    bag_.clear();
    for (int round = 0; round < 1000; ++round) {
      bool is_moving = false;
      for (auto& [from, source] : stores_) {
        for (auto& [to, sink] : stores_) {
          if (from != to && Transfer(*source, *sink, static_cast<std::uint32_t>(Draw(4)))) is_moving = true;
        }
      }
      if (!is_moving) return true;
    }
    return false;
  }

  RecordStore& store(AgentId agent) { return *stores_[agent]; }

 private:
  std::uint64_t Draw(std::uint64_t count) { return random_() % count; }

  void InsertSomething(AgentId agent) {
    ++counter_;
    switch (Draw(6)) {
      case 0:
        InsertOne(*stores_[agent], NodeRecord(agent, counter_));
        break;
      case 1:
        InsertOne(*stores_[agent], OptimizedPoseRecord({1 + static_cast<AgentId>(Draw(3)), Draw(4)}, 1, counter_, 0));
        break;
      case 2:
        InsertOne(*stores_[agent], CustomRecordOf(1000, std::to_string(counter_)));
        break;
      case 3:
        InsertOne(*stores_[agent], CustomRecordOf(1001, std::to_string(counter_), std::to_string(Draw(3))));
        break;
      default:
        InsertOne(*stores_[agent], TemperatureRecord(static_cast<double>(counter_)));
    }
  }

  void Pack(AgentId from, AgentId to) {
    if (from == to) return;
    proto::MissingRequest question;
    *question.mutable_destination_have() = stores_[to]->GetHave().have();
    question.set_records_max(1 + static_cast<std::uint32_t>(Draw(5)));
    proto::MissingReply reply = *stores_[from]->GetMissing(question);
    proto::StoreRequest batch;
    *batch.mutable_records() = reply.records();
    *batch.mutable_dropped() = reply.dropped();
    bag_.push_back({to, batch});
  }

  void Deliver() {
    if (bag_.empty()) return;
    const std::size_t which = Draw(bag_.size());
    const auto [to, batch] = bag_[which];
    const std::uint64_t fate = Draw(10);
    if (fate > 0) {
      const proto::StoreReply reply = stores_[to]->Store(batch).reply;
      EXPECT_FALSE(IsError(reply.error())) << reply.error().DebugString();
    }
    if (fate < 8) bag_.erase(bag_.begin() + static_cast<std::ptrdiff_t>(which));
  }

  std::mt19937_64 random_;
  std::uint64_t seed_;
  std::uint64_t counter_ = 0;
  std::map<AgentId, std::unique_ptr<RecordStore>> stores_;
  std::deque<std::pair<AgentId, proto::StoreRequest>> bag_;
};

TEST(RecordExchangeTest, ConvergesUnderLossRepetitionReorderingAndLostDisks) {
  const std::uint64_t first_seed = std::random_device()();
  std::cout << "first seed " << first_seed << "\n";
  for (std::uint64_t seed = first_seed; seed < first_seed + 25; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Exchange exchange(seed);
    for (int i = 0; i < 150; ++i) exchange.Step();
    ASSERT_TRUE(exchange.Quieten());
    const std::map<std::string, std::string> shared = Shared(exchange.store(1));
    for (AgentId agent : {2u, 3u}) {
      EXPECT_EQ(Shared(exchange.store(agent)), shared);
      EXPECT_EQ(exchange.store(agent).GetHave().have().SerializeAsString(),
                exchange.store(1).GetHave().have().SerializeAsString());
    }
    if (HasFailure()) return;
  }
}

// The store `second` receives a report that the first state was dropped. The origin then loses its disk, which alone
// held the newer state.
TEST(RecordExchangeTest, AStateIsNotSupersededByALostState) {
  auto origin = OpenStore(StoreOptionsOf(1));
  auto first = OpenStore(StoreOptionsOf(2));
  auto second = OpenStore(StoreOptionsOf(3));
  InsertOne(*origin, TemperatureRecord(1));
  while (Transfer(*origin, *first)) {
  }
  InsertOne(*origin, TemperatureRecord(2));
  proto::StoreRequest reported;
  // This report of the drop overtakes the batch with the second state.
  *reported.mutable_dropped() = origin->GetMissing({})->dropped();
  ASSERT_EQ(reported.dropped_size(), 1);
  EXPECT_FALSE(IsError(second->Store(reported).reply.error()));
  origin.reset();
  while (Transfer(*first, *second)) {
  }
  EXPECT_EQ(*second->database().Number("SELECT celsius FROM temperature"), 1);
}

TEST(RecordExchangeTest, TheLeaderAlwaysHasAStateOfAnAgentOnceItReceivedOne) {
  auto origin = OpenStore(StoreOptionsOf(2));
  auto leader = OpenStore(StoreOptionsOf(1));
  for (int i = 1; i <= 20; ++i) {
    InsertOne(*origin, TemperatureRecord(i));
    if (i % 3 == 0) Transfer(*origin, *leader, 1);
    EXPECT_EQ(*leader->database().Number("SELECT count(*) FROM temperature"), i < 3 ? 0 : 1);
  }
  while (Transfer(*origin, *leader)) {
  }
  EXPECT_EQ(*leader->database().Number("SELECT celsius FROM temperature"), 20);
}

}  // namespace
}  // namespace moondb
