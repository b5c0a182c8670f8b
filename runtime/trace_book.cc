#include "runtime/trace_book.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <utility>

#include "model/check.h"

namespace moondb {
namespace {

struct OwnRing {
  const TraceBook* book = nullptr;
  TraceRing* ring = nullptr;
};
thread_local OwnRing own_ring;

// Names of the fields of Message's `body`, by field number. Built before any signal arrives, because signal handlers
// cannot safely use protobuf's descriptors.
class BodyNames {
 public:
  BodyNames() {
    const auto* bodies = proto::Message::descriptor()->FindOneofByName("body");
    for (int i = 0; i < bodies->field_count(); ++i) {
      const auto* field = bodies->field(i);
      if (static_cast<std::size_t>(field->number()) < names_.size()) names_[field->number()] = field->name().c_str();
    }
  }
  const char* Of(std::uint16_t body) const {
    return body < names_.size() && names_[body] != nullptr ? names_[body] : "";
  }

 private:
  std::array<const char*, 1001> names_{};
};

const BodyNames& GetBodyNames() {
  static const BodyNames names;
  return names;
}

// A line of text, built without allocation or locale. Text beyond kSizeMax is cut off.
class Line {
 public:
  Line& operator<<(const char* text) {
    for (; *text != '\0' && size_ < kSizeMax; ++text) text_[size_++] = *text;
    return *this;
  }
  Line& operator<<(std::uint64_t number) {
    char digits[21];
    char* end = digits + sizeof digits - 1;
    *end = '\0';
    do *--end = static_cast<char>('0' + number % 10);
    while ((number /= 10) > 0);
    return *this << end;
  }
  void Write(int file) {
    text_[size_] = '\n';
    (void)!::write(file, text_, size_ + 1);
  }

