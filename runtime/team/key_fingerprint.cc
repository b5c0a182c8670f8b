#include "runtime/team/key_fingerprint.h"

#include <sodium.h>
#include <zmq.h>

#include <array>
#include <cstdint>

#include "runtime/team/curve_keys.h"

namespace moondb {

std::string FingerprintOf(const std::string& public_key) {
  constexpr std::size_t kShownBytes = 16;
  std::array<std::uint8_t, 32> key{};
  if (!IsCurveKey(public_key) || zmq_z85_decode(key.data(), public_key.c_str()) == nullptr) return "";
  std::array<std::uint8_t, crypto_hash_sha256_BYTES> hash{};
  crypto_hash_sha256(hash.data(), key.data(), key.size());
  std::array<char, 2 * kShownBytes + 1> text{};
  sodium_bin2hex(text.data(), text.size(), hash.data(), kShownBytes);
  return text.data();
}

}  // namespace moondb
