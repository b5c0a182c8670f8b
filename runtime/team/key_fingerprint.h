// Fingerprints of public keys, CURVE or Ed25519: short enough to be compared by people, too long to be met by chance.
#pragma once

#include <string>

namespace moondb {

// The first 128 bits of the key's SHA-256, as hexadecimal digits; empty for what is not 40 characters in Z85.
std::string FingerprintOf(const std::string& public_key);

}  // namespace moondb
