// RecordFeed: the records of one agent as they are stored there, for a program that follows them.
//
//   RecordFeed feed(client, filter);              // From filter.after_row_id on; 0: from the beginning.
//   if (auto now = feed.SkipToNow(); !now) ...    // Or only what is stored from now on.
//   while (true) {
//     auto page = feed.Next(std::chrono::seconds(10));
//     if (!page) ...                              // The agent went away; the next call goes on where this one ended.
//     for (const proto::StoredRecord& stored : page->records()) ...
//   }
//
// The program pulls: the agent queues nothing for it, and one that is slow costs the agent nothing. Each record comes
// once, in the order in which the agent stored it. Of a type with the policy `latest` a record that a newer one took
// the place of is gone from the store, so that a program that was away sees the newest of each key and not all between.
// What the agent got only now from other agents, it stores now: stamps do not go up.
//
// after_row_id() belongs to this agent's store: one that was begun anew (an empty disk) counts from 1 again.
//
// Not thread-safe; `client` outlives it, and may be used for other calls in between.
#pragma once

#include <cstdint>

#include "client/client.h"

namespace moondb {

class RecordFeed {
 public:
  // Of `filter` count data_types, origin_agents, after_row_id, records_max and content_bytes_max (of a page; 0: the
  // agent's own choice; what is more than the agent allows is cut).
  RecordFeed(Client& client, proto::ReadRequest filter) : client_(client), request_(std::move(filter)) {}

  // Goes behind what is stored by now.
  Result<void> SkipToNow();

  // The next page; empty if nothing was stored in `timeout`. Errors as of every call of Client: kTimedOut if the agent
  // took Client::Options::timeout longer than it was to wait, after which the next call goes on; kFull if too many
  // programs wait at this agent: try again later. Of another agent over the radio (Client::Options::for_agent) a record
  // of more than 255 KiB cannot come, and the feed not go past it: kFull; ask that agent itself.
  Result<proto::ReadReply> Next(Client::Duration timeout);

  // Of the last record that came, to go on behind it another time.
  std::uint64_t after_row_id() const { return request_.after_row_id(); }

 private:
  Client& client_;
  proto::ReadRequest request_;
};

}  // namespace moondb
