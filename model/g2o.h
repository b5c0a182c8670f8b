// g2o: the text format of pose graphs without ranges, 2-D and 3-D, as the public benchmark sets use it.
//
//   VERTEX_SE2  id x y yaw                 VERTEX_SE3:QUAT  id x y z qx qy qz qw
//   EDGE_SE2    from to x y yaw  +6        EDGE_SE3:QUAT    from to x y z qx qy qz qw  +21
//   FIX         id [id ...]
//
// "+n" is the upper triangle of the INFORMATION (PyFG has the covariance), row by row, translation first. Ids are whole
// numbers of 64 bits. Empty lines and lines that begin with '#' are skipped; vertices may stand behind the edges that
// name them. One file is 2-D or 3-D throughout; a 2-D pose lies in the plane z = 0, and its information fills rows 0, 1
// and 5 of the 6 x 6 matrix, where the other diagonal entries are 1.
//
// A file without a single vertex line is a graph all the same: its edges name the vertices.
//
// What was read is written so that it reads back the same, bit for bit (2-D turns as in model/pyfg.h).
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

struct G2o {
  bool is_planar = false;
  std::vector<G2oVertex> vertices;  // In file order, as are edges and fixed.
  std::vector<G2oEdge> edges;
  std::vector<std::uint64_t> fixed;  // Ids of vertices that stand still.
};

// What an edge's information must be. kBlocks: its translation and its rotation part each have an inverse of positive
// trace, which is all that an isotropic cost takes of it (SE-Sync reads files so). Public files whose numbers were
// rounded hold matrices that are no more positive definite.
enum class InformationCheck { kPositiveDefinite, kBlocks };

// kInvalid with field "file:line": an unknown keyword, too few or too many fields, a number that is not finite, an id
// that is no whole number, a doubled vertex, an edge of a vertex with itself, an edge or FIX with a vertex that is
// nowhere, a quaternion not of length 1 (within 1 %), an information that is not as `check` has it, a position beyond
// 1e9 m, 2-D and 3-D mixed, a line longer than kGraphLineBytesMax. `name` stands for the file in errors.
Result<G2o> ParseG2o(std::string_view text, const std::string& name,
                     InformationCheck check = InformationCheck::kPositiveDefinite);

// The same from a file, which is read block by block; also the errors of TextLines.
Result<G2o> ReadG2o(const std::filesystem::path& file, InformationCheck check = InformationCheck::kPositiveDefinite);

// Vertices, FIX, edges, each in their order.
std::string FormatG2o(const G2o& g2o);

Result<void> WriteG2o(const G2o& g2o, const std::filesystem::path& file);

}  // namespace moondb
