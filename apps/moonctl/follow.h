// What comes, as it comes: for commands that go on until somebody ends them.
#pragma once

#include <functional>
#include <string>

#include "apps/moonctl/command_context.h"

namespace moondb {

// Prints each record that the agent stores from now on (behind `filter`.after_row_id if that is not 0) as one line, by
// `line_of`. Ends with the exit code 0 on SIGINT and SIGTERM, and quietly where whoever reads stdout has left; with an
// error where the agent is lost (kUnreachable). An answer that is late does not end it: stderr says so once.
ExitCode FollowRecords(CommandContext& context, Client& client, proto::ReadRequest filter,
                       const std::function<std::string(const proto::StoredRecord&, const proto::Record&)>& line_of);

}  // namespace moondb
