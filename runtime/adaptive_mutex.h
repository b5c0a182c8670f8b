// MakeAdaptive: lets a std::mutex that is held for some nanoseconds at a time be waited for without the kernel.
//
// Two threads that pass messages at full speed meet at the mailbox's mutex again and again; sleeping and waking at each
// meeting costs them half of their throughput (measured). glibc's adaptive mutex looks a few times first.
#pragma once

#include <pthread.h>

#include <mutex>

namespace moondb {

// Before anybody locks it. Does nothing where the C library has no such mutex.
inline void MakeAdaptive([[maybe_unused]] std::mutex& mutex) {
#if defined(__GLIBC__) && defined(PTHREAD_ADAPTIVE_MUTEX_INITIALIZER_NP)
  pthread_mutexattr_t attributes;
  pthread_mutexattr_init(&attributes);
  pthread_mutexattr_settype(&attributes, PTHREAD_MUTEX_ADAPTIVE_NP);
  pthread_mutex_init(mutex.native_handle(), &attributes);
  pthread_mutexattr_destroy(&attributes);
#endif
}

}  // namespace moondb
