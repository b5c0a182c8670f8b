#include "apps/moonctl/robot_facts.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/ip_icmp.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/statfs.h>
#include <sys/timex.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <future>
#include <utility>

#include "actors/storage/store_file.h"
#include "apps/common/data_folder.h"
#include "model/team_member.h"
#include "model/text.h"
#include "runtime/team/team_keys.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;

constexpr long kTmpfs = 0x01021994;  // f_type of tmpfs (statfs(2)).
constexpr long kRamfs = 0x858458f6;
constexpr int kConnectLimit_ms = 2000;
constexpr int kEchoCount = 20;
constexpr milliseconds kEchoPeriod(50);
constexpr milliseconds kEchoPatience(1000);  // Time for the last answers.
constexpr std::size_t kEchoBytes = 512;

std::string TextOf(int error) { return std::strerror(error); }

// A file descriptor that closes itself.
class Descriptor {
 public:
  explicit Descriptor(int descriptor) : descriptor_(descriptor) {}
  ~Descriptor() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return descriptor_; }

 private:
  int descriptor_;
};

struct SocketAddress {
  sockaddr_storage storage{};
  socklen_t size = 0;

  int family() const { return storage.ss_family; }
  const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&storage); }
  std::string text() const {
    char buffer[NI_MAXHOST] = "";
    (void)::getnameinfo(get(), size, buffer, sizeof(buffer), nullptr, 0, NI_NUMERICHOST);
    return buffer;
  }
};

// Returns the address and port of tcp://HOST:PORT, as the agent would: IPv6 only in brackets. The error is the
// resolver's.
Result<SocketAddress> Resolve(const std::string& endpoint) {
  const std::size_t colon = endpoint.rfind(':');
  std::string host = endpoint.substr(6, colon - 6);
  addrinfo hints{};
  hints.ai_family = AF_INET;
  hints.ai_socktype = SOCK_STREAM;
  if (host.starts_with("[") && host.ends_with("]")) {
    host = host.substr(1, host.size() - 2);
    hints.ai_family = AF_INET6;
  }
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(host.c_str(), endpoint.substr(colon + 1).c_str(), &hints, &found);
  if (error != 0) return Fail(ErrorCode::kUnavailable, gai_strerror(error));
  SocketAddress address;
  address.size = found->ai_addrlen;
  std::memcpy(&address.storage, found->ai_addr, address.size);
  ::freeaddrinfo(found);
  return address;
}

std::string ConnectError(const SocketAddress& address) {
  const Descriptor socket(::socket(address.family(), SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (::connect(socket.get(), address.get(), address.size) == 0) return "";
  if (errno != EINPROGRESS) return TextOf(errno);
  pollfd ready{socket.get(), POLLOUT, 0};
  if (::poll(&ready, 1, kConnectLimit_ms) == 0) return "no answer within 2 s";
  int error = 0;
  socklen_t size = sizeof(error);
  ::getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &error, &size);
  return error == 0 ? "" : TextOf(error);
}

std::optional<int> MtuTo(const SocketAddress& address) {
  const Descriptor socket(::socket(address.family(), SOCK_DGRAM | SOCK_CLOEXEC, 0));
  const bool is_6 = address.family() == AF_INET6;
  int mtu = 0;
  socklen_t size = sizeof(mtu);
  const bool is_known =
      ::connect(socket.get(), address.get(), address.size) == 0 &&
      ::getsockopt(socket.get(), is_6 ? IPPROTO_IPV6 : IPPROTO_IP, is_6 ? IPV6_MTU : IP_MTU, &mtu, &size) == 0;
  return is_known ? std::optional(mtu) : std::nullopt;
}

// Checksum of ICMP (RFC 1071). Requires: an even number of bytes.
std::uint16_t ChecksumOf(const std::array<char, kEchoBytes>& bytes) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < bytes.size(); i += 2) {
    std::uint16_t word = 0;
    std::memcpy(&word, bytes.data() + i, sizeof(word));
    sum += word;
  }
  while (sum >> 16 != 0) sum = (sum & 0xffff) + (sum >> 16);
  return static_cast<std::uint16_t>(~sum);
}

