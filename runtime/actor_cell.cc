#include "runtime/actor_cell.h"

#include <algorithm>
#include <utility>

#include "runtime/adaptive_mutex.h"
#include "runtime/envelope.h"
#include "runtime/message_pool.h"

namespace moondb {
namespace {

// Messages that one actor handles before the others of its pool have their turn.
constexpr int kTurnMessages = 64;

double Seconds(Ticks ticks) { return std::chrono::duration<double>(TickClock::ToDuration(ticks)).count(); }

// For counters with one writer at a time.
template <typename T>
void Increase(std::atomic<T>& counter, T by) {
  counter.store(counter.load(std::memory_order_relaxed) + by, std::memory_order_relaxed);
}

}  // namespace

ActorCell::ActorCell(CellSystem& system, Address self, SpawnOptions options, ActorFactory factory, WorkerPool& pool,
                     Supervisor::Options supervision, std::uint64_t seed)
    : ActorHost(self, std::move(factory), seed),
      system_(system),
      options_(std::move(options)),
      handler_limit_(TickClock::FromDuration(options_.handler_limit)),
      takes_one_by_one_(options_.placement == Placement::kOwnThread),
      trace_name_(system.trace().AddName(self.actor)),
      own_pool_(options_.placement == Placement::kOwnThread
                    ? std::make_unique<WorkerPool>(self.actor, 1, [&system] { system.trace().JoinThread(); })
                    : nullptr),
      pool_(own_pool_ ? *own_pool_ : pool),
      supervisor_(supervision),
      mailbox_(options_) {
  MakeAdaptive(mutex_);
}

// --- Any thread ---

SendResult ActorCell::Push(MessagePtr message, const Address* sender, std::uint16_t sender_name, bool may_wait) {
  Mailbox::Item item;
  item.bytes = message->ByteSizeLong();
  item.message = std::move(message);
  item.sender = sender;
  item.sender_name = sender_name;
  {
    std::unique_lock lock(mutex_);
    if (may_wait && options_.overflow == Overflow::kBlock) WaitForRoom(lock, item.bytes);
    if (IsLost()) return SendResult::kUnreachable;
    const SendResult result = mailbox_.Push(std::move(item));
    if (mailbox_.has_control()) is_control_waiting_.store(true, std::memory_order_relaxed);
    if (result != SendResult::kAccepted || !MarkSubmitted()) return result;
  }
  pool_.Submit(this);
  return SendResult::kAccepted;
}

void ActorCell::WaitForRoom(std::unique_lock<std::mutex>& lock, std::size_t bytes) {
  ++waiters_;
  has_room_.wait(lock, [&] { return IsLost() || mailbox_.HasRoom(bytes); });
  --waiters_;
}

void ActorCell::Wake() {
  {
    const std::lock_guard lock(mutex_);
    if (!MarkSubmitted()) return;
  }
  pool_.Submit(this);
}

void ActorCell::BeginStart() {
  {
    const std::lock_guard lock(mutex_);
    is_start_due_ = true;
    if (!MarkSubmitted()) return;
  }
  pool_.Submit(this);
}

void ActorCell::WaitUntilStarted() {
  std::unique_lock lock(mutex_);
  state_changed_.wait(lock, [this] { return state_ != State::kAway; });
}

void ActorCell::EndAndWait() {
  std::unique_lock lock(mutex_);
  is_end_due_ = true;
  if (MarkSubmitted()) pool_.Submit(this);
  state_changed_.wait(lock, [this] { return state_ == State::kEnded; });
}

void ActorCell::Join() {
  if (own_pool_) own_pool_->Join();
}

bool ActorCell::is_lost() const {
  const std::lock_guard lock(mutex_);
  return IsLost();
}

proto::ActorStatus ActorCell::Status() const {
  proto::ActorStatus status;
  status.set_name(self().actor);
  status.set_handled(static_cast<double>(handled()));
  status.set_handling_s(Seconds(handling_));
  status.set_longest_handler_s(Seconds(longest_handler_));
  status.set_overruns(static_cast<double>(overruns_));
  status.set_ping_s(ping_ < 0 ? -1 : Seconds(ping_));
  const std::lock_guard lock(mutex_);
  status.set_queued(static_cast<double>(mailbox_.size()));
  status.set_queued_max(static_cast<double>(mailbox_.size_max()));
  status.set_queued_bytes(static_cast<double>(mailbox_.bytes()));
  status.set_queued_bytes_max(static_cast<double>(mailbox_.bytes_max()));
  status.set_dropped(static_cast<double>(mailbox_.dropped()));
  status.set_replaced(static_cast<double>(mailbox_.replaced()));
  status.set_restarts(static_cast<double>(restarts_));
  return status;
}

Duration ActorCell::HandlerTime() const {
  const Ticks since = handler_since_.load(std::memory_order_relaxed);
  return since == 0 ? Duration::zero() : TickClock::ToDuration(TickClock::Now() - since);
}

Duration ActorCell::PingTime() const {
  const Ticks since = pinged_;
  return since == 0 ? Duration::zero() : TickClock::ToDuration(TickClock::Now() - since);
}

void ActorCell::Ping() {
  {
    // Who waits for nothing is well: an idle agent stays asleep.
    const std::lock_guard lock(mutex_);
    if (pinged_ != 0 || (mailbox_.empty() && handler_since_ == 0)) return;
  }
  pinged_ = TickClock::Now();
  proto::Message ping;
  ping.mutable_ping();
  WriteLocalEnvelope(self().agent, self().agent, ping);
  (void)Push(MakeMessage(std::move(ping)), &self(), trace_name_);
}

// --- Context ---

std::int64_t ActorCell::utc_now_ns() const {
  return std::chrono::duration_cast<Duration>(std::chrono::system_clock::now().time_since_epoch()).count();
}

TimerId ActorCell::After(Duration delay, proto::Message message) {
  WriteLocalEnvelope(self().agent, self().agent, message);
  auto shared = MakeMessage(std::move(message));
  return system_.timers().Add(now() + delay, [this, shared = std::move(shared), incarnation = incarnation()] {
    {
      const std::lock_guard lock(mutex_);
      if (IsLost()) return;
      Mailbox::Item item;
      item.message = shared;
      item.sender = &self();
      item.sender_name = trace_name_;
      item.is_timer = true;
      item.incarnation = incarnation;
      (void)mailbox_.Push(std::move(item));
      if (!MarkSubmitted()) return;
    }
    pool_.Submit(this);
  });
}

// --- With mutex_ held ---

bool ActorCell::HasMessageDue() const {
  return state_ == State::kReady && system_.is_flowing() && !system_.is_stopping() && !mailbox_.empty();
}

bool ActorCell::MarkSubmitted() { return HasWork() && turn_.exchange(Turn::kNews) == Turn::kIdle; }

// --- The actor's thread ---

Ticks ActorCell::RunTurn(Ticks now) {
  for (int handled = 0; handled < kTurnMessages;) {
    switch (NextStep()) {
      case Step::kNothing:
        return now;
      case Step::kStart:
        now = StartActor(now);
        ++handled;
        break;
      case Step::kEnd:
        End();
        EnterState(State::kEnded);
        return now;
      case Step::kMessages:
        handled += static_cast<int>(batch_.size());
        now = HandleBatch(now);
        if (EndTurnUnlessNews()) return now;
        break;
    }
  }
  {
    const std::lock_guard lock(mutex_);
    turn_ = HasWork() ? Turn::kSubmitted : Turn::kIdle;
    if (turn_ == Turn::kIdle) return now;
  }
  pool_.SubmitLast(this);
  return now;
}

ActorCell::Step ActorCell::NextStep() {
  const std::lock_guard lock(mutex_);
  if (!HasWork()) {
    turn_ = Turn::kIdle;
    return Step::kNothing;
  }
  turn_ = Turn::kSubmitted;
  if (is_end_due_) return Step::kEnd;
  if (std::exchange(is_start_due_, false)) return Step::kStart;
  mailbox_.Take(takes_one_by_one_, &batch_);
  is_more_waiting_ = !mailbox_.empty();
  is_control_waiting_.store(mailbox_.has_control(), std::memory_order_relaxed);
  // One at each step: all at once would only queue up at the mutex.
  if (waiters_ > 0 && mailbox_.is_half_free()) has_room_.notify_one();
  return Step::kMessages;
}

// Nothing of the cell may be touched after true: another thread may be in its next turn already.
bool ActorCell::EndTurnUnlessNews() {
  Turn expected = Turn::kSubmitted;
  return !is_more_waiting_ && has_actor() && turn_.compare_exchange_strong(expected, Turn::kIdle);
}

Ticks ActorCell::StartActor(Ticks now) {
  handler_started_ = now;
  const std::optional<Error> failure = ActorHost::Start();
  TraceRecord record = MakeRecord(proto::TRACE_STARTED, now);
  record.request_id = incarnation();
  system_.trace().Add(record);
  if (!failure) EnterState(State::kReady);
  SettleHandler(nullptr, failure);
  return TickClock::Now();
}

Ticks ActorCell::HandleBatch(Ticks now) {
  std::size_t next = 0;
  bool has_actor = true;
  const bool is_control = IsControl(*batch_.front().message);
  while (next < batch_.size() && has_actor && !system_.is_stopping()) {
    // What came on the control lane meanwhile goes before the rest.
    if (!is_control && is_control_waiting_.load(std::memory_order_relaxed)) break;
    const Mailbox::Item item = std::move(batch_[next++]);
    // Else the timer of an incarnation that died.
    if (!item.is_timer || item.incarnation == incarnation()) now = HandleItem(item, now, &has_actor);
  }
  if (next < batch_.size()) {
    const std::lock_guard lock(mutex_);
    if (!IsLost()) mailbox_.PutBack(&batch_, next);
    is_more_waiting_ = true;
  }
  batch_.clear();
  return now;
}

Ticks ActorCell::HandleItem(const Mailbox::Item& item, Ticks now, bool* has_actor) {
  if (item.message->has_ping()) {
    ping_ = std::max<Ticks>(0, now - pinged_.exchange(0));
    return now;
  }
  handler_started_ = now;
  handler_since_.store(now, std::memory_order_relaxed);
  const std::optional<Error> failure = Handle(*item.message, item.sender);
  const Ticks end = TickClock::Now();
  handler_since_.store(0, std::memory_order_relaxed);
  CountHandler(item, now, end);
  SettleHandler(&item, failure);
  *has_actor = !failure;
  return end;
}

void ActorCell::CountHandler(const Mailbox::Item& item, Ticks start, Ticks end) {
  const Ticks took = std::max<Ticks>(0, end - start);
  Increase(handling_, took);
  if (took > longest_handler_.load(std::memory_order_relaxed)) longest_handler_ = took;
  TraceRecord record = MakeRecord(proto::TRACE_HANDLED, start);
  record.body = static_cast<std::uint16_t>(item.message->body_case());
  record.other_actor = item.sender_name;
  record.other_agent = sender().agent;
  record.bytes = static_cast<std::uint32_t>(item.bytes);
  record.request_id = item.message->request_id();
  record.duration = took;
  system_.trace().Add(record);
  if (took <= handler_limit_) return;
  Increase(overruns_, std::uint64_t{1});
  record.kind = proto::TRACE_OVERRAN;
  system_.trace().Add(record);
}

void ActorCell::SettleHandler(const Mailbox::Item* item, const std::optional<Error>& failure) {
  if (failure) Recover(item, *failure);
  if (TakeStopRequest()) system_.OnStopRequested();
}

void ActorCell::Recover(const Mailbox::Item* item, const Error& failure) {
  const MonotonicTime failed = now();
  const Supervisor::Verdict verdict = supervisor_.OnFailure(failed, static_cast<double>(rng()() >> 11) * 0x1.0p-53);
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
  }
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
    if (IsLost()) mailbox_.Clear();
  }
  state_changed_.notify_all();
  has_room_.notify_all();
}

}  // namespace moondb
