// A change of roles as an operator wants it: given to one agent, once, and waited for until it is acted on.
//
// The request carries the assignment that moonctl has read, and an agent that holds another one refuses it. So it can
// be given again when no answer came: it is not done twice, and a swap is not undone.
#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "apps/moonctl/command_context.h"

namespace moondb {

class RoleChange {
 public:
  struct Done {
    proto::RoleShowReply shown;              // As the agent that was asked holds it last.
    std::vector<std::string> not_confirmed;  // Of the new leader and survivor, who does not act on it yet, by name.
  };

  // `standing` are the roles that the request relies on.
  RoleChange(CommandContext& context, proto::RoleAssignment standing);

  // kRefused with what stands where another change came first, kTimedOut where no answer came within the limit:
  // --timeout, else 10 s. A dry run changes nothing.
  Result<Done> Make(proto::RoleSetRequest request, bool is_waiting);

 private:
  using Clock = std::chrono::steady_clock;

  Result<AgentClient> ChooseTarget(const proto::RoleSetRequest& request);
  Result<proto::RoleShowReply> Give(Client& target, const proto::RoleSetRequest& request);
  Result<Done> UntilConfirmed(Client& target, proto::RoleShowReply shown);
  std::vector<AgentId> NotConfirmed(const proto::RoleShowReply& shown) const;
  bool IsWanted(const proto::RoleAssignment& roles) const;
  bool IsOver() const { return Clock::now() >= end_; }

  CommandContext& context_;
  const proto::RoleAssignment standing_;
  AgentId leader_ = 0;  // As wanted.
  AgentId survivor_ = 0;
  const Clock::time_point end_;
};

}  // namespace moondb
