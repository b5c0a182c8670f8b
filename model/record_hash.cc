#include "model/record_hash.h"

#include <xxhash.h>

#include <array>
#include <cstddef>
#include <memory>

namespace moondb {

namespace {

// Appends the `byte_count` lowest bytes of `value` in little-endian order, regardless of this machine's byte order.
void AppendLittleEndian(std::uint64_t value, int byte_count, std::array<char, 24>& buffer, std::size_t& size) {
  for (int i = 0; i < byte_count; ++i) buffer[size++] = static_cast<char>(value >> (8 * i));
}

}  // namespace

std::uint64_t HashRecord(const RecordKey& key, std::string_view content) {
  std::array<char, 24> head;
  std::size_t head_size = 0;
  AppendLittleEndian(key.stream.origin, 4, head, head_size);
  AppendLittleEndian(key.stream.epoch, 8, head, head_size);
  AppendLittleEndian(key.stream.type, 4, head, head_size);
  AppendLittleEndian(key.seq, 8, head, head_size);
  const std::unique_ptr<XXH64_state_t, decltype(&XXH64_freeState)> state(XXH64_createState(), &XXH64_freeState);
  XXH64_reset(state.get(), 0);
  XXH64_update(state.get(), head.data(), head_size);
  XXH64_update(state.get(), content.data(), content.size());
  return XXH64_digest(state.get());
}

}  // namespace moondb
