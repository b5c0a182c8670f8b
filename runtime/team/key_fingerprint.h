// Fingerprints of public keys, CURVE or Ed25519: short enough to be compared by people, too long to be met by chance.
#pragma once

#include <string>

namespace moondb {

// The first 128 bits of the SHA-256 of the key's 40 characters in Z85, as hexadecimal digits; empty for what is none.
std::string FingerprintOf(const std::string& public_key);

}  // namespace moondb