// Sends echo requests and returns the fraction without an answer. Null: this user may not, or the address is of IPv6.
std::optional<double> LossTo(const SocketAddress& address) {
  if (address.family() != AF_INET) return std::nullopt;
  constexpr int kFlags = SOCK_NONBLOCK | SOCK_CLOEXEC;
  const int unprivileged = ::socket(AF_INET, SOCK_DGRAM | kFlags, IPPROTO_ICMP);
  // A raw socket, for root, receives the IP header too, and the echo replies of other programs.
  const bool is_raw = unprivileged < 0;
  const Descriptor socket(is_raw ? ::socket(AF_INET, SOCK_RAW | kFlags, IPPROTO_ICMP) : unprivileged);
  if (socket.get() < 0 || ::connect(socket.get(), address.get(), address.size) != 0) return std::nullopt;
  const std::uint16_t port = reinterpret_cast<const sockaddr_in*>(address.get())->sin_port;
  const auto id = static_cast<std::uint16_t>(::getpid() ^ port);
  std::array<bool, kEchoCount> is_answered{};
  const auto hear = [&](milliseconds limit) {
    const auto end = std::chrono::steady_clock::now() + limit;
    for (milliseconds left = limit; left.count() >= 0;
         left = std::chrono::duration_cast<milliseconds>(end - std::chrono::steady_clock::now())) {
      pollfd ready{socket.get(), POLLIN, 0};
      if (::poll(&ready, 1, static_cast<int>(left.count())) <= 0) return;
      std::array<char, 2 * kEchoBytes> bytes{};
      const ssize_t size = ::recv(socket.get(), bytes.data(), bytes.size(), 0);
      const ssize_t begin = is_raw ? 4 * (bytes[0] & 0xf) : 0;
      icmphdr header{};
      if (size < begin + static_cast<ssize_t>(sizeof(header))) continue;
      std::memcpy(&header, bytes.data() + begin, sizeof(header));
      const std::uint16_t sequence = ntohs(header.un.echo.sequence);
      const bool is_own = !is_raw || header.un.echo.id == id;
      if (header.type == ICMP_ECHOREPLY && is_own && sequence < kEchoCount) is_answered[sequence] = true;
    }
  };
  for (int i = 0; i < kEchoCount; ++i) {
    icmphdr header{};
    header.type = ICMP_ECHO;
    header.un.echo.id = id;  // Without a raw socket, the kernel sets the id and the checksum.
    header.un.echo.sequence = htons(static_cast<std::uint16_t>(i));
    std::array<char, kEchoBytes> request{};
    std::memcpy(request.data(), &header, sizeof(header));
    header.checksum = ChecksumOf(request);
    std::memcpy(request.data(), &header, sizeof(header));
    (void)::send(socket.get(), request.data(), request.size(), 0);  // A request that cannot be sent counts as lost.
    hear(kEchoPeriod);
  }
  const auto lost = std::count(is_answered.begin(), is_answered.end(), false);
  if (lost == 0) return 0;
  hear(kEchoPatience);
  return static_cast<double>(std::count(is_answered.begin(), is_answered.end(), false)) / kEchoCount;
}

PeerFacts FactsOfPeer(const proto::AgentConfig& peer) {
  PeerFacts facts;
  facts.agent = peer.id();
  facts.name = peer.name();
  facts.address = peer.address();
  if (!peer.address().starts_with("tcp://")) return facts;
  const auto address = Resolve(peer.address());
  if (!address) {
    facts.lookup_error = address.error().text;
    return facts;
  }
  facts.connect_error = ConnectError(*address);
  facts.mtu_bytes = MtuTo(*address);
  facts.loss = LossTo(*address);
  return facts;
}

std::string KeysError(const TeamFile& team, const proto::AgentConfig& agent) {
  if (team.config.insecure()) return "";
  const auto keys = ReadTeamKeys(team.config, team.folder, agent.id(), "");
  if (!keys) return ToString(keys.error());
  const auto signing = ReadSigningKey(team.config, team.folder, agent.id(), "");
  return signing ? "" : ToString(signing.error());
}

// Returns the folder itself, or the nearest folder above it that exists.
std::filesystem::path ExistingPartOf(const std::filesystem::path& folder) {
  std::error_code failure;
  std::filesystem::path there = std::filesystem::absolute(folder, failure);
  while (!std::filesystem::exists(there, failure) && there != there.parent_path()) there = there.parent_path();
  return there;
}

