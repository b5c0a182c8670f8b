// Whose keys an agent lets in at its client_address, and with which rights: clients.yaml beside the team file.
//
//   clients:
//     - {name: anna, key: "rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7", rights: command}   # The public key, in Z85.
//     - {name: wall_display, key: "...", rights: view}
//
// Written by people or by `moonctl clients`, read again when it changes: no restart.
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

// kNotFound if there is no such file; else kInvalid: Error::text holds one error a line, each with its place: what
// ReadYaml says, a bad name, a key that is none, rights that are none, two clients of one name or key, too many.
Result<proto::ClientList> ReadClientList(const std::filesystem::path& path);
// The same from text; `name` stands in errors.
Result<proto::ClientList> ParseClientList(const std::string& yaml, const std::string& name);

// As ReadClientList reads it, below `head`: comment lines.
std::string ClientListText(const proto::ClientList& list, const std::string& head);

// The rights of keys as the file has them now. Not thread-safe.
class ClientKeys {
 public:
  using Time = std::chrono::steady_clock::time_point;

  // How often at most the file is looked at.
  static constexpr std::chrono::seconds kLookPeriod{1};

  // A file that is missing, wrong or unreadable lists nobody, so that an agent always starts; the log says so.
  static ClientKeys Open(std::filesystem::path path, Time now);

  // The client that has this public key (Z85) now; none if it is not listed. A file that has become wrong leaves the
  // list as it was; one that is gone lists nobody. Each reading is logged once.
  std::optional<proto::ListedClient> Find(const std::string& key, Time now);

 private:
  // Of the file; equal ones are taken for the same content.
  struct Version {
    std::uint64_t inode = 0;
    std::int64_t bytes = -1;      // -1: there is no file.
    std::int64_t changed_ns = 0;  // Its content or who may read it.
    bool operator==(const Version&) const = default;
  };

  explicit ClientKeys(std::filesystem::path path) : path_(std::move(path)) {}
  Version Look() const;
  // Logs what it came to, with `if_wrong` behind an error.
  void Read(const char* if_wrong);

  std::filesystem::path path_;
  Version version_;
  Time looked_;
  std::map<std::string, proto::ListedClient> by_key_;
};

}  // namespace moondb
