#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <sstream>
#include <thread>

#include "runtime/dead_letters.h"
#include "runtime/trace_book.h"
#include "runtime/trace_ring.h"
#include "tests/runtime/scripted_actor.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

TraceRecord Record(std::uint64_t request_id) {
  TraceRecord record;
  record.request_id = request_id;
  return record;
}

TEST(TraceRingTest, KeepsEveryField) {
  TraceRecord in;
  in.time = -5;
  in.kind = proto::TRACE_REFUSED;
  in.result = SendResult::kUnreachable;
  in.body = 1000;
  in.actor = 65534;
  in.other_actor = 3;
  in.other_agent = 0xFFFF'0010;
  in.bytes = 0xFFFF'FFFF;
  in.request_id = ~0ull;
  in.duration = 7;
  TraceRing ring;
  ring.Add(in);
  const std::vector<TraceRecord> records = ring.Read();
  ASSERT_THAT(records, SizeIs(1));
  const TraceRecord& out = records[0];
  EXPECT_EQ(out.time, in.time);
  EXPECT_EQ(out.kind, in.kind);
  EXPECT_EQ(out.result, in.result);
  EXPECT_EQ(out.body, in.body);
  EXPECT_EQ(out.actor, in.actor);
  EXPECT_EQ(out.other_actor, in.other_actor);
  EXPECT_EQ(out.other_agent, in.other_agent);
  EXPECT_EQ(out.bytes, in.bytes);
  EXPECT_EQ(out.request_id, in.request_id);
  EXPECT_EQ(out.duration, in.duration);
}

TEST(TraceRingTest, KeepsTheLastRecords) {
  TraceRing ring;
  for (std::uint64_t i = 0; i < TraceRing::kRecords + 10; ++i) ring.Add(Record(i));
  const std::vector<TraceRecord> records = ring.Read();
  // Read skips the oldest record, because a writer may be overwriting it.
  ASSERT_THAT(records, SizeIs(TraceRing::kRecords - 1));
  EXPECT_EQ(records.front().request_id, 11u);
  EXPECT_EQ(records.back().request_id, TraceRing::kRecords + 9);
}

TEST(TraceRingTest, ReadersNeverSeeAPartlyWrittenRecord) {
  constexpr std::uint64_t kRecords = 200'000;
  TraceRing ring;
  std::thread writer([&] {
    for (std::uint64_t i = 0; i < kRecords; ++i) {
      TraceRecord record = Record(i);
      record.time = record.duration = static_cast<std::int64_t>(i);
      record.bytes = static_cast<std::uint32_t>(i);
      ring.Add(record);
    }
  });
  while (ring.count() < kRecords) {
    std::uint64_t last = 0;
    for (const TraceRecord& record : ring.Read()) {
      ASSERT_EQ(record.time, record.duration);
      ASSERT_EQ(record.bytes, static_cast<std::uint32_t>(record.request_id));
      ASSERT_EQ(record.time, static_cast<std::int64_t>(record.request_id));
      ASSERT_TRUE(last == 0 || record.request_id > last);  // Read may skip overwritten records, but keeps their order.
      last = record.request_id;
    }
  }
  writer.join();
}

TEST(TraceBookTest, ReportsAnActorsEventsOfAllThreadsInOrderOfTime) {
  TraceBook book(1, /*ns_per_tick=*/1);
  const std::uint16_t a = book.AddName("a");
  const std::uint16_t b = book.AddName("b");
  const auto add = [&](Ticks time, std::uint16_t actor, std::uint16_t other, AgentId agent) {
    TraceRecord record = Record(static_cast<std::uint64_t>(time));
    record.time = time;
    record.actor = actor;
    record.other_actor = other;
    record.other_agent = agent;
    book.Add(record);
  };
  std::thread([&] {
    book.JoinThread();
    add(3, a, b, 1);
    add(4, b, a, 1);
    add(6, b, a, 2);  // Belongs to the actor "a" of another agent.
  }).join();
  add(1, a, b, 1);
  add(2, b, b, 1);
  add(5, a, TraceRecord::kNobody, kClients);
  proto::TraceRequest request;
  request.set_actor("a");
  proto::TraceReply reply;
  book.Report(request, 1'000'000'000, &reply);
  std::vector<int> times;
  for (const proto::TraceEvent& event : reply.events()) times.push_back(static_cast<int>(event.request_id()));
  EXPECT_THAT(times, ElementsAre(1, 3, 4, 5));
  EXPECT_EQ(reply.events(0).other_actor(), "b");
  EXPECT_EQ(reply.events(3).other_actor(), "");
  EXPECT_NEAR(reply.events(0).age_s(), 1, 1e-6);
  request.set_events_max(2);
  reply.Clear();
  book.Report(request, 0, &reply);
  ASSERT_THAT(reply.events(), SizeIs(2));
  EXPECT_EQ(reply.events(0).request_id(), 4);
}

std::string ReadFile(const std::filesystem::path& path) {
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

TEST(TraceBookDeathTest, ACrashLeavesTheTraceInAFile) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "trace.txt";
  const auto crash = [&] {
    TraceBook book(1, /*ns_per_tick=*/1);
    TraceRecord record = Record(77);
    record.actor = book.AddName("pgo");
    record.kind = proto::TRACE_HANDLED;
    record.body = proto::Message::kOptimizeRequest;
    book.Add(record);
    DumpTraceOnCrash(&book, path.string());
    std::raise(SIGSEGV);
  };
  EXPECT_EXIT(crash(), testing::KilledBySignal(SIGSEGV), "");
  const std::string text = ReadFile(path);
  EXPECT_THAT(text, HasSubstr("signal 11\n"));
  EXPECT_THAT(text, HasSubstr("pgo handled optimize_request other 0/ request 77"));
}

TEST(DeadLettersTest, KeepsTheLastLettersWithinLimits) {
  DeadLetters letters;
  Mailbox::Item item;
  proto::Message message;
  message.set_sql(std::string(DeadLetters::kBytesMax / 2, 'x'));
  message.set_source_actor("\xff");
  for (int i = 0; i < 3; ++i) {
    item.message = proto::Message(message);
    letters.Add({}, "a", &item, {ErrorCode::kInternal, "large", {}});
  }
  EXPECT_THAT(letters.letters(), SizeIs(1));
  for (std::size_t i = 0; i < 2 * DeadLetters::kLettersMax; ++i) letters.Add({}, "b", nullptr, {});
  EXPECT_THAT(letters.letters(), SizeIs(DeadLetters::kLettersMax));
  EXPECT_EQ(letters.count(), 3 + 2 * DeadLetters::kLettersMax);
  message.set_sql(std::string(DeadLetters::kBytesMax, 'x'));
  item.message = std::move(message);
  letters.Add({}, "c", &item, {});
  EXPECT_EQ(letters.letters().back().message, nullptr);  // The message is too large to keep. Only its size is kept.
  EXPECT_GT(letters.letters().back().bytes, DeadLetters::kBytesMax);
  proto::TraceRequest request;
  request.set_actor("c");
  proto::TraceReply reply;
  letters.Report(request, {}, &reply);
  ASSERT_THAT(reply.dead_letters(), SizeIs(1));
  EXPECT_EQ(reply.dead_letters(0).from_actor(), "?");  // The name of the sending actor is not valid UTF-8.
}

}  // namespace
}  // namespace moondb
