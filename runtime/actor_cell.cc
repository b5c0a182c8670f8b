#include "runtime/actor_cell.h"

#include <sys/resource.h>

#include <algorithm>
#include <utility>

#include "runtime/envelope.h"
#include "runtime/system_status.h"

namespace moondb {
namespace {

// Maximum number of messages that one actor handles in a turn. Other actors of its pool then get a turn.
constexpr int kTurnMessages = 64;
// A message from another agent or a client counts towards the mailbox's byte limit with its serialised size if that is
// at most this many bytes, otherwise with its size in memory.
constexpr std::size_t kSmallBytes = 4096;

constexpr int kBackgroundNice = 10;

std::unique_ptr<WorkerPool> MakeOwnPool(CellSystem& system, const std::string& name, Placement placement) {
  if (placement == Placement::kPool) return nullptr;
  return std::make_unique<WorkerPool>(name, 1, [&system, placement] {
    system.trace().JoinThread();
    // On Linux this is the priority of the calling thread. The actor also works if it cannot be lowered.
    if (placement == Placement::kBackground) (void)setpriority(PRIO_PROCESS, 0, kBackgroundNice);
  });
}

double Seconds(Ticks ticks) { return std::chrono::duration<double>(TickClock::ToDuration(ticks)).count(); }

}  // namespace

ActorCell::ActorCell(CellSystem& system, Address self, SpawnOptions options, ActorFactory factory, WorkerPool& pool,
                     Supervisor::Options supervision, std::uint64_t seed)
    : ActorHost(self, std::move(factory), seed),
      times_(TickClock::FromDuration(options.handler_limit)),
      system_(system),
      own_pool_(MakeOwnPool(system, self.actor, options.placement)),
      pool_(own_pool_ ? *own_pool_ : pool),
      trace_name_(system.trace().AddName(self.actor)),
      may_senders_wait_(options.overflow == Overflow::kBlock),
      mailbox_(options),
      options_(std::move(options)),
      supervisor_(supervision) {}

// --- Thread-safe functions ---

SendResult ActorCell::Push(OwnedMessage message, const Address* sender, std::uint16_t sender_name, bool may_wait) {
  Mailbox::Item item;
  item.bytes = message->ByteSizeLong();
  item.message = std::move(message);
  item.sender = sender;
  item.sender_name = sender_name;
  return may_wait && may_senders_wait_ ? PushWaiting(std::move(item)) : Settle(mailbox_.Push(std::move(item)));
}

SendResult ActorCell::PushFromOutside(OwnedMessage message, const Address* sender) {
  Mailbox::Item item;
  item.bytes = message->ByteSizeLong();
  // A message with many small fields uses many times its serialised size in memory. Count the memory.
  if (item.bytes > kSmallBytes) item.bytes = message->SpaceUsedLong();
  item.message = std::move(message);
  item.sender = sender;
  item.sender_name = TraceRecord::kNobody;
  item.is_from_outside = !IsFromLocalClient(*item.message);
  return Settle(mailbox_.Push(std::move(item)));
}

SendResult ActorCell::Settle(Mailbox::Pushed pushed) {
  if (pushed.must_call_reader) pool_.Submit(this);
  return pushed.result;
}

SendResult ActorCell::PushWaiting(Mailbox::Item item) {
  Mailbox::Pushed pushed = mailbox_.TryPush(item);
  if (pushed.result == SendResult::kFull) {
    std::unique_lock lock(mutex_);
    ++waiters_;
    has_room_.wait(lock, [&] { return (pushed = mailbox_.TryPush(item)).result != SendResult::kFull; });
    --waiters_;
  }
  return Settle(pushed);
}

void ActorCell::Wake() {
  if (mailbox_.Nudge()) pool_.Submit(this);
}

void ActorCell::BeginStart() {
  {
    const std::lock_guard lock(mutex_);
    is_start_due_ = true;
    is_order_waiting_ = true;
  }
  Wake();
}

void ActorCell::WaitUntilStarted() {
  std::unique_lock lock(mutex_);
  state_changed_.wait(lock, [this] { return state_ != State::kAway; });
}

void ActorCell::EndAndWait() {
  {
    const std::lock_guard lock(mutex_);
    is_end_due_ = true;
    is_order_waiting_ = true;
  }
  Wake();
  std::unique_lock lock(mutex_);
  state_changed_.wait(lock, [this] { return state_ == State::kEnded; });
}

void ActorCell::Join() {
  if (own_pool_) own_pool_->Join();
}

bool ActorCell::is_lost() const {
  const std::lock_guard lock(mutex_);
  return IsFinal(state_);
}

SystemStatus ActorCell::GetSystemStatus() const { return system_.Status(); }

proto::ActorStatus ActorCell::Status() const {
  proto::ActorStatus status;
  status.set_name(self().actor);
  status.set_handled(static_cast<double>(handled()));
  status.set_handling_s(Seconds(times_.total()));
  status.set_longest_handler_s(Seconds(times_.longest()));
  status.set_overruns(static_cast<double>(times_.overruns()));
  status.set_ping_s(pings_.last() < 0 ? -1 : Seconds(pings_.last()));
  const Mailbox::Counts counts = mailbox_.counts();
  status.set_queued(static_cast<double>(counts.waiting));
  status.set_queued_max(static_cast<double>(counts.waiting_max));
  status.set_queued_bytes(static_cast<double>(counts.bytes));
  status.set_queued_bytes_max(static_cast<double>(counts.bytes_max));
  status.set_dropped(static_cast<double>(counts.dropped));
  status.set_replaced(static_cast<double>(counts.replaced));
  const std::lock_guard lock(mutex_);
  status.set_restarts(static_cast<double>(restarts_));
  return status;
}

Duration ActorCell::HandlerTime() const {
  const Ticks since = times_.running_since();
  return since == 0 ? Duration::zero() : TickClock::ToDuration(TickClock::Now() - since);
}

Duration ActorCell::PingTime() const {
  const Ticks since = pings_.waiting_since();
  return since == 0 ? Duration::zero() : TickClock::ToDuration(TickClock::Now() - since);
}

void ActorCell::Ping() {
  // An actor without work needs no Ping. Let an idle agent sleep.
  if (pings_.waiting_since() != 0 || (mailbox_.empty() && times_.running_since() == 0)) return;
  pings_.OnSent(TickClock::Now());
  OwnedMessage ping;
  ping->mutable_ping();
  WriteLocalEnvelope(self().agent, self().agent, *ping);
  if (Push(std::move(ping), &self(), trace_name_) != SendResult::kAccepted) pings_.OnRefused();
}

// --- Implementation of Context ---

std::int64_t ActorCell::utc_now_ns() const {
  return std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch()).count();
}

