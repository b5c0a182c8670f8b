// RecordFeed: a subscription to the records of one agent, in the order in which the agent stores them.
//
//   RecordFeed feed(client, filter);              // Starts after filter.after_row_id; 0: at the first record.
//   if (auto now = feed.SkipToNow(); !now) ...    // Optional: skip all records stored so far.
//   while (true) {
//     auto page = feed.Next(std::chrono::seconds(10));
//     if (!page) ...                              // The connection broke; the next call continues at the same record.
//     for (const proto::StoredRecord& stored : page->records()) ...
//   }
//
// The program polls, so the agent queues nothing for it, and a slow program costs the agent nothing. Each record is
// returned once. For types under the policy `latest`, superseded records are removed from the store. A program that was
// offline therefore sees only the newest record of each key. Records from other agents are stored when they arrive, so
// timestamps are not in ascending order.
//
// after_row_id() is only valid for this agent's store; after a restart with an empty disk, row ids start at 1 again.
//
// Not thread-safe. Requires: `client` outlives the feed; it may be used for other calls in between.
#pragma once

#include <cstdint>

#include "client/client.h"

namespace moondb {

class RecordFeed {
 public:
  // Reads these fields of `filter`: data_types, origin_agents, after_row_id, records_max and content_bytes_max. The
  // last two limit one page; 0 selects the agent's default, and values above the agent's limit are reduced to that
  // limit.
  RecordFeed(Client& client, proto::ReadRequest filter) : client_(client), request_(std::move(filter)) {}

  // Skips all records stored so far.
  Result<void> SkipToNow();

  // Returns the next page; an empty page if no matching record was stored within `timeout`. Fails like every call of
  // Client. In particular:
  //   - kTimedOut: The agent did not reply in time (Client::Options::timeout). The next call continues at the same
  //     record.
  //   - kFull: Too many programs wait at this agent; try again later. Or a record of more than 255 KiB cannot be
  //     relayed over the radio (Client::Options::for_agent) and blocks the feed; connect to that agent directly.
  Result<proto::ReadReply> Next(Client::Duration timeout);

  // Returns the row id of the last record returned. A later feed can continue after that row.
  std::uint64_t after_row_id() const { return request_.after_row_id(); }

 private:
  Client& client_;
  proto::ReadRequest request_;
};

}  // namespace moondb
