// CommandLog: decides which commands, accepted or refused, are logged as events in the agent's store. Commands come
// from clients and other agents.
//
// At most Options::commands_max commands of one kind are logged per period, followed by the number of commands that
// were left out. A program therefore cannot flood the event log. No I/O: the caller stores the returned events and
// keeps the time.
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
    // The event to store, if any. Must be stored before any record that other actors store because of the command.
    std::optional<proto::Record> event;
    bool begins_period = false;  // The caller must call OnPeriodEnd after Options::period.
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

// Returns the client's name for the event log. A client without a key must not impersonate one with a key, so its
// self-reported name is cut off before "(key)".
std::string ByOf(const proto::Message& message, const proto::ControlRequest& request);

}  // namespace moondb