TimerId ActorCell::After(Duration delay, proto::Message message) {
  WriteLocalEnvelope(self().agent, self().agent, message);
  auto shared = std::make_shared<proto::Message>(std::move(message));  // std::function requires a copyable callable.
  return system_.timers().Add(now() + delay, [this, shared = std::move(shared), incarnation = incarnation()] {
    Mailbox::Item item;
    item.message = std::move(*shared);
    item.sender = &self();
    item.sender_name = trace_name_;
    item.is_timer = true;
    item.incarnation = incarnation;
    (void)Settle(mailbox_.Push(std::move(item)));
  });
}

// --- Functions that run on the actor's thread ---

// Once GoAway has returned true, this function must not access members of the cell: another thread may run the next
// turn.
Ticks ActorCell::RunTurn(Ticks now) {
  for (int handled = 0; handled < kTurnMessages; ++handled) {
    if (is_order_waiting_.load(std::memory_order_relaxed)) {
      if (EndIfDue()) return now;
      now = StartIfDue(now);
    }
    const bool handles_messages = state_ == State::kReady && system_.is_flowing();
    // Do not check the mailbox in the first pass: this turn was submitted because there is work.
    if (!handles_messages || (handled > 0 && mailbox_.must_look())) {
      // Yield once before the mailbox is checked. A reader that is faster than its senders would otherwise contend for
      // the lock at each message. After the yield, the reader takes several messages per lock (measured: 1.5 times the
      // throughput).
      if (handles_messages) pool_.YieldWithoutWork(1);
      LetWaitersTry();
      if (mailbox_.GoAway(/*for_messages=*/handles_messages)) return now;
      if (!handles_messages) continue;
    }
    Mailbox::Item* item = mailbox_.Take();
    if (item == nullptr) continue;
    // Skip timers of an earlier incarnation.
    if (!item->is_timer || item->incarnation == incarnation()) now = HandleItem(*item, now);
    item->message = nullptr;
  }
  LetWaitersTry();
  pool_.SubmitLast(this);
  return now;
}

