// AddressBook: senders on other agents, each kept once, so that the messages that wait need not carry them.
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

  // Any thread. The kept one, for as long as the book lives; null for a longer name, and for a new one when the book is
  // full.
  const Address* Keep(const Address& address);

 private:
  std::mutex mutex_;
  std::set<Address> addresses_;
};

}  // namespace moondb
