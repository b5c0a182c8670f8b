// CommandLog: which of the commands that clients and other agents give, or wanted to give, are written down, as events
// in the agent's store.
//
// At most Options::commands_max commands of one kind are written down in a period, and then how many more there were: a
// program does not flood the event log. Plain logic; whoever calls it stores what it gives and keeps the time.
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
    std::optional<proto::Record> event;  // To be stored before anything that the command makes other actors store.
    bool begins_period = false;          // OnPeriodEnd is to be called after Options::period.
  };

  explicit CommandLog(Options options) : options_(options) {}

  Added Add(Kind kind, const std::string& text, const std::string& by, std::int64_t utc_now_ns);
  std::optional<proto::Record> OnPeriodEnd(Kind kind, std::int64_t utc_now_ns);

 private:
  // Commands of one kind in the present period.
  struct Commands {
    int written = 0;
    int left_out = 0;
    std::string last_text;  // The text of the last command that was left out, and
    std::string last_by;    // who gave it.
  };

  const Options options_;
  std::map<Kind, Commands> commands_;
};

// The name for the event log of the client whose message holds the request. A client without a key may not pass for one
// that has a key, so that what it says of itself ends before "(key)".
std::string ByOf(const proto::Message& message, const proto::ControlRequest& request);

}  // namespace moondb
