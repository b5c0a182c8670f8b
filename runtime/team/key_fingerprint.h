// Fingerprints of public keys, CURVE or Ed25519: short enough for people to compare, too long for accidental
// collisions.
#pragma once

#include <string>

namespace moondb {

// Returns the first 128 bits of the SHA-256 of the key's 40 characters in Z85, as hexadecimal digits. Empty if the text
// is not a key.
std::string FingerprintOf(const std::string& public_key);

}  // namespace moondb
