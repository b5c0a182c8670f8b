#include "runtime/team/client_list.h"

#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <algorithm>
#include <functional>
#include <utility>

#include "model/rights_name.h"
#include "model/text.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/team_check.h"
#include "runtime/team/trusted_file.h"
#include "runtime/team/yaml_reader.h"

namespace moondb {
namespace {

constexpr std::size_t kClientListBytesMax = 256 * 1024;

class ClientListChecker {
 public:
  ClientListChecker(const proto::ClientList& list, const Places& places, PlacedErrors* errors)
      : list_(list), places_(places), errors_(*errors) {}

  void Check() {
    if (list_.clients_size() > kListedClientsMax) {
      Add("clients",
          "at most " + std::to_string(kListedClientsMax) + " are allowed, got " + std::to_string(list_.clients_size()));
    }
    for (int i = 0; i < list_.clients_size(); ++i) CheckClient(list_.clients(i), PathOf(i));
    CheckUnique("name", [](const proto::ListedClient& client) { return client.name(); });
    CheckUnique("key", [](const proto::ListedClient& client) { return client.key(); });
  }

 private:
  static std::string PathOf(int i) { return "clients[" + std::to_string(i) + "]"; }

  void Add(const std::string& field, const std::string& text) { errors_.Add(PlaceOf(places_, field), field, text); }

  // Returns true if the field is present and has no error. Adds an error if the field is missing.
  bool Require(const std::string& field) {
    if (!places_.contains(field)) Add(field, "missing");
    return !errors_.Has(field);
  }

  void CheckClient(const proto::ListedClient& client, const std::string& path) {
    if (Require(path + ".name") && !IsPlainName(client.name())) {
      Add(path + ".name", kPlainNameRule + Quoted(client.name()));
    }
    if (Require(path + ".key") && !IsCurveKey(client.key())) {
      Add(path + ".key", "expected a public key (40 characters in Z85), got " + Quoted(client.key()));
    }
    if (Require(path + ".rights") && client.rights() == proto::CLIENT_RIGHTS_NONE) {
      Add(path + ".rights", "expected view, share or command, got \"none\"; remove the client from the list instead");
    }
  }

  void CheckUnique(const std::string& field,
                   const std::function<std::string(const proto::ListedClient& client)>& value_of) {
    std::map<std::string, int> owners;
    for (int i = 0; i < list_.clients_size(); ++i) {
      const std::string path = PathOf(i) + "." + field;
      if (!places_.contains(path) || errors_.Has(path)) continue;
      const auto [owner, is_new] = owners.emplace(value_of(list_.clients(i)), i);
      if (!is_new) Add(path, "is already that of " + PathOf(owner->second));
    }
  }

  const proto::ClientList& list_;
  const Places& places_;
  PlacedErrors& errors_;
};

}  // namespace

Result<proto::ClientList> ParseClientList(const std::string& yaml, const std::string& name) {
  PlacedErrors errors(name);
  proto::ClientList list;
  Places places;
  ReadYaml(yaml, &list, &places, &errors);
  if (!places.empty() || errors.empty()) ClientListChecker(list, places, &errors).Check();
  if (!errors.empty()) return Fail(ErrorCode::kInvalid, errors.Text());
  return list;
}

Result<proto::ClientList> ReadClientList(const std::filesystem::path& path) {
  if (const Result<void> trusted = CheckTrusted(path); !trusted) return tl::unexpected(trusted.error());
  const Result<std::string> text = ReadTextFile(path, kClientListBytesMax);
  if (!text) return tl::unexpected(text.error());
  return ParseClientList(*text, path.string());
}

std::string ClientListText(const proto::ClientList& list, const std::string& head) {
  std::string text = head + (list.clients().empty() ? "clients: []\n" : "clients:\n");
  for (const proto::ListedClient& client : list.clients()) {
    // Z85 contains neither quotes nor backslashes, so the key needs no escaping.
    text += "  - {name: " + client.name() + ", key: \"" + client.key() + "\", rights: " + RightsName(client.rights()) +
            "}\n";
  }
  return text;
}

ClientKeys ClientKeys::Open(std::filesystem::path path, Time now) {
  ClientKeys keys(std::move(path));
  keys.looked_ = now;
  keys.version_ = keys.FileVersion();
  keys.Read("no client is admitted until it is repaired");
  return keys;
}

std::optional<proto::ListedClient> ClientKeys::Find(const std::string& key, Time now) {
  if (now >= looked_ + kLookPeriod) {
    looked_ = now;
    if (const Version version = FileVersion(); version != version_) {
      version_ = version;
      Read("the clients listed before stay admitted");
    }
  }
  const auto found = by_key_.find(key);
  return found == by_key_.end() ? std::nullopt : std::optional(found->second);
}

ClientKeys::Version ClientKeys::FileVersion() const {
  struct stat status {};
  if (stat(path_.c_str(), &status) != 0) return {};
  return {status.st_ino, status.st_size, status.st_ctim.tv_sec * 1'000'000'000 + status.st_ctim.tv_nsec};
}

void ClientKeys::Read(const char* if_wrong) {
  const Result<proto::ClientList> list = ReadClientList(path_);
  if (!list && list.error().code != ErrorCode::kNotFound) {
    std::string errors = ToString(list.error());
    std::replace(errors.begin(), errors.end(), '\n', ';');
    return spdlog::error("transport: {}; {}", errors, if_wrong);
  }
  by_key_.clear();
  if (!list) return spdlog::warn("transport: there is no {}: no client is admitted by a key", path_.string());
  for (const proto::ListedClient& client : list->clients()) by_key_[client.key()] = client;
  spdlog::info("transport: {} lists {} client(s)", path_.string(), by_key_.size());
}

}  // namespace moondb