// Creates and removes a file in a folder.
std::string WriteError(const std::filesystem::path& there) {
  const std::string probe = (there / ".moonctl-doctor").string();
  const Descriptor file(::open(probe.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (file.get() < 0) return there.string() + ": " + TextOf(errno);
  const bool is_written = ::write(file.get(), "x", 1) == 1 && ::fsync(file.get()) == 0;
  const int error = errno;
  ::unlink(probe.c_str());
  return is_written ? "" : there.string() + ": " + TextOf(error);
}

void AddDataFolder(const TeamFile& team, const proto::AgentConfig& agent, const std::string& given, RobotFacts& facts) {
  auto folder = given.empty() ? FindDataFolder(DefaultDataRoot(team.folder), team.config, agent)
                              : Result<std::filesystem::path>(given);
  if (!folder) {
    facts.data_folder_error = ToString(folder.error());
    return;
  }
  facts.data_folder = folder->string();
  const auto owner = ReadDataOwner(*folder);
  if (owner && *owner != DataOwnerOf(team.config, agent)) {
    facts.data_folder_error = facts.data_folder + " holds the data of another agent or team";
    return;
  }
  facts.is_running = OwnerOf(*folder) != 0;
  const std::filesystem::path there = ExistingPartOf(*folder);
  facts.data_folder_error = WriteError(there);
  struct statfs disk {};
  if (::statfs(there.c_str(), &disk) != 0) return;
  facts.disk_free_bytes = static_cast<std::uint64_t>(disk.f_bavail) * static_cast<std::uint64_t>(disk.f_bsize);
  facts.is_memory_disk = disk.f_type == kTmpfs || static_cast<unsigned long>(disk.f_type) == kRamfs;
}

std::string ListenError(const proto::AgentConfig& agent) {
  const std::string& endpoint = ListenAddressOf(agent);
  if (!endpoint.starts_with("tcp://")) return "";
  const auto address = Resolve(endpoint);
  if (!address) return endpoint + ": " + address.error().text;
  const Descriptor socket(::socket(address->family(), SOCK_STREAM | SOCK_CLOEXEC, 0));
  const int yes = 1;
  ::setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes));
  if (::bind(socket.get(), address->get(), address->size) == 0 && ::listen(socket.get(), 1) == 0) return "";
  if (errno == EADDRNOTAVAIL) return endpoint + ": this computer has no such address";
  return endpoint + ": " + TextOf(errno);
}

// Returns "127.0.1.1" if the name at which the agent listens has this address here, as Debian's /etc/hosts gives it to
// a computer's own name: other computers do not reach it. Empty: the name has another address, or is a loopback one.
std::string LoopbackOf(const proto::AgentConfig& agent) {
  const std::string& endpoint = ListenAddressOf(agent);
  if (!endpoint.starts_with("tcp://") || IsLoopback(endpoint)) return "";
  const auto address = Resolve(endpoint);
  if (!address || address->family() != AF_INET) return "";
  const std::string text = address->text();
  return text.starts_with("127.") ? text : "";
}

void AddClock(RobotFacts& facts) {
  const auto now = std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now());
  facts.year = static_cast<int>(std::chrono::year_month_day(now).year());
  timex clock{};
  const int state = ::adjtimex(&clock);
  if (state >= 0) facts.is_clock_synchronised = state != TIME_ERROR && (clock.status & STA_UNSYNC) == 0;
}

std::optional<std::uint64_t> AvailableMemory() {
  std::ifstream file("/proc/meminfo");
  std::string name;
  std::uint64_t kilobytes = 0;
  std::string unit;
  while (file >> name >> kilobytes >> unit) {
    if (name == "MemAvailable:") return kilobytes * 1024;
  }
  return std::nullopt;
}

}  // namespace

RobotFacts GatherFacts(const TeamFile& team, const proto::AgentConfig& agent, const std::string& data_folder) {
  RobotFacts facts;
  std::vector<std::future<PeerFacts>> peers;
  for (const proto::AgentConfig& peer : team.config.agents()) {
    if (peer.id() == agent.id() || peer.left()) continue;
    peers.push_back(std::async(std::launch::async, FactsOfPeer, std::cref(peer)));
  }
  facts.keys_error = KeysError(team, agent);
  AddDataFolder(team, agent, data_folder, facts);
  AddClock(facts);
  if (!facts.is_running) facts.listen_error = ListenError(agent);
  facts.listen_loopback = LoopbackOf(agent);
  facts.sqlite_version = SqliteVersion();
  facts.is_elsewhere = !HasSecretKey(team.config, team.folder, agent) &&
                       std::ranges::any_of(team.config.agents(), [&](const proto::AgentConfig& other) {
                         return HasSecretKey(team.config, team.folder, other);
                       });
  rlimit files{};
  if (::getrlimit(RLIMIT_NOFILE, &files) == 0) facts.open_files_max = files.rlim_max;
  facts.memory_available_bytes = AvailableMemory();
  for (auto& peer : peers) facts.peers.push_back(peer.get());
  return facts;
}

}  // namespace moondb
