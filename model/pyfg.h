// PyFG: the text format of pose graphs with ranges (MarineRoboticsGroup/PyFactorGraph), 2-D and 3-D.
//
//   VERTEX_SE2      time key x y yaw                  VERTEX_SE3:QUAT  time key x y z qx qy qz qw
//   VERTEX_XY       [time] key x y                    VERTEX_XYZ       [time] key x y z
//   EDGE_SE2        time from to x y yaw  +6          EDGE_SE3:QUAT    time from to x y z qx qy qz qw  +21
//   EDGE_SE2_XY     time from to x y  +3              EDGE_SE3_XYZ     time from to x y z  +6
//   EDGE_RANGE      time key key range variance
//   VERTEX_SE2:PRIOR  time key x y yaw  +6            VERTEX_SE3:QUAT:PRIOR  time key x y z qx qy qz qw  +21
//   VERTEX_XY:PRIOR   time key x y  +3                VERTEX_XYZ:PRIOR       time key x y z  +6
//
// "+n" is the upper triangle of the covariance, row by row, translation first. Times are timestamps in seconds or, from
// 1e17 on, in nanoseconds; the time of an edge is that of its `to` node. A prior of a position (XY, XYZ) may name a
// pose or a landmark. Lengths are in metres, angles in radians. A key is a letter and a number
// ("A17"). Empty lines and lines that begin with '#' are skipped. Edges may precede the vertices that they name. A file
// is either 2-D or 3-D.
//
// A key becomes a NodeKey. NodeKey::agent is the position of the letter in A..Z, a..z, from 1 (see AgentOfLetter);
// callers that know the team replace it by the agent's id. A 2-D pose lies in the plane z = 0. The covariance of a 2-D
// edge fills rows 0, 1 and 5 of the 6 x 6 matrix, and the other variances are 1. A 2-D pose prior becomes a position
// and a yaw.
//
// Writing and reading back is lossless, bit for bit, with one exception: a 2-D rotation is an angle in the file and a
// quaternion in memory. A computed 2-D rotation may therefore change by 1e-15 rad.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/pose_graph.h"

namespace moondb {

struct PyfgLandmark {
  NodeKey key;
  std::optional<std::int64_t> timestamp_ns;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
};

// The position of a landmark relative to a node that observed it.
struct PyfgSighting {
  NodeKey from;
  NodeKey to;
  std::int64_t timestamp_ns = 0;
  Eigen::Vector3d from_point_m = Eigen::Vector3d::Zero();  // Position of the landmark in the frame of the node `from`.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

struct Pyfg {
  bool is_planar = false;
  // Nodes are the pose vertices, in file order. Their poses may be true poses or initial values. All relative poses of
  // the file are in `odometry`. Priors may name landmarks; they have no source.
  PoseGraph graph;
  std::vector<PyfgLandmark> landmarks;
  std::vector<PyfgSighting> sightings;
};

// Convert between letters and agent ids: 'A' is 1, 'Z' is 26, 'a' is 27, 'z' is 52. AgentOfLetter returns 0 for other
// characters, and LetterOfAgent returns '?' for other ids.
AgentId AgentOfLetter(char letter);
char LetterOfAgent(AgentId agent);

// Parse and format a key such as "A17". ParseKey returns nullopt unless the text is a letter and a number.
std::optional<NodeKey> ParseKey(std::string_view text);
std::string FormatKey(const NodeKey& key);

// Parses a PyFG file. `name` is the file's name in errors. Fails with kInvalid and the field "file:line" for:
//   - a line with an unknown keyword, too few or too many fields, or more than kGraphLineBytesMax bytes;
//   - a number that is not finite, a key that is not a letter and a number, or a position beyond 1e9 m;
//   - a duplicate vertex, an edge from a vertex to itself, or an edge with an undefined vertex;
//   - an edge or prior that names a landmark where a pose is required, or a pose where a landmark is required;
//   - a quaternion whose length is not 1 (within 1 %), or a covariance that is not positive definite;
//   - a range below 0 or above 1e6 m, or a variance that is not positive;
//   - a mix of 2-D and 3-D lines.
Result<Pyfg> ParsePyfg(std::string_view text, const std::string& name);

// Like ParsePyfg, but reads the text from a file, block by block. Also fails with the errors of TextLines.
Result<Pyfg> ReadPyfg(const std::filesystem::path& file);

// Returns the text of a PyFG file: poses, landmarks, odometry and loop closures, sightings, ranges, priors, each in
// list order. In a 3-D file, a prior of a position and a yaw is written as a pose (WithTilt). Requires: agent ids are 1
// to 52, and priors measure the body's origin; otherwise Check aborts.
std::string FormatPyfg(const Pyfg& pyfg);

Result<void> WritePyfg(const Pyfg& pyfg, const std::filesystem::path& file);

}  // namespace moondb
