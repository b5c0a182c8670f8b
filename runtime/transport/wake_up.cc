#include "runtime/transport/wake_up.h"

#include <sys/eventfd.h>
#include <unistd.h>

#include "model/check.h"

namespace moondb {

WakeUp::WakeUp() : file_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) { Check(file_ >= 0, "the system gives an eventfd"); }

WakeUp::~WakeUp() { close(file_); }

void WakeUp::RingFor(MonotonicTime due) {
  const std::int64_t sleeps_until = sleeps_until_;
  if (sleeps_until == kAwake || due.time_since_epoch().count() >= sleeps_until) return;
  if (is_ringing_.exchange(true)) return;
  const std::uint64_t one = 1;
  (void)!write(file_, &one, sizeof one);
}

void WakeUp::IsAwake(bool by_file) {
  sleeps_until_ = kAwake;
  if (!by_file) return;
  std::uint64_t count = 0;
  (void)!read(file_, &count, sizeof count);
  is_ringing_ = false;
}

}  // namespace moondb
