// Usage: sync ENDPOINT AGENT. Syncs, waits at most 5 s, and prints what is missing.
#include <cstdio>

#include "client/client.h"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const auto client = moondb::Client::Connect(argv[1], argv[2], {});
  if (!client) return std::fprintf(stderr, "%s\n", ToString(client.error()).c_str()), 1;
  const auto progress = (*client)->Sync({.limit = std::chrono::seconds(5)});
  if (!progress) return std::fprintf(stderr, "%s\n", ToString(progress.error()).c_str()), 1;
  std::puts(progress->is_complete() ? "complete" : "not complete");
  for (const auto& pair : progress->pairs()) {
    if (pair.is_complete()) continue;
    std::printf("%u to %u: %s\n", pair.sender(), pair.destination(),
                pair.why().empty() ? "goes on" : pair.why().c_str());
  }
}
