// Prints new records continuously, for commands that run until the user ends them.
#pragma once

#include <functional>
#include <string>

#include "apps/moonctl/command_context.h"

namespace moondb {

// Prints each record that the agent stores from now on, or after `filter`.after_row_id if that is not 0, as one line
// made by `line_of`. Ends with exit code 0 on SIGINT and SIGTERM, and silently if the reader of stdout has closed it.
// Ends with kUnreachable if the agent is lost. A late answer only causes one line on stderr.
ExitCode FollowRecords(CommandContext& context, Client& client, proto::ReadRequest filter,
                       const std::function<std::string(const proto::StoredRecord&, const proto::Record&)>& line_of);

}  // namespace moondb
