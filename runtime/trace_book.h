// TraceBook: the latest events of one agent's actors, in one TraceRing per thread, and the actors' names.
//
// Tracing is always on. Adding a record costs a few nanoseconds on the agent's own threads. Other threads (of the
// transport, of a test) share one ring under a mutex. After the last AddName, adding and reading records are
// thread-safe.
#pragma once

#include <array>
#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "proto/trace.pb.h"
#include "runtime/trace_ring.h"

namespace moondb {

class TraceBook {
 public:
  static constexpr std::size_t kThreadsMax = 64;  // Limit of threads with their own ring; further threads share one.
  static constexpr std::size_t kNamesMax = 60'000;

  // `ns_per_tick` is the length of a tick, the unit of time in the records: TickClock::NanosecondsPerTick(), or 1 in
  // simulation.
  TraceBook(AgentId self, double ns_per_tick);

  // Adds the name of an actor. Returns the number that stands for the name in records.
  std::uint16_t AddName(std::string name);

  // Gives the calling thread a ring of its own until the thread ends. Requires: the thread belongs to this agent only.
  void JoinThread();
  void Add(const TraceRecord& record);

  // Adds the events that match `request` to `reply`, oldest first.
  void Report(const proto::TraceRequest& request, Ticks now, proto::TraceReply* reply) const;

  // Writes `headline` and then all events, one per line and thread by thread, to the file at `path`. Replaces an
  // existing file. Has no effect if the file cannot be opened. Safe in signal handlers. Must not be used in simulation.
  void WriteFile(const char* path, const char* headline = "trace") const;

 private:
  std::vector<TraceRecord> ReadAll() const;  // Returns all records, sorted by time.
  void WriteRing(int file, const TraceRing& ring, std::uint64_t thread, Ticks now) const;
  std::uint64_t Microseconds(Ticks ticks) const;
  const char* NameOf(std::uint16_t name) const { return name < names_.size() ? names_[name].c_str() : ""; }

  const AgentId self_;
  const double ns_per_tick_;
  std::vector<std::string> names_;
  std::array<std::unique_ptr<TraceRing>, kThreadsMax> rings_;
  std::atomic<std::size_t> ring_count_ = 0;
  std::mutex shared_mutex_;
  TraceRing shared_ring_;
};

// Returns a word for a kind of event, such as "handled" or "could not send". Safe in signal handlers.
const char* TraceWord(proto::TraceKind kind);

// Returns the name of the field of Message's `body` with this number, or "" if there is none. Safe in signal handlers
// once a TraceBook exists.
const char* BodyName(std::uint16_t body);

// Installs a handler that writes `book` to the file at `path` after a fatal signal (SIGSEGV, SIGBUS, SIGFPE, SIGILL,
// SIGABRT), before the process ends. An existing file is replaced. Each call replaces the process's previous book. If
// `book` is null, no trace is written. `path` is copied.
void DumpTraceOnCrash(const TraceBook* book, const std::string& path);

}  // namespace moondb
