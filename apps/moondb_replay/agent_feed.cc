#include "apps/moondb_replay/agent_feed.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <set>
#include <thread>

#include "apps/common/progress.h"
#include "apps/common/table.h"
#include "apps/common/team_clients.h"
#include "apps/moondb_replay/feed_plan.h"

namespace moondb {
namespace {

using Clock = std::chrono::steady_clock;

constexpr auto kRetriedEvery = std::chrono::seconds(1);
constexpr auto kGivenUpAfter = std::chrono::minutes(1);
constexpr auto kShownEvery = std::chrono::milliseconds(200);

void PrintFed(const AgentFeed& feed, std::size_t count, Clock::time_point start) {
  const std::chrono::duration<double> seconds = Clock::now() - start;
  std::printf("%s: %zu records in %.2f s%s\n", feed.name.c_str(), count, seconds.count(),
              feed.left_out == 0 ? "" : (", " + std::to_string(feed.left_out) + " existed already").c_str());
  std::fflush(stdout);
}

std::string RecordsText(std::size_t count, std::size_t total) {
  return std::to_string(count) + " of " + std::to_string(total) + " records";
}

// Maps timestamps of the mission to times of this machine.
struct Pace {
  std::int64_t first_ns = 0;
  double speed = 1;
  Clock::time_point start;

  Clock::time_point TimeOf(const proto::Record& record) const {
    const auto after =
        std::chrono::duration<double, std::nano>(static_cast<double>(record.timestamp_ns() - first_ns) / speed);
    return start + std::chrono::duration_cast<Clock::duration>(after);
  }
};

bool MayPass(ErrorCode code) {
  return code == ErrorCode::kUnavailable || code == ErrorCode::kTimedOut || code == ErrorCode::kFull;
}

// Inserts the records that are due. The error is that of Client::Insert.
Result<void> InsertDue(AgentFeed& feed, const Pace& pace) {
  const auto end = std::partition_point(feed.records.begin(), feed.records.end(), [&](const proto::Record& record) {
    return pace.TimeOf(record) <= Clock::now();
  });
  const std::vector<proto::Record> due(feed.records.begin(), end);
  auto inserted = InsertInBatches(*feed.client, due, [](std::size_t, const auto&) {});
  if (inserted) feed.records.erase(feed.records.begin(), end);
  return inserted;
}

// Some records of a failed insert may be stored, so the agent is asked which before the next attempt.
Result<void> Retry(AgentFeed& feed, const Pace& pace) {
  std::this_thread::sleep_for(kRetriedEvery);
  if (const auto known = LeaveOutKnown(feed); !known) return tl::unexpected(known.error());
  return InsertDue(feed, pace);
}

Result<void> FeedOne(AgentFeed& feed, const Pace& pace, std::atomic<std::size_t>& inserted_count) {
  const std::size_t planned = feed.records.size();
  std::optional<Clock::time_point> refused_since;  // Empty: the agent took the last records.
  while (!feed.records.empty()) {
    if (!refused_since) std::this_thread::sleep_until(pace.TimeOf(feed.records.front()));
    const std::size_t before = feed.records.size();
    const Result<void> done = refused_since ? Retry(feed, pace) : InsertDue(feed, pace);
    inserted_count += before - feed.records.size();
    if (done) {
      refused_since.reset();
    } else if (!MayPass(done.error().code)) {
      return done;
    } else if (!refused_since) {
      refused_since = Clock::now();
      std::fprintf(stderr, "%s accepts no records now (%s); the records wait\n", feed.name.c_str(),
                   done.error().text.c_str());
    } else if (Clock::now() - *refused_since > kGivenUpAfter) {
      return Fail(ErrorCode::kUnavailable, feed.name + " has accepted no record for a minute (" + done.error().text +
                                               "); " + std::to_string(feed.records.size()) +
                                               " records are not inserted: once the agent runs, repeat the command");
    }
  }
  PrintFed(feed, planned, pace.start);
  return {};
}

}  // namespace

Result<std::size_t> LeaveOutKnown(AgentFeed& feed) {
  proto::ReadRequest request;
  request.add_origin_agents(feed.id);
  request.set_records_max(1024);
  std::set<std::string> known;
  const auto read = feed.client->ReadAll(request, [&known](const proto::StoredRecord&, const proto::Record& record) {
    known.insert(FeedKey(record));
    return Result<void>();
  });
  if (!read) return tl::unexpected(read.error());
  return std::erase_if(feed.records, [&known](const proto::Record& record) { return known.contains(FeedKey(record)); });
}

Result<void> FeedAtOnce(const AgentFeed& feed) {
  const Clock::time_point start = Clock::now();
  const std::size_t total = feed.records.size();
  Progress progress("feed " + feed.name);
  const auto show = [&](std::size_t count, const auto&) {
    progress.Show(static_cast<double>(count), static_cast<double>(total), RecordsText(count, total));
  };
  if (auto inserted = InsertInBatches(*feed.client, feed.records, show); !inserted) return inserted;
  PrintFed(feed, total, start);
  return {};
}

Result<void> FeedInTime(std::vector<AgentFeed>& feeds, double speed) {
  Pace pace{INT64_MAX, speed, Clock::now()};
  std::size_t planned = 0;
  for (const AgentFeed& feed : feeds) {
    planned += feed.records.size();
    if (!feed.records.empty()) pace.first_ns = std::min(pace.first_ns, feed.records.front().timestamp_ns());
  }
  std::atomic<std::size_t> inserted_count = 0;
  std::atomic<std::size_t> ended_count = 0;
  std::vector<Result<void>> results(feeds.size());
  Progress progress("feed");
  {
    std::vector<std::jthread> threads;
    for (std::size_t i = 0; i < feeds.size(); ++i) {
      threads.emplace_back([&, i] {
        results[i] = FeedOne(feeds[i], pace, inserted_count);
        ++ended_count;
      });
    }
    while (ended_count < feeds.size()) {
      progress.Show(static_cast<double>(inserted_count), static_cast<double>(planned),
                    RecordsText(inserted_count, planned));
      std::this_thread::sleep_for(kShownEvery);
    }
  }
  for (const Result<void>& result : results) {
    if (!result) return result;
  }
  return {};
}

}  // namespace moondb
