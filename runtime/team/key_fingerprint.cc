#include "runtime/team/key_fingerprint.h"

#include <sodium.h>

#include <array>
#include <cstdint>

#include "runtime/team/curve_keys.h"

namespace moondb {

std::string FingerprintOf(const std::string& public_key) {
  constexpr std::size_t kShownBytes = 16;
  if (!IsCurveKey(public_key)) return "";
  std::array<std::uint8_t, crypto_hash_sha256_BYTES> hash{};
  crypto_hash_sha256(hash.data(), reinterpret_cast<const unsigned char*>(public_key.data()), public_key.size());
  std::array<char, 2 * kShownBytes + 1> text{};
  sodium_bin2hex(text.data(), text.size(), hash.data(), kShownBytes);
  return text.data();
}

}  // namespace moondb
