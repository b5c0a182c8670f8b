#include "apps/moonctl/follow.h"

#include <signal.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <utility>

#include "client/record_feed.h"

namespace moondb {
namespace {

constexpr std::chrono::seconds kWait(60);

// Handles SIGINT and SIGTERM. The process may exit at any time, because PrintLine writes each line in one call.
void EndFollow(int) { ::_exit(static_cast<int>(ExitCode::kDone)); }

// Returns false if the line cannot be written, for example because the reader has closed stdout.
bool PrintLine(const std::string& line) {
  const std::string text = line + "\n";
  return std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
}

}  // namespace

ExitCode FollowRecords(CommandContext& context, Client& client, proto::ReadRequest filter,
                       const std::function<std::string(const proto::StoredRecord&, const proto::Record&)>& line_of) {
  ::signal(SIGINT, EndFollow);
  ::signal(SIGTERM, EndFollow);
  const bool is_from_now = filter.after_row_id() == 0;
  RecordFeed feed(client, std::move(filter));
  if (is_from_now) {
    if (auto skipped = feed.SkipToNow(); !skipped) return context.Report(skipped.error());
  }
  bool is_late = false;
  while (true) {
    const auto page = feed.Next(kWait);
    if (!page && page.error().code != ErrorCode::kTimedOut) return context.Report(page.error());
    if (!page) {  // The radio lost a frame, or the agent is busy. Report the delay once.
      const bool is_reported = std::exchange(is_late, true);
      if (!is_reported)
        std::fprintf(stderr, "moonctl: %s; still waiting for new records\n", ToString(page.error()).c_str());
      continue;
    }
    is_late = false;
    for (const proto::StoredRecord& stored : page->records()) {
      proto::Record record;
      if (!record.ParseFromString(stored.content())) {
        return context.Report({ErrorCode::kCorrupt, ToString(FromProto(stored.key())) + " cannot be decoded", {}});
      }
      if (PrintLine(line_of(stored, record))) continue;
      if (errno == EPIPE) return ExitCode::kDone;
      return context.Report({ErrorCode::kInternal, "the result cannot be written", {}});
    }
  }
}

}  // namespace moondb
