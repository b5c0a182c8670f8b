#include "runtime/address_book.h"

namespace moondb {

const Address* AddressBook::Keep(const Address& address) {
  if (address.actor.size() > kNameBytesMax) return nullptr;
  const std::lock_guard lock(mutex_);
  const auto kept = addresses_.find(address);
  if (kept != addresses_.end()) return &*kept;
  if (addresses_.size() >= kAddressesMax) return nullptr;
  return &*addresses_.insert(address).first;
}

}  // namespace moondb
