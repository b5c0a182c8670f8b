// CURVE keys and their files. A file holds one line of 40 characters (Z85, the encoding of ZeroMQ). Everyone may read
// the public key NAME.pub; only the owner may read the secret key NAME.sec.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "model/error.h"

namespace moondb {

struct CurveKeys {
  std::string public_key;  // The two keys are in Z85.
  std::string secret_key;
};

// Generates a key pair from system entropy. Returns kInternal if libzmq was built without CURVE.
Result<CurveKeys> MakeCurveKeys();

// True if `text` is 40 characters in Z85.
bool IsCurveKey(const std::string& text);

// Convert between 32 bytes and 40 characters of Z85. FromZ85 returns nothing for malformed text.
using KeyBytes = std::array<std::uint8_t, 32>;
std::string ToZ85(const KeyBytes& bytes);
std::optional<KeyBytes> FromZ85(const std::string& text);

// Returns the key in the contents of a key file: one line of 40 characters in Z85, with or without a line break.
// Returns kInvalid for other contents. `name` names the file in the error.
Result<std::string> ParseKeyFile(std::string text, const std::string& name);

// Read a key file. Return kInvalid if the file is missing or does not hold exactly one key. ReadSecretKey also returns
// kInvalid if anyone but the owner may read the file.
Result<std::string> ReadPublicKey(const std::filesystem::path& path);
Result<std::string> ReadSecretKey(const std::filesystem::path& path);

// Returns the public key of a secret key. Returns kInvalid if `secret_key` is malformed.
Result<std::string> PublicKeyOf(const std::string& secret_key);

// Returns NAME.sec beside the public key's file NAME.pub.
std::filesystem::path SecretKeyPath(std::filesystem::path public_key_path);

}  // namespace moondb
