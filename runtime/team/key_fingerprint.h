// Fingerprints of public keys (CURVE or Ed25519) that people can compare. Accidental collisions are practically
// impossible.
#pragma once

#include <string>

namespace moondb {

// Returns the first 128 bits of the SHA-256 of the key's 40 characters in Z85, as 32 hexadecimal digits. Returns "" if
// `public_key` is not a key.
std::string FingerprintOf(const std::string& public_key);

}  // namespace moondb