 private:
  static constexpr std::size_t kSizeMax = 254;
  char text_[kSizeMax + 1];
  std::size_t size_ = 0;
};

}  // namespace

const char* TraceWord(proto::TraceKind kind) {
  switch (kind) {
    case proto::TRACE_SENT:
      return "sent";
    case proto::TRACE_HANDLED:
      return "handled";
    case proto::TRACE_REFUSED:
      return "could not send";
    case proto::TRACE_STARTED:
      return "started";
    case proto::TRACE_FAILED:
      return "failed";
    case proto::TRACE_OVERRAN:
      return "overran";
    case proto::TRACE_STEPPED_DOWN:
      return "made the agent give up its role";
    case proto::TRACE_BEYOND_HELP:
      return "has failed permanently";
    default:
      return "?";
  }
}

const char* BodyName(std::uint16_t body) { return GetBodyNames().Of(body); }

TraceBook::TraceBook(AgentId self, double ns_per_tick) : self_(self), ns_per_tick_(ns_per_tick) {
  (void)GetBodyNames();
}

std::uint16_t TraceBook::AddName(std::string name) {
  Check(names_.size() < kNamesMax, "an agent has no more actors than a trace can name");
  names_.push_back(std::move(name));
  return static_cast<std::uint16_t>(names_.size() - 1);
}

void TraceBook::JoinThread() {
  const std::lock_guard lock(shared_mutex_);
  const std::size_t count = ring_count_;
  if (count >= kThreadsMax) return;
  rings_[count] = std::make_unique<TraceRing>();
  own_ring = {this, rings_[count].get()};
  ring_count_ = count + 1;
}

void TraceBook::Add(const TraceRecord& record) {
  if (own_ring.book == this) return own_ring.ring->Add(record);
  const std::lock_guard lock(shared_mutex_);
  shared_ring_.Add(record);
}

std::vector<TraceRecord> TraceBook::ReadAll() const {
  std::vector<TraceRecord> records = shared_ring_.Read();
  for (std::size_t i = 0; i < ring_count_; ++i) {
    const std::vector<TraceRecord> more = rings_[i]->Read();
    records.insert(records.end(), more.begin(), more.end());
  }
  std::stable_sort(records.begin(), records.end(),
                   [](const TraceRecord& a, const TraceRecord& b) { return a.time < b.time; });
  return records;
}

void TraceBook::Report(const proto::TraceRequest& request, Ticks now, proto::TraceReply* reply) const {
  std::vector<TraceRecord> records = ReadAll();
  if (!request.actor().empty()) {
    std::erase_if(records, [&](const TraceRecord& record) {
      const bool is_other = record.other_agent == self_ && request.actor() == NameOf(record.other_actor);
      return request.actor() != NameOf(record.actor) && !is_other;
    });
  }
  const std::size_t wanted = request.events_max() == 0 ? records.size() : request.events_max();
  for (std::size_t i = records.size() - std::min(wanted, records.size()); i < records.size(); ++i) {
    const TraceRecord& record = records[i];
    proto::TraceEvent& event = *reply->add_events();
    event.set_age_s(static_cast<double>(now - record.time) * ns_per_tick_ * 1e-9);
    event.set_kind(record.kind);
    event.set_actor(NameOf(record.actor));
    event.set_other_agent(record.other_agent);
    event.set_other_actor(NameOf(record.other_actor));
    event.set_body(BodyName(record.body));
    event.set_request_id(static_cast<double>(record.request_id));
    event.set_bytes(record.bytes);
    event.set_seconds(static_cast<double>(record.duration) * ns_per_tick_ * 1e-9);
    if (record.kind == proto::TRACE_REFUSED) event.set_result(ToString(record.result));
  }
}

std::uint64_t TraceBook::Microseconds(Ticks ticks) const {
  return static_cast<std::uint64_t>(static_cast<double>(std::max<Ticks>(0, ticks)) * ns_per_tick_ * 1e-3);
}

void TraceBook::WriteFile(const char* path, const char* headline) const {
  // A signal handler may call this, so it uses system calls only. It removes an old file, because that one may be a
  // link or have another mode.
  ::unlink(path);
  const int file = ::open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
  if (file < 0) return;
  (Line() << headline).Write(file);
  const Ticks now = TickClock::Now();
  WriteRing(file, shared_ring_, 0, now);
  for (std::size_t i = 0; i < ring_count_; ++i) WriteRing(file, *rings_[i], i + 1, now);
  ::close(file);
}

void TraceBook::WriteRing(int file, const TraceRing& ring, std::uint64_t thread, Ticks now) const {
  const std::uint64_t count = ring.count();
  for (std::uint64_t i = count - std::min<std::uint64_t>(count, TraceRing::kRecords); i < count; ++i) {
    TraceRecord record;
    if (!ring.Read(i, &record)) continue;
    Line line;
    line << "thread " << thread << " age_us " << Microseconds(now - record.time) << " " << NameOf(record.actor) << " "
         << TraceWord(record.kind) << " " << BodyName(record.body) << " other " << std::uint64_t{record.other_agent}
         << "/" << NameOf(record.other_actor) << " request " << record.request_id << " bytes "
         << std::uint64_t{record.bytes} << " took_us " << Microseconds(record.duration);
    if (record.kind == proto::TRACE_REFUSED) line << " " << ToString(record.result);
    line.Write(file);
  }
}

namespace {

constexpr int kFatalSignals[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};

std::atomic<const TraceBook*> crash_book = nullptr;
char crash_path[4096] = "";

void OnFatalSignal(int signal) {
  // Restore the default actions first. A further fatal signal, in this handler or in another thread, then ends the
  // process.
  for (const int fatal : kFatalSignals) std::signal(fatal, SIG_DFL);
  if (const TraceBook* book = crash_book.exchange(nullptr)) {
    char headline[] = "signal 00";
    headline[7] = static_cast<char>('0' + signal / 10);
    headline[8] = static_cast<char>('0' + signal % 10);
    book->WriteFile(crash_path, headline);
  }
  std::raise(signal);
}

}  // namespace

void DumpTraceOnCrash(const TraceBook* book, const std::string& path) {
  crash_book = nullptr;
  if (book == nullptr) return;
  Check(path.size() < sizeof crash_path, "a path is shorter than the system's limit");
  std::memcpy(crash_path, path.c_str(), path.size() + 1);
  crash_book = book;
  for (const int fatal : kFatalSignals) std::signal(fatal, OnFatalSignal);
}

}  // namespace moondb
