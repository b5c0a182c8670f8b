// The commands of `moonctl db` that are more than one question to each agent.
#pragma once

#include <string>

#include "apps/moonctl/command_context.h"

namespace moondb {

// Lets each agent (or -a) hold its store against itself: kFailed where anything is damaged, else kUnreachable where an
// agent does not answer.
ExitCode VerifyStores(CommandContext& context);

// What two agents hold and the other lacks, and whether what both hold is the same: kFailed where not.
ExitCode CompareStores(CommandContext& context, const std::string& first, const std::string& second);

// Of `db query` and `db backup`, which work on an agent's file on this machine.
struct StoreFileArguments {
  std::string text;         // The query, or where the backup goes.
  std::string data_folder;  // As given to `moonctl up`; empty: its default.
  std::size_t rows_max = 1000;
};

ExitCode QueryFile(CommandContext& context, const StoreFileArguments& arguments);
ExitCode BackUpFile(CommandContext& context, const StoreFileArguments& arguments);

}  // namespace moondb
