// The network interfaces on which moondb_ros meets other programs of this computer, and Cyclone's configuration for
// them.
//
// ROS 2's default middleware announces addresses of real network interfaces, so a participant on `lo` alone does not
// find it. The configuration therefore uses `lo` and up to three other interfaces. It turns multicast off and names
// 127.0.0.1 as the only peer: programs of this computer find it, other computers do not, and it sends them nothing.
// Thread-safe.
#pragma once

#include <string>
#include <vector>

namespace moondb {

inline constexpr std::size_t kRosInterfacesMax = 4;  // Cyclone's limit, `lo` included.

// The interfaces that are up and have an IPv4 address.
struct RosInterfaces {
  std::vector<std::string> used;      // `lo` first, then that of the default route; at most kRosInterfacesMax.
  std::vector<std::string> left_out;  // For which there is no room.
  std::string addresses;              // All names and addresses, as one text to compare.
};
RosInterfaces FindRosInterfaces();

// Returns the configuration for dds_create_domain.
std::string CycloneConfig(const RosInterfaces& interfaces);

}  // namespace moondb
