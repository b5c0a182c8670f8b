// Ed25519 keys with which agents sign role assignments and map quarantines. Implemented with libsodium. The secret file
// holds the seed as one line of 40 characters (Z85, like CURVE keys), readable by its owner only. The public key is in
// the team file.
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

  // Generates a key from system entropy.
  static SigningKey Make();
  // Returns the key of this seed. For tests and simulations.
  static SigningKey FromSeed(const Seed& seed);
  // Reads the secret file, with the checks of ReadSecretKey (curve_keys.h).
  static Result<SigningKey> Read(const std::filesystem::path& path);

  SigningKey(const SigningKey&) = default;
  SigningKey& operator=(const SigningKey&) = default;
  ~SigningKey();  // Clears the secret from memory.

  const std::string& public_key() const { return public_key_; }  // The public key in Z85.
  std::string SecretText() const;                                // Contents of the secret file, without the newline.
  std::string Sign(std::string_view bytes) const;  // Returns a signature of kSignatureBytes (model/term.h).

 private:
  SigningKey() = default;

  Seed seed_{};
  std::array<std::uint8_t, 64> secret_{};  // Seed and public key, the format of a secret key in libsodium.
  std::string public_key_;
};

// Returns true if `public_key` is 40 characters in Z85 that encode a point of the curve.
bool IsSigningKey(const std::string& public_key);

// Returns true if the signature is valid. Returns false also if the key or the signature is malformed.
bool IsSignatureOf(const std::string& public_key, std::string_view bytes, std::string_view signature);

// Returns NAME.sign beside the secret CURVE key's file NAME.sec.
std::filesystem::path SigningSecretPath(std::filesystem::path secret_key_path);

}  // namespace moondb
