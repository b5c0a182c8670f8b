// g2o: the text format of the public benchmark sets, for 2-D and 3-D pose graphs without ranges.
//
//   VERTEX_SE2  id x y yaw                 VERTEX_SE3:QUAT  id x y z qx qy qz qw
//   EDGE_SE2    from to x y yaw  +6        EDGE_SE3:QUAT    from to x y z qx qy qz qw  +21
//   EDGE_PRIOR_SE2     id x y yaw  +6      EDGE_SE3_PRIOR     id offset x y z qx qy qz qw  +21
//   EDGE_PRIOR_SE2_XY  id x y  +3          EDGE_SE3_XYZ_PRIOR id offset x y z  +6
//   FIX         id [id ...]                PARAMS_SE3OFFSET   offset x y z qx qy qz qw
//
// Offsets must be the identity. RTAB-Map defines none, and repeats the id of the vertex as that of the offset; this
// prior has no offset either. The information of a pose prior is in the frame of the measured pose, that of a
// position prior in the frame `map`.
//
// "+n" is the upper triangle of the INFORMATION matrix (PyFG has the covariance), row by row, translation first. Some
// programs, such as SC-LIO-SAM, omit the matrix of edges; see G2oOptions::edge_sigmas. Ids are 64-bit integers
// (model/g2o_id.h). Empty lines and lines that begin with '#' are skipped. Edges may precede the vertices that they
// name. A file is either 2-D or 3-D. A 2-D pose lies in the plane z = 0. The information of a 2-D edge fills rows 0, 1
// and 5 of the 6 x 6 matrix; the other diagonal entries are 1.
//
// In a graph without vertex lines, the edges define the vertices. A graph may have several files, for example one for
// each robot. An edge that a later file repeats is one measurement.
//
// Writing and reading back is lossless, bit for bit (for 2-D rotations as described in model/pyfg.h).
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/geometry.h"
#include "model/pose_graph.h"

namespace moondb {

// A line of a file that was read.
struct G2oPlace {
  std::size_t file = 0;  // Index in G2o::files.
  std::size_t line = 0;  // Counted from 1.
};

struct G2oVertex {
  std::uint64_t id = 0;
  Pose map_from_vertex;
  G2oPlace place = {};
};

struct G2oEdge {
  std::uint64_t from = 0;
  std::uint64_t to = 0;
  Pose from_from_to;
  Matrix6d information = Matrix6d::Identity();
  G2oPlace place = {};
};

// An absolute measurement of a vertex.
struct G2oPrior {
  std::uint64_t id = 0;
  PriorExtent extent = PriorExtent::kPose;      // kPose or kPosition.
  Pose map_from_vertex;                         // The orientation is the identity for kPosition.
  Matrix6d information = Matrix6d::Identity();  // For kPosition, the first three rows and columns count.
};

struct G2o {
  std::vector<std::string> files;  // Names of the files that were read.
  bool is_planar = false;
  std::vector<G2oVertex> vertices;  // In file order, like the other lists.
  std::vector<G2oEdge> edges;
  std::vector<G2oPrior> priors;
  std::vector<std::uint64_t> fixed;  // Ids of the vertices whose poses are held fixed.
};

// How ParseG2o checks an edge's information matrix. kBlocks requires only that the translation block and the rotation
// block each have an inverse of positive trace, which suffices for an isotropic cost (as in SE-Sync). Some public files
// pass only kBlocks, because rounding made their matrices lose positive definiteness.
enum class InformationCheck { kPositiveDefinite, kBlocks };

// Standard deviations of the position and of the rotation, equal on all axes.
struct EdgeSigmas {
  double position_m = 1;
  double rotation_rad = 1;
};

struct G2oOptions {
  InformationCheck check = InformationCheck::kPositiveDefinite;
  // For edges without an information matrix. Null: such edges are refused.
  std::optional<EdgeSigmas> edge_sigmas = std::nullopt;
};

// Parses a g2o file. `name` is the file's name in errors. Fails with kInvalid and the field "file:line" for:
//   - a line with an unknown keyword, too few or too many fields, or more than kGraphLineBytesMax bytes;
//   - a number that is not finite, an id that is not an integer, or a position beyond 1e9 m;
//   - a duplicate vertex, an edge from a vertex to itself, or an edge, prior or FIX with an undefined vertex;
//   - an offset that is not the identity, or that no earlier line defines (unless it is the id of the prior's vertex);
//   - a quaternion whose length is not 1 (within 1 %), or an information matrix that fails the check of the options;
//   - a mix of 2-D and 3-D lines.
Result<G2o> ParseG2o(std::string_view text, const std::string& name, const G2oOptions& options = {});

// Like ParseG2o, but reads the text from a file, block by block. Also fails with the errors of TextLines.
Result<G2o> ReadG2o(const std::filesystem::path& file, const G2oOptions& options = {});

// Like ReadG2o, but reads all files of one graph.
Result<G2o> ReadG2oFiles(const std::vector<std::string>& files, const G2oOptions& options = {});

// Returns "file:line". Returns an empty text if the graph was not read from a file.
std::string PlaceText(const G2o& g2o, const G2oPlace& place);

// Returns the text of a g2o file: first the vertices, then FIX lines, then edges, then priors, each in list order.
std::string FormatG2o(const G2o& g2o);

Result<void> WriteG2o(const G2o& g2o, const std::filesystem::path& file);

}  // namespace moondb
