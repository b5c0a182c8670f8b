// CommandLog: decides which commands of clients and other agents, accepted or refused, become events in the event log.
//
// At most Options::commands_max commands of one kind are logged per period. At the end of the period, one more event
// counts the commands that were left out. A program thus cannot flood the event log. No I/O: the caller stores the
// returned events and runs the timers.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "proto/control.pb.h"
#include "proto/message.pb.h"

namespace moondb {

class CommandLog {
 public:
  using Kind = proto::ControlRequest::RequestCase;

  struct Options {
    proto::EventKind event_kind = proto::EVENT_KIND_COMMAND;
    int commands_max = 20;
    std::chrono::nanoseconds period = std::chrono::minutes(1);
  };

  struct Added {
    // Event that the caller must send to storage before it executes the command; null if the command is not logged.
    std::optional<proto::Record> event;
    bool begins_period = false;  // If true, the caller must call OnPeriodEnd after Options::period.
  };

  explicit CommandLog(Options options) : options_(options) {}

  Added Add(Kind kind, const std::string& text, const std::string& by, std::int64_t utc_now_ns);
  std::optional<proto::Record> OnPeriodEnd(Kind kind, std::int64_t utc_now_ns);

 private:
  // Commands of one kind in the current period.
  struct Commands {
    int written = 0;
    int left_out = 0;
    std::string last_text;  // Text of the last command that was not logged.
    std::string last_by;    // Client or agent that gave the last command that was not logged.
  };

  const Options options_;
  std::map<Kind, Commands> commands_;
};

// Returns the client's name for the event log: "NAME (key)" if the client has a key. Otherwise returns the name that
// the client gives, cut off before "(key)": a client without a key must not appear as a client with a key.
std::string ByOf(const proto::Message& message, const proto::ControlRequest& request);

}  // namespace moondb