bool ActorCell::EndIfDue() {
  {
    const std::lock_guard lock(mutex_);
    if (!is_end_due_) return false;
  }
  End();
  EnterState(State::kEnded);
  return true;
}

Ticks ActorCell::StartIfDue(Ticks now) {
  {
    const std::lock_guard lock(mutex_);
    is_order_waiting_ = is_end_due_;
    if (!std::exchange(is_start_due_, false)) return now;
  }
  times_.OnStart(now);
  const std::optional<Error> failure = ActorHost::Start();
  TraceRecord record = MakeRecord(proto::TRACE_STARTED, now);
  record.request_id = incarnation();
  system_.trace().Add(record);
  if (!failure) EnterState(State::kReady);
  SettleHandler(nullptr, failure);
  return TickClock::Now();
}

// Wakes one sender that waits for room, if the mailbox is half free. Waking all senders would only cause contention.
void ActorCell::LetWaitersTry() {
  // Use a read-modify-write instead of a load. A sender that starts to wait after this line then sees that messages
  // were taken from the mailbox.
  if (!may_senders_wait_ || waiters_.fetch_add(0) == 0 || !mailbox_.is_half_free()) return;
  const std::lock_guard lock(mutex_);
  has_room_.notify_one();
}

Ticks ActorCell::HandleItem(Mailbox::Item& item, Ticks now) {
  if (item.message->has_ping()) {
    pings_.OnAnswered(now);
    return now;
  }
  times_.OnBegun(now);
  const std::optional<Error> failure = Handle(*item.message, item.sender);
  const Ticks end = TickClock::Now();
  TraceHandler(item, times_.OnEnded(end));
  SettleHandler(&item, failure);
  return end;
}

void ActorCell::TraceHandler(const Mailbox::Item& item, Ticks took) {
  TraceRecord record = MakeRecord(proto::TRACE_HANDLED, times_.begun());
  record.body = static_cast<std::uint16_t>(item.message->body_case());
  record.other_actor = item.sender_name;
  record.other_agent = sender().agent;
  record.bytes = static_cast<std::uint32_t>(item.bytes);
  record.request_id = item.message->request_id();
  record.duration = took;
  system_.trace().Add(record);
  if (!times_.IsOverrun(took)) return;
  record.kind = proto::TRACE_OVERRAN;
  system_.trace().Add(record);
}

void ActorCell::SettleHandler(Mailbox::Item* item, const std::optional<Error>& failure) {
  if (failure) Recover(item, *failure);
  if (TakeStopRequest()) system_.OnStopRequested();
}

void ActorCell::Recover(Mailbox::Item* item, const Error& failure) {
  const MonotonicTime failed = now();
  const Supervisor::Verdict verdict =
      supervisor_.OnFailure(failure, failed, static_cast<double>(rng()() >> 11) * 0x1.0p-53);
  const bool is_final = verdict.action == Supervisor::Action::kBeyondHelp;
  system_.trace().Add(MakeRecord(is_final ? proto::TRACE_BEYOND_HELP : proto::TRACE_FAILED, TickClock::Now()));
  EnterState(is_final ? State::kBeyondHelp : State::kAway);
  system_.OnFailed(*this, item, failure, is_final);
  if (is_final) return system_.OnBeyondHelp(self(), failure);
  if (verdict.action == Supervisor::Action::kStepDown) {
    system_.trace().Add(MakeRecord(proto::TRACE_STEPPED_DOWN, TickClock::Now()));
    system_.OnStepDown(self(), failure);
  }
  {
    const std::lock_guard lock(mutex_);
    ++restarts_;
    is_start_due_ = verdict.delay == Duration::zero();
    if (is_start_due_) is_order_waiting_ = true;
  }
  (void)mailbox_.Nudge();  // This turn continues. The nudge makes this turn check is_start_due_ before it ends.
  if (verdict.delay > Duration::zero()) system_.timers().Add(failed + verdict.delay, [this] { BeginStart(); });
}

TraceRecord ActorCell::MakeRecord(proto::TraceKind kind, Ticks time) const {
  TraceRecord record;
  record.time = time;
  record.kind = kind;
  record.actor = trace_name_;
  return record;
}

void ActorCell::EnterState(State state) {
  {
    const std::lock_guard lock(mutex_);
    if (state_ == state) return;
    state_ = state;
    if (IsFinal(state)) mailbox_.Close();
  }
  state_changed_.notify_all();
  has_room_.notify_all();
}

}  // namespace moondb
