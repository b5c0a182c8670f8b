#include "runtime/transport/connection_rules.h"

#include <arpa/inet.h>

#include <algorithm>
#include <tuple>

namespace moondb {
namespace {

// Returns the network part of an address, which a host cannot choose freely: 24 bits of IPv4, 64 bits of IPv6.
std::string NetworkOf(const std::string& address) {
  in6_addr bits{};
  if (inet_pton(AF_INET6, address.c_str(), &bits) != 1) return address.substr(0, address.rfind('.'));
  return std::string(reinterpret_cast<const char*>(&bits), 8);
}

}  // namespace

void ConnectionRules::OnMessage(int file, std::string_view key, std::uint16_t peer_port, bool has_claimed_id) {
  Delivered& known = delivered_[file];
  if (known.key != key) known.key = key;
  known.peer_port = peer_port;
  known.has_claimed_id = has_claimed_id;
}

bool ConnectionRules::Admit(std::uint16_t port, const std::string& key, const std::string& peer) {
  const auto is_of_key = [&](const auto& entry) {
    return !entry.second.is_cut && entry.second.connection.port == port && entry.second.key == key;
  };
  const auto is_admitted = [&](const Admission& admission) { return admission.port == port && admission.key == key; };
  const auto count = std::ranges::count_if(known_, is_of_key) + std::ranges::count_if(admissions_, is_admitted);
  if (static_cast<std::size_t>(count) >= listeners_.at(port).key_max) return false;
  admissions_.push_back({port, key, peer});
  return true;
}

std::vector<ConnectionRules::Cut> ConnectionRules::Judge(const std::vector<TcpConnection>& connections, Time now) {
  ++look_;
  std::erase_if(remembered_, [now](const auto& entry) { return now - entry.second > kRememberedTime; });
  Update(connections, now);
  EndAdmissions();
  std::vector<Cut> cuts;
  JudgeClaims(cuts);
  for (const auto& [port, listener] : listeners_) {
    JudgeKeys(port, listener, cuts);
    JudgePlaces(port, listener, cuts);
    JudgeBytes(port, listener, cuts);
  }
  return cuts;
}

void ConnectionRules::Remember(const std::string& peer, Time now) {
  remembered_[peer] = now;
  if (remembered_.size() <= kRememberedMax) return;
  remembered_.erase(std::ranges::min_element(remembered_, {}, &std::pair<const std::string, Time>::second));
}

void ConnectionRules::Update(const std::vector<TcpConnection>& connections, Time now) {
  std::map<int, Known> updated;
  for (const TcpConnection& connection : connections) {
    Known known;
    known.connection = connection;
    const auto before = known_.find(connection.file);
    const bool is_same = before != known_.end() && before->second.connection.peer == connection.peer &&
                         before->second.connection.peer_port == connection.peer_port &&
                         before->second.connection.port == connection.port;
    if (is_same) {
      known = before->second;
      known.connection = connection;
    } else {
      known.number = ++last_number_;
    }
    const auto delivered = delivered_.find(connection.file);
    const bool is_its = delivered != delivered_.end() &&
                        (delivered->second.peer_port == 0 || delivered->second.peer_port == connection.peer_port);
    if (is_its) {
      if (!known.has_delivered) {
        const auto admission = std::ranges::find_if(admissions_, [&](const Admission& one) {
          return one.port == connection.port && one.key == delivered->second.key && one.peer == connection.peer;
        });
        if (admission != admissions_.end()) admissions_.erase(admission);
      }
      known.has_delivered = true;
      Remember(connection.peer, now);
      known.has_claimed_id = delivered->second.has_claimed_id;
      known.key = std::move(delivered->second.key);
      known.heard_at = look_;
      known.bytes_delivered = connection.bytes_received;
    }
    updated.emplace(connection.file, std::move(known));
  }
  known_ = std::move(updated);
  delivered_.clear();
}

// For each port and address, keeps as many admissions as there are connections without a message. Removes the oldest
// ones first.
void ConnectionRules::EndAdmissions() {
  std::map<std::pair<std::uint16_t, std::string>, std::size_t> silent;
  for (const auto& [file, known] : known_) {
    if (!known.has_delivered) ++silent[{known.connection.port, known.connection.peer}];
  }
  std::vector<Admission> left;
  for (auto admission = admissions_.rbegin(); admission != admissions_.rend(); ++admission) {
    std::size_t& room = silent[{admission->port, admission->peer}];
    if (room == 0) continue;
    --room;
    left.push_back(std::move(*admission));
  }
  std::ranges::reverse(left);
  admissions_ = std::move(left);
}

void ConnectionRules::JudgeClaims(std::vector<Cut>& cuts) {
  for (auto& [file, known] : known_) {
    if (known.has_claimed_id && !known.is_cut) CutOff(known, Cause::kClaimedId, cuts);
  }
}

void ConnectionRules::JudgeKeys(std::uint16_t port, const Listener& listener, std::vector<Cut>& cuts) {
  std::map<std::string, std::vector<Known*>> groups;
  for (auto& [file, known] : known_) {
    if (!known.is_cut && known.connection.port == port && !known.key.empty()) groups[known.key].push_back(&known);
  }
  for (auto& [key, group] : groups) {
    if (group.size() <= listener.key_max) continue;
    std::sort(group.begin(), group.end(), [](const Known* a, const Known* b) {
      return std::tuple(a->heard_at, a->number) < std::tuple(b->heard_at, b->number);
    });
    for (std::size_t i = 0; i < group.size() - listener.key_max; ++i) CutOff(*group[i], Cause::kTooManyOfKey, cuts);
  }
}

void ConnectionRules::JudgePlaces(std::uint16_t port, const Listener& listener, std::vector<Cut>& cuts) {
  // Connections by address, for the addresses in listener.places. All other connections are under "".
  std::map<std::string, std::vector<Known*>> groups;
  for (auto& [file, known] : known_) {
    if (known.is_cut || known.connection.port != port) continue;
    groups[listener.places.contains(known.connection.peer) ? known.connection.peer : std::string()].push_back(&known);
  }
  for (auto& [address, group] : groups) {
    const std::size_t places = address.empty() ? listener.others_max : listener.places.at(address);
    if (group.size() <= places) continue;
    std::map<std::string, std::size_t> of_network;
    std::map<std::string, std::size_t> of_address;
    for (const Known* known : group) {
      ++of_network[NetworkOf(known->connection.peer)];
      ++of_address[known->connection.peer];
    }
    std::sort(group.begin(), group.end(), [&](const Known* a, const Known* b) {
      const auto rank = [&](const Known& known) {
        const std::string& peer = known.connection.peer;
        const int merit = known.has_delivered ? 2 : remembered_.contains(peer) ? 1 : 0;
        return std::tuple(merit, ~of_network.at(NetworkOf(peer)), ~of_address.at(peer), known.number);
      };
      return rank(*a) < rank(*b);
    });
    for (std::size_t i = 0; i < group.size() - places; ++i) CutOff(*group[i], Cause::kTooMany, cuts);
  }
}

void ConnectionRules::JudgeBytes(std::uint16_t port, const Listener& listener, std::vector<Cut>& cuts) {
  std::vector<Known*> large;
  std::uint64_t bytes = 0;
  for (auto& [file, known] : known_) {
    if (known.is_cut || known.connection.port != port || known.bytes_open() <= kFreeBytes) continue;
    large.push_back(&known);
    bytes += known.bytes_open();
  }
  std::sort(large.begin(), large.end(),
            [](const Known* a, const Known* b) { return a->bytes_open() > b->bytes_open(); });
  for (auto known = large.begin(); known != large.end() && bytes > listener.shared_bytes + kFreeBytes; ++known) {
    bytes -= (*known)->bytes_open();
    CutOff(**known, Cause::kTooMuch, cuts);
  }
}

void ConnectionRules::CutOff(Known& known, Cause cause, std::vector<Cut>& cuts) {
  known.is_cut = true;
  cuts.push_back({known.connection, cause});
}

}  // namespace moondb
