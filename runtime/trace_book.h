// TraceBook: what one agent's actors did last: a TraceRing for each thread, and the names that the records refer to.
//
// Always on. A record costs a few nanoseconds on a thread of the agent's own; other threads (the transport's, a test's)
// share one ring under a mutex. Threads may Add, and anybody read, at any time after the last AddName.
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
  static constexpr std::size_t kThreadsMax = 64;  // With a ring of their own; further ones share.
  static constexpr std::size_t kNamesMax = 60'000;

  // `ns_per_tick`: of the records' times; TickClock's, or 1 in simulation.
  TraceBook(AgentId self, double ns_per_tick);

  // An actor of this agent; what records call it.
  std::uint16_t AddName(std::string name);

  // The calling thread gets a ring of its own, for as long as it lives; it belongs to this agent alone.
  void JoinThread();
  void Add(const TraceRecord& record);

  // The events that `request` asks for, oldest first.
  void Report(const proto::TraceRequest& request, Ticks now, proto::TraceReply* reply) const;

  // All events as text, a line each, thread by thread, to a file made anew, below `headline`. For signal handlers too;
  // a file that cannot be made is left alone. Not in simulation.
  void WriteFile(const char* path, const char* headline = "trace") const;

 private:
  std::vector<TraceRecord> ReadAll() const;  // In order of time.
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

// What people read for a kind of event: "handled", "could not send". For signal handlers too.
const char* TraceWord(proto::TraceKind kind);

// The name of Message's body field of that number, "" for none. For signal handlers too, once a TraceBook was made.
const char* BodyName(std::uint16_t body);

// From now on a fatal signal (SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT) writes `book` to the file at `path`, made anew,
// before it ends the process. One book a process; null: no more. `path` is kept.
void DumpTraceOnCrash(const TraceBook* book, const std::string& path);

}  // namespace moondb
