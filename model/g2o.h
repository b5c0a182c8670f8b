// g2o: the text format of the public benchmark sets, for 2-D and 3-D pose graphs without ranges.
//
//   VERTEX_SE2  id x y yaw                 VERTEX_SE3:QUAT  id x y z qx qy qz qw
//   EDGE_SE2    from to x y yaw  +6        EDGE_SE3:QUAT    from to x y z qx qy qz qw  +21
//   EDGE_PRIOR_SE2     id x y yaw  +6      EDGE_SE3_PRIOR     id offset x y z qx qy qz qw  +21
//   EDGE_PRIOR_SE2_XY  id x y  +3          EDGE_SE3_XYZ_PRIOR id offset x y z  +6
//   FIX         id [id ...]                PARAMS_SE3OFFSET   offset x y z qx qy qz qw
//
// Offsets must be the identity. The information of a pose prior is in the frame of the measured pose, that of a
// position prior in the frame `map`.
//
// "+n" is the upper triangle of the INFORMATION matrix (PyFG has the covariance), row by row, translation first. Ids
// are 64-bit integers. Empty lines and lines that begin with '#' are skipped. Edges may precede the vertices that they
// name. A file is either 2-D or 3-D. A 2-D pose lies in the plane z = 0. The information of a 2-D edge fills rows 0, 1
// and 5 of the 6 x 6 matrix; the other diagonal entries are 1.
//
// In a file without vertex lines, the edges define the vertices.
//
// Writing and reading back is lossless, bit for bit (for 2-D rotations as described in model/pyfg.h).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/geometry.h"
#include "model/pose_graph.h"

namespace moondb {

struct G2oVertex {
  std::uint64_t id = 0;
  Pose map_from_vertex;
};

struct G2oEdge {
  std::uint64_t from = 0;
  std::uint64_t to = 0;
  Pose from_from_to;
  Matrix6d information = Matrix6d::Identity();
};

// An absolute measurement of a vertex.
struct G2oPrior {
  std::uint64_t id = 0;
  PriorExtent extent = PriorExtent::kPose;      // kPose or kPosition.
  Pose map_from_vertex;                         // The orientation is the identity for kPosition.
  Matrix6d information = Matrix6d::Identity();  // For kPosition, the first three rows and columns count.
};

struct G2o {
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

// Parses a g2o file. `name` is the file's name in errors. Fails with kInvalid and the field "file:line" for:
//   - a line with an unknown keyword, too few or too many fields, or more than kGraphLineBytesMax bytes;
//   - a number that is not finite, an id that is not an integer, or a position beyond 1e9 m;
//   - a duplicate vertex, an edge from a vertex to itself, or an edge, prior or FIX with an undefined vertex;
//   - an offset that is not the identity, or is not defined on an earlier line;
//   - a quaternion whose length is not 1 (within 1 %), or an information matrix that fails `check`;
//   - a mix of 2-D and 3-D lines.
Result<G2o> ParseG2o(std::string_view text, const std::string& name,
                     InformationCheck check = InformationCheck::kPositiveDefinite);

// Like ParseG2o, but reads the text from a file, block by block. Also fails with the errors of TextLines.
Result<G2o> ReadG2o(const std::filesystem::path& file, InformationCheck check = InformationCheck::kPositiveDefinite);

// Returns the text of a g2o file: first the vertices, then FIX lines, then edges, then priors, each in list order.
std::string FormatG2o(const G2o& g2o);

Result<void> WriteG2o(const G2o& g2o, const std::filesystem::path& file);

}  // namespace moondb
