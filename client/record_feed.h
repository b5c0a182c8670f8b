// RecordFeed: a subscription to the records of one agent, in the order in which the agent stores them.
//
//    RecordFeed feed(client, filter);              // Starts after filter.after_row_id; 0: at the first record.
//    if (auto now = feed.SkipToNow(); !now) ...    // Optional: skip all records stored so far.
//    while (true) {
//      auto page = feed.Next(std::chrono::seconds(10));
//      if (!page) ...                              // The connection broke; the next call continues at the same record.
//      for (const proto::StoredRecord& stored : page->records()) ...
//    }
//
// Each record is returned once. For types under the policy `latest`, a program that was offline gets only the newest
// record of each key, because superseded records are removed. Timestamps are not in ascending order, because records of
// other agents are stored when they arrive.
//
// A row id is valid only for this agent's store: after a restart with an empty disk, row ids start at 1 again.
//
// Not thread-safe. Requires: `client` outlives the feed. Other calls of `client` are allowed in between.
#pragma once

#include <cstdint>

#include "client/client.h"

namespace moondb {

class RecordFeed {
 public:
  // Uses these fields of `filter`: data_types, origin_agents, after_row_id, records_max and content_bytes_max.
  // records_max and content_bytes_max limit one page: 0 means the agent's default, and larger values than the agent's
  // limit are reduced.
  RecordFeed(Client& client, proto::ReadRequest filter) : client_(client), request_(std::move(filter)) {}

  // Skips all records stored so far.
  Result<void> SkipToNow();

  // Returns the next page; an empty page if no matching record was stored within `timeout`. Fails like every call of
  // Client. In particular:
  //   - kTimedOut: The agent did not reply in time (Client::Options::timeout). The next call continues at the same
  //     record.
  //   - kFull: Too many programs wait at this agent; try again later. Also returned if the next record has more than
  //     255 KiB and cannot be relayed over the radio (Client::Options::for_agent); connect to that agent directly.
  Result<proto::ReadReply> Next(Client::Duration timeout);

  // Returns the row id of the last record returned. A later feed can continue after that row.
  std::uint64_t after_row_id() const { return request_.after_row_id(); }

 private:
  Client& client_;
  proto::ReadRequest request_;
};

}  // namespace moondb
