// AddressBook: stores each remote sender's address once. Waiting messages point to the stored copy.
#pragma once

#include <cstddef>
#include <mutex>
#include <set>

#include "runtime/address.h"

namespace moondb {

class AddressBook {
 public:
  static constexpr std::size_t kAddressesMax = 4096;
  static constexpr std::size_t kNameBytesMax = 64;

  // Returns the stored copy of `address`, which is valid for the lifetime of the book. Returns null if the actor's name
  // is too long, or if the book is full and the address is new. Thread-safe.
  const Address* Keep(const Address& address);

 private:
  std::mutex mutex_;
  std::set<Address> addresses_;
};

}  // namespace moondb
