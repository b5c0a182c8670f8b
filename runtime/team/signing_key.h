// Ed25519 keys with which agents sign what others must not say in their name (runtime/team/role_signature.h), and the
// file of the secret: one line of 40 characters (Z85, as of CURVE keys), the seed, readable by its owner alone. The
// public half stands in the team file. By libsodium.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "model/error.h"

namespace moondb {

class SigningKey {
 public:
  using Seed = std::array<std::uint8_t, 32>;

  // A new one, from the system's entropy.
  static SigningKey Make();
  // Always the same one: for tests and simulations.
  static SigningKey FromSeed(const Seed& seed);
  // As ReadSecretKey (curve_keys.h) reads a file.
  static Result<SigningKey> Read(const std::filesystem::path& path);

  SigningKey(const SigningKey&) = default;
  SigningKey& operator=(const SigningKey&) = default;
  ~SigningKey();  // Nothing of the secret stays in memory.

  const std::string& public_key() const { return public_key_; }  // In Z85.
  std::string SecretText() const;                                // What its file holds, without the end of the line.
  std::string Sign(std::string_view bytes) const;                // kSignatureBytes (model/term.h).

 private:
  SigningKey() = default;

  Seed seed_{};
  std::array<std::uint8_t, 64> secret_{};  // As libsodium wants it: seed and public key.
  std::string public_key_;
};

// 40 characters in Z85 that are a point of the curve.
bool IsSigningKey(const std::string& public_key);

// False too for a key or a signature that is none.
bool IsSignatureOf(const std::string& public_key, std::string_view bytes, std::string_view signature);

// NAME.sign beside the secret CURVE key NAME.sec.
std::filesystem::path SigningSecretPath(std::filesystem::path secret_key_path);

}  // namespace moondb
