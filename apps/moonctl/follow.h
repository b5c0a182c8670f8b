// Prints new records continuously, for commands that run until the user ends them.
#pragma once

#include <functional>
#include <string>

#include "apps/moonctl/command_context.h"

namespace moondb {

// Prints one line, made by `line_of`, for each record that the agent stores after this call. If `filter`.after_row_id
// is not 0, prints all records after that row. Returns kUnreachable if the agent is lost. If an answer is late, prints
// one line on stderr and continues. Exits with code 0 on SIGINT and SIGTERM, and silently if the reader has closed
// stdout.
ExitCode FollowRecords(CommandContext& context, Client& client, proto::ReadRequest filter,
                       const std::function<std::string(const proto::StoredRecord&, const proto::Record&)>& line_of);

}  // namespace moondb
