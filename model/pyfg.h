// PyFG: the text format of pose graphs with ranges (MarineRoboticsGroup/PyFactorGraph), 2-D and 3-D.
//
//   VERTEX_SE2      stamp key x y yaw                 VERTEX_SE3:QUAT  stamp key x y z qx qy qz qw
//   VERTEX_XY       [stamp] key x y                   VERTEX_XYZ       [stamp] key x y z
//   EDGE_SE2        stamp from to x y yaw  +6         EDGE_SE3:QUAT    stamp from to x y z qx qy qz qw  +21
//   EDGE_SE2_XY     stamp from to x y  +3             EDGE_SE3_XYZ     stamp from to x y z  +6
//   EDGE_RANGE      stamp key key range variance
//
// "+n" is the covariance's upper triangle, row by row, translation first. Stamps are seconds, an edge's is that of its
// end; lengths are metres, angles radians. A key is a letter and a number ("A17"). Empty lines and lines that begin
// with '#' are skipped; vertices may stand behind the edges that name them. One file is 2-D or 3-D throughout.
//
// A key becomes a NodeKey whose agent is the letter's place in A..Z, a..z, from 1 (see AgentOfLetter); readers that
// know the team map it to the agents' own ids. A 2-D pose lies in the plane z = 0; its covariance fills rows 0, 1 and
// 5 of the 6 x 6 matrix and the other variances are 1.
//
// What was read is written so that it reads back the same, bit for bit; so is what was computed, but for a 2-D turn
// (1e-15 rad), which the file gives as an angle and memory as a quaternion.
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

// A landmark as a node saw it.
struct PyfgSighting {
  NodeKey from;
  NodeKey to;
  std::int64_t timestamp_ns = 0;
  Eigen::Vector3d from_point_m = Eigen::Vector3d::Zero();  // In the node's frame.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

struct Pyfg {
  bool is_planar = false;
  PoseGraph graph;  // Vertices with a pose in file order, whatever they stand for: truth or a first guess.
  std::vector<PyfgLandmark> landmarks;
  std::vector<PyfgSighting> sightings;
};

// 'A' is 1, 'Z' 26, 'a' 27, 'z' 52; 0 for any other character. LetterOfAgent is its inverse, '?' for other ids.
AgentId AgentOfLetter(char letter);
char LetterOfAgent(AgentId agent);

// "A17". Nothing for what is no letter and number.
std::optional<NodeKey> ParseKey(std::string_view text);
std::string FormatKey(const NodeKey& key);

// kInvalid with field "file:line": an unknown keyword, too few or too many fields, a number that is not finite, a key
// that is no letter and number, a doubled vertex, an edge of a vertex with itself or with one that is nowhere, an edge
// that does not end where its kind must, a quaternion not of length 1 (within 1 %), a covariance that is not positive
// definite, a range below 0 or above 1e6 m, a variance that is not positive, a position beyond 1e9 m, 2-D and 3-D
// mixed, a line longer than kGraphLineBytesMax. `name` stands for the file in errors.
Result<Pyfg> ParsePyfg(std::string_view text, const std::string& name);

// The same from a file, which is read block by block; also the errors of TextLines.
Result<Pyfg> ReadPyfg(const std::filesystem::path& file);

// Vertices, landmarks, odometry, sightings, ranges, each in their order. Agents must be 1 to 52 (Check).
std::string FormatPyfg(const Pyfg& pyfg);

Result<void> WritePyfg(const Pyfg& pyfg, const std::filesystem::path& file);

}  // namespace moondb
