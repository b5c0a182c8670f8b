// The client list: keys that an agent accepts at its client_address, and their rights. Read from clients.yaml beside
// the team file.
//
//   clients:
//     - {name: anna, key: "rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7", rights: command}   # The public key, in Z85.
//     - {name: wall_display, key: "...", rights: view}
//
// People or `moonctl clients` write the file. Agents read a changed file again without a restart.
#pragma once

#include <chrono>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "model/error.h"
#include "proto/clients.pb.h"

namespace moondb {

inline constexpr int kListedClientsMax = 256;
inline constexpr char kClientsFile[] = "clients.yaml";

// Reads a client list. On error, returns kNotFound if the file is missing, otherwise kInvalid. Error::text then holds
// one error per line, each with its place in the file. Besides the errors of ReadYaml, these are bad names, malformed
// keys, invalid rights, duplicate names or keys, and too many clients.
Result<proto::ClientList> ReadClientList(const std::filesystem::path& path);
// Parses the text `yaml` by the rules of ReadClientList. `name` is the file name in error messages.
Result<proto::ClientList> ParseClientList(const std::string& yaml, const std::string& name);

// Returns the text of a file for ReadClientList. `head` holds comment lines for the start of the text.
std::string ClientListText(const proto::ClientList& list, const std::string& head);

// The rights of client keys, kept up to date with the file. Not thread-safe.
class ClientKeys {
 public:
  using Time = std::chrono::steady_clock::time_point;

  // Minimum time between two checks of the file.
  static constexpr std::chrono::seconds kLookPeriod{1};

  // Reads the file. If the file is missing, invalid or unreadable, logs this and returns an empty list.
  static ClientKeys Open(std::filesystem::path path, Time now);

  // Returns the client with this public key (Z85), or nothing if the key is not listed. First reads the file again if
  // it has changed, which is checked at most once per kLookPeriod. An invalid file leaves the list unchanged; a missing
  // file empties the list. Logs each reading of the file.
  std::optional<proto::ListedClient> Find(const std::string& key, Time now);

 private:
  // Version of the file. Two files with equal versions are assumed to have equal contents.
  struct Version {
    std::uint64_t inode = 0;
    std::int64_t bytes = -1;      // -1: the file does not exist.
    std::int64_t changed_ns = 0;  // Time of the last change of contents or permissions (ctime).
    bool operator==(const Version&) const = default;
  };

  explicit ClientKeys(std::filesystem::path path) : path_(std::move(path)) {}
  Version FileVersion() const;
  // Reads the file and logs the result. If the file has an error, leaves the list unchanged and appends `if_wrong` to
  // the logged text.
  void Read(const char* if_wrong);

  std::filesystem::path path_;
  Version version_;
  Time looked_;
  std::map<std::string, proto::ListedClient> by_key_;
};

}  // namespace moondb
