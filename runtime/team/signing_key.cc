#include "runtime/team/signing_key.h"

#include <sodium.h>

#include "model/check.h"
#include "model/term.h"
#include "runtime/team/curve_keys.h"

namespace moondb {
namespace {

static_assert(crypto_sign_BYTES == kSignatureBytes);
static_assert(crypto_sign_PUBLICKEYBYTES == sizeof(KeyBytes) && crypto_sign_SEEDBYTES == sizeof(KeyBytes));

// Initialises libsodium once per process. Every public function calls Begin, because any of them may be called first.
void Begin() {
  static const bool is_ready = sodium_init() >= 0;
  Check(is_ready, "libsodium starts");
}

}  // namespace

SigningKey SigningKey::Make() {
  Begin();
  Seed seed;
  randombytes_buf(seed.data(), seed.size());
  SigningKey key = FromSeed(seed);
  sodium_memzero(seed.data(), seed.size());
  return key;
}

SigningKey SigningKey::FromSeed(const Seed& seed) {
  Begin();
  SigningKey key;
  key.seed_ = seed;
  KeyBytes public_key;
  Check(crypto_sign_seed_keypair(public_key.data(), key.secret_.data(), seed.data()) == 0, "a seed has its keys");
  key.public_key_ = ToZ85(public_key);
  return key;
}

Result<SigningKey> SigningKey::Read(const std::filesystem::path& path) {
  Result<std::string> text = ReadSecretKey(path);
  if (!text) return tl::unexpected(text.error());
  std::optional<KeyBytes> seed = FromZ85(*text);
  Check(seed.has_value(), "ReadSecretKey gives Z85");
  SigningKey key = FromSeed(*seed);
  sodium_memzero(seed->data(), seed->size());
  sodium_memzero(text->data(), text->size());
  return key;
}

SigningKey::~SigningKey() {
  sodium_memzero(seed_.data(), seed_.size());
  sodium_memzero(secret_.data(), secret_.size());
}

std::string SigningKey::SecretText() const { return ToZ85(seed_); }

std::string SigningKey::Sign(std::string_view bytes) const {
  std::string signature(kSignatureBytes, '\0');
  const auto* message = reinterpret_cast<const unsigned char*>(bytes.data());
  auto* out = reinterpret_cast<unsigned char*>(signature.data());
  Check(crypto_sign_detached(out, nullptr, message, bytes.size(), secret_.data()) == 0, "a key signs");
  return signature;
}

bool IsSigningKey(const std::string& public_key) {
  Begin();
  const std::optional<KeyBytes> bytes = FromZ85(public_key);
  return bytes && crypto_core_ed25519_is_valid_point(bytes->data()) == 1;
}

bool IsSignatureOf(const std::string& public_key, std::string_view bytes, std::string_view signature) {
  Begin();
  const std::optional<KeyBytes> key = FromZ85(public_key);
  if (signature.size() != kSignatureBytes || !key) return false;
  return crypto_sign_verify_detached(reinterpret_cast<const unsigned char*>(signature.data()),
                                     reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size(),
                                     key->data()) == 0;
}

std::filesystem::path SigningSecretPath(std::filesystem::path secret_key_path) {
  return secret_key_path.replace_extension(".sign");
}

}  // namespace moondb
