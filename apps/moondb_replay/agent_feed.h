// Inserts a mission's records at the agents of its robots, at once or at the times at which the robots made them.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "client/client.h"
#include "model/error.h"
#include "model/ids.h"
#include "proto/record.pb.h"

namespace moondb {

// The records of one agent that are still to be inserted.
struct AgentFeed {
  std::string name;
  AgentId id = 0;
  std::unique_ptr<Client> client;
  std::vector<proto::Record> records;  // In the order of their timestamps.
  std::size_t left_out = 0;            // Number of records that the agent held before.
};

// Removes from the feed the records that its agent already holds. Returns how many were removed.
Result<std::size_t> LeaveOutKnown(AgentFeed& feed);

// Inserts all records. Prints progress on stderr, and one line on stdout. The error is that of Client::Insert.
Result<void> FeedAtOnce(const AgentFeed& feed);

// Inserts each record when its timestamp is due: one second of the mission takes 1/`speed` seconds. Starts at the
// earliest timestamp of all feeds. Prints progress on stderr, and one line per agent on stdout.
//
// The records of an agent that does not answer, or has no room, wait until it takes them; those of the others do not.
// Fails with kUnavailable if an agent has taken none for a minute, after the other feeds have ended; with each other
// error of Client::Insert at once for that agent.
//
// Requires: speed > 0.
Result<void> FeedInTime(std::vector<AgentFeed>& feeds, double speed);

}  // namespace moondb
