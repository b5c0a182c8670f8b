#include "runtime/team/curve_keys.h"

#include <sys/stat.h>
#include <zmq.h>

#include <array>
#include <fstream>
#include <utility>

#include "model/curve_key.h"
#include "model/file_writing.h"
#include "runtime/team/trusted_file.h"

namespace moondb {
namespace {

constexpr std::size_t kKeyFileBytesMax = 64;

Result<void> CheckIsFile(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) return {};
  if (std::filesystem::exists(path, error)) return Fail(ErrorCode::kInvalid, path.string() + ": not a regular file");
  // `error` is set if the existence is unknown, for example because this process may not enter the folder.
  return Fail(ErrorCode::kInvalid, path.string() + ": " + (error ? error.message() : "no such file"));
}

Result<std::string> ReadKey(const std::filesystem::path& path) {
  if (const Result<void> is_file = CheckIsFile(path); !is_file) return tl::unexpected(is_file.error());
  std::ifstream file(path, std::ios::binary);
  if (!file) return Fail(ErrorCode::kInvalid, path.string() + ": cannot be read");
  std::string text(kKeyFileBytesMax + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  return ParseKeyFile(std::move(text), path.string());
}

}  // namespace

std::string ToZ85(const KeyBytes& bytes) {
  std::array<char, kCurveKeyLength + 1> text{};
  zmq_z85_encode(text.data(), bytes.data(), bytes.size());
  return text.data();
}

std::optional<KeyBytes> FromZ85(const std::string& text) {
  KeyBytes bytes{};
  // The decoder stops at a zero byte, and would accept a shorter key.
  const bool is_whole = text.size() == kCurveKeyLength && text.find('\0') == std::string::npos;
  const bool is_read = is_whole && zmq_z85_decode(bytes.data(), text.c_str()) != nullptr;
  return is_read ? std::optional(bytes) : std::nullopt;
}

bool IsCurveKey(const std::string& text) { return FromZ85(text).has_value(); }

Result<std::string> ParseKeyFile(std::string text, const std::string& name) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r' || text.back() == ' ')) text.pop_back();
  if (!IsCurveKey(text)) return Fail(ErrorCode::kInvalid, name + ": not a key (one line of 40 characters in Z85)");
  return text;
}

Result<CurveKeys> MakeCurveKeys() {
  std::array<char, kCurveKeyLength + 1> public_key{};
  std::array<char, kCurveKeyLength + 1> secret_key{};
  if (zmq_curve_keypair(public_key.data(), secret_key.data()) != 0) {
    return Fail(ErrorCode::kInternal, std::string("cannot make CURVE keys: ") + zmq_strerror(zmq_errno()));
  }
  return CurveKeys{public_key.data(), secret_key.data()};
}

Result<std::string> ReadPublicKey(const std::filesystem::path& path) {
  if (const Result<void> trusted = CheckTrusted(path); !trusted) return tl::unexpected(trusted.error());
  return ReadKey(path);
}

Result<std::string> ReadSecretKey(const std::filesystem::path& path) {
  if (const Result<void> is_file = CheckIsFile(path); !is_file) return tl::unexpected(is_file.error());
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return Fail(ErrorCode::kInvalid, path.string() + ": cannot be read");
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0) {
    return Fail(ErrorCode::kInvalid,
                path.string() + ": others can read this secret; " +
                    (HasPermissions(path) ? "run chmod 600 on it"
                                          : "its file system (FAT or similar) hides no file: use a disk with "
                                            "permissions, such as ext4"));
  }
  return ReadKey(path);
}

Result<std::string> PublicKeyOf(const std::string& secret_key) {
  std::array<char, kCurveKeyLength + 1> public_key{};
  if (zmq_curve_public(public_key.data(), secret_key.c_str()) != 0) {
    return Fail(ErrorCode::kInvalid, "not a secret CURVE key");
  }
  return std::string(public_key.data());
}

std::filesystem::path SecretKeyPath(std::filesystem::path public_key_path) {
  return public_key_path.replace_extension(".sec");
}

}  // namespace moondb
