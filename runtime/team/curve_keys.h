// CURVE keys and their files: one line of 40 characters (Z85, as ZeroMQ writes them). NAME.pub may be read by all,
// NAME.sec by its owner alone.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "model/error.h"

namespace moondb {

struct CurveKeys {
  std::string public_key;  // Both in Z85.
  std::string secret_key;
};

// New ones, from the system's entropy. kInternal if libzmq was built without CURVE.
Result<CurveKeys> MakeCurveKeys();

// 40 characters in Z85.
bool IsCurveKey(const std::string& text);

// Z85 of any 32 bytes, and back; none for what is no such text.
using KeyBytes = std::array<std::uint8_t, 32>;
std::string ToZ85(const KeyBytes& bytes);
std::optional<KeyBytes> FromZ85(const std::string& text);

// kInvalid: missing, not one key, or (secret) readable by others than its owner.
Result<std::string> ReadPublicKey(const std::filesystem::path& path);
Result<std::string> ReadSecretKey(const std::filesystem::path& path);

// The public key that belongs to a secret one.
Result<std::string> PublicKeyOf(const std::string& secret_key);

// NAME.sec beside NAME.pub.
std::filesystem::path SecretKeyPath(std::filesystem::path public_key_path);

}  // namespace moondb
