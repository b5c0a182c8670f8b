#include "apps/moondb_ros/dds/network_interfaces.h"

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <sstream>

namespace moondb {
namespace {

// Name of the interface of the default route; an empty name if there is none.
std::string DefaultRouteInterface() {
  std::ifstream routes("/proc/net/route");
  std::string line;
  std::getline(routes, line);  // The heading.
  while (std::getline(routes, line)) {
    std::istringstream fields(line);
    std::string name;
    std::string destination;
    if (fields >> name >> destination && destination == "00000000") return name;
  }
  return "";
}

}  // namespace

RosInterfaces FindRosInterfaces() {
  RosInterfaces found;
  ifaddrs* first = nullptr;
  if (getifaddrs(&first) != 0) return {{"lo"}, {}, ""};
  const std::unique_ptr<ifaddrs, void (*)(ifaddrs*)> owner(first, freeifaddrs);
  std::vector<std::string> names;
  for (const ifaddrs* at = first; at != nullptr; at = at->ifa_next) {
    const bool is_up = (at->ifa_flags & IFF_UP) != 0;  // Also without a link, as a radio that is out of reach.
    if (!is_up || at->ifa_addr == nullptr || at->ifa_addr->sa_family != AF_INET) continue;
    char address[INET_ADDRSTRLEN] = "";
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(at->ifa_addr)->sin_addr, address, sizeof address);
    found.addresses += std::string(at->ifa_name) + " " + address + "\n";
    if (std::ranges::find(names, at->ifa_name) == names.end()) names.emplace_back(at->ifa_name);
  }
  const std::string preferred = DefaultRouteInterface();
  const auto rank = [&preferred](const std::string& name) { return name == "lo" ? 0 : name == preferred ? 1 : 2; };
  std::ranges::stable_sort(names, {}, rank);
  for (const std::string& name : names) {
    (found.used.size() < kRosInterfacesMax ? found.used : found.left_out).push_back(name);
  }
  return found;
}

std::string CycloneConfig(const RosInterfaces& interfaces) {
  std::string text = "<CycloneDDS><Domain Id=\"any\"><General><Interfaces>";
  for (const std::string& name : interfaces.used) {
    text += "<NetworkInterface name=\"" + name + "\" priority=\"" + (name == "lo" ? "10" : "0") +
            "\" multicast=\"false\"/>";
  }
  // ParticipantIndex: other programs find this one by its port. MaxAutoParticipantIndex is the limit of a domain's
  // ports. SPDPInterval is the time after which a program that starts later is found.
  return text +
         "</Interfaces><AllowMulticast>false</AllowMulticast><MaxMessageSize>1400B</MaxMessageSize></General>"
         "<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>119</MaxAutoParticipantIndex>"
         "<SPDPInterval>1s</SPDPInterval><Peers><Peer address=\"127.0.0.1\"/></Peers></Discovery></Domain>"
         "</CycloneDDS>";
}

}  // namespace moondb
