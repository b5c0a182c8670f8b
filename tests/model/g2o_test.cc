#include "model/g2o.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "model/text.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

constexpr const char* kSpatial =
    "# a comment\n"
    "VERTEX_SE3:QUAT 18446744073709551615 0.1 -2e-3 3 0 0 0 1\n"
    "VERTEX_SE3:QUAT 7 1.1 0 0 0 0 0.6 0.8\n"
    "\n"
    "FIX 7\n"
    "EDGE_SE3:QUAT 18446744073709551615 7 1 0 0 0 0 0.6 0.8 2 0 0 0 0 0.1 2 0 0 0 0 2 0 0 0 3 0 0 3 0 3\n";
constexpr const char* kPlanar =
    "VERTEX_SE2 0 1 2 0.3\n"
    "VERTEX_SE2 1 2 2 -3.3\n"
    "EDGE_SE2 0 1 1 0.1 0.7 10 0.5 0 11 0 12\n";

constexpr char kInNoVertexLine[] =
    " is in no vertex line: give all files of the graph, such as moonctl graph import 0.g2o 1.g2o";

std::string ErrorOf(const std::string& text) {
  const Result<G2o> g2o = ParseG2o(text, "graph.g2o");
  return g2o ? "no error" : g2o.error().field + ": " + g2o.error().text;
}

TEST(G2oTest, ReadsEveryField) {
  const Result<G2o> g2o = ParseG2o(kSpatial, "graph.g2o");
  ASSERT_TRUE(g2o) << ToString(g2o.error());
  EXPECT_FALSE(g2o->is_planar);
  ASSERT_EQ(g2o->vertices.size(), 2u);
  EXPECT_EQ(g2o->vertices[0].id, 18446744073709551615u);
  EXPECT_EQ(g2o->vertices[0].map_from_vertex.position_m, Eigen::Vector3d(0.1, -0.002, 3));
  EXPECT_THAT(g2o->fixed, testing::ElementsAre(7u));
  ASSERT_EQ(g2o->edges.size(), 1u);
  EXPECT_EQ(g2o->edges[0].to, 7u);
  EXPECT_EQ(g2o->edges[0].from_from_to.orientation.w(), 0.8);
  EXPECT_EQ(g2o->edges[0].information(5, 0), 0.1);
  EXPECT_EQ(g2o->edges[0].information(3, 3), 3);
}

TEST(G2oTest, PutsPlanarInformationIntoRowsOfXYAndYaw) {
  const Result<G2o> g2o = ParseG2o(kPlanar, "graph.g2o");
  ASSERT_TRUE(g2o) << ToString(g2o.error());
  EXPECT_TRUE(g2o->is_planar);
  EXPECT_EQ(g2o->edges[0].information(0, 1), 0.5);
  EXPECT_EQ(g2o->edges[0].information(5, 5), 12);
  EXPECT_EQ(g2o->edges[0].information(2, 2), 1);
}

TEST(G2oTest, WritesWhatReadsBackTheSame) {
  for (const char* text : {kSpatial, kPlanar}) {
    const std::string written = FormatG2o(*ParseG2o(text, "graph.g2o"));
    const Result<G2o> again = ParseG2o(written, "written.g2o");
    ASSERT_TRUE(again) << ToString(again.error());
    EXPECT_EQ(FormatG2o(*again), written);
  }
  EXPECT_EQ(FormatG2o(*ParseG2o(kPlanar, "graph.g2o")), kPlanar);
}

TEST(G2oTest, ReadsAndWritesPriors) {
  const std::string spatial =
      "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nPARAMS_SE3OFFSET 0 0 0 0 0 0 0 1\n"
      "EDGE_SE3_PRIOR 0 0 1 2 3 0 0 0 1 4 0 0 0 0 0 4 0 0 0 0 4 0 0 0 9 0 0 9 0 9\n"
      "EDGE_SE3_XYZ_PRIOR 0 0 1 2 3 4 0.5 0 4 0 4\n";
  const Result<G2o> read = ParseG2o(spatial, "a.g2o");
  ASSERT_TRUE(read) << ToString(read.error());
  ASSERT_EQ(read->priors.size(), 2u);
  EXPECT_EQ(read->priors[0].information(5, 5), 9);
  EXPECT_EQ(read->priors[1].extent, PriorExtent::kPosition);
  EXPECT_EQ(read->priors[1].information(1, 0), 0.5);
  const Result<G2o> again = ParseG2o(FormatG2o(*read), "a.g2o");
  ASSERT_TRUE(again) << ToString(again.error());
  EXPECT_EQ(FormatG2o(*again), FormatG2o(*read));
  const Result<G2o> planar =
      ParseG2o("VERTEX_SE2 7 0 0 0\nEDGE_PRIOR_SE2 7 1 2 0.5 4 0 0 4 0 9\nEDGE_PRIOR_SE2_XY 7 1 2 4 0 4\n", "a.g2o");
  ASSERT_TRUE(planar) << ToString(planar.error());
  EXPECT_EQ(planar->priors.size(), 2u);
  EXPECT_EQ(
      ParseG2o("VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nEDGE_SE3_XYZ_PRIOR 0 3 1 2 3 4 0 0 4 0 4\n", "a.g2o").error().field,
      "a.g2o:2")
      << "no offset 3";
  EXPECT_EQ(ParseG2o("PARAMS_SE3OFFSET 0 1 0 0 0 0 0 1\n", "a.g2o").error().field, "a.g2o:1") << "not the identity";
}

TEST(G2oTest, ReadsAGraphOfEdgesAlone) {
  const std::string text = "EDGE_SE2 0 5 1 0 0.5 1 0 0 1 0 1\n";
  const Result<G2o> g2o = ParseG2o(text, "graph.g2o");
  ASSERT_TRUE(g2o) << ToString(g2o.error());
  EXPECT_TRUE(g2o->vertices.empty());
  EXPECT_EQ(FormatG2o(*g2o), text);
}

TEST(G2oTest, RefusesToFixAVertexThatNoEdgeNames) {
  const std::string edge = "EDGE_SE2 0 5 1 0 0.5 1 0 0 1 0 1\n";
  EXPECT_TRUE(ParseG2o("FIX 5\n" + edge, "graph.g2o"));
  EXPECT_EQ(ErrorOf("FIX 99\n" + edge), std::string("graph.g2o:1: vertex 99") + kInNoVertexLine);
}

TEST(G2oTest, TakesAMatrixByItsBlocksWhereAsked) {
  const auto error_of = [](const std::string& information) {
    const Result<G2o> g2o =
        ParseG2o("EDGE_SE2 0 1 1 0 0.5 " + information + "\n", "a.g2o", {.check = InformationCheck::kBlocks});
    return g2o ? "no error" : g2o.error().text;
  };
  const std::string indefinite = "1 0 5 1 0 2";  // The correlation is above 1, so the matrix is not positive definite.
  EXPECT_EQ(error_of(indefinite), "no error");
  EXPECT_EQ(ErrorOf("EDGE_SE2 0 1 1 0 0.5 " + indefinite + "\n"),
            "graph.g2o:1: the information is not positive definite");
  EXPECT_EQ(error_of("1 0 0 -3 0 2"), "no error") << "the traces of the inverses count, 1 - 1 / 3 and 1 / 2";
  EXPECT_EQ(error_of("1 1 0 1 0 2"), "the translation's information has no inverse of positive trace");
  EXPECT_EQ(error_of("-1 0 0 -1 0 2"), "the translation's information has no inverse of positive trace");
  EXPECT_EQ(error_of("1 0 0 1 0 0"), "the rotation's information has no inverse of positive trace");
}

TEST(G2oTest, NamesTheLineOfEachError) {
  const std::string text = kPlanar;
  EXPECT_EQ(ErrorOf(text + "VERTEX_SE2 1 0 0 0\n"), "graph.g2o:4: the vertex 1 occurs a second time");
  EXPECT_EQ(ErrorOf(text + "EDGE_SE2 0 5 0 0 0 1 0 0 1 0 1\n"), std::string("graph.g2o:4: vertex 5") + kInNoVertexLine);
  EXPECT_EQ(ErrorOf(text + "EDGE_SE2 1 1 0 0 0 1 0 0 1 0 1\n"), "graph.g2o:4: the edge joins a vertex with itself");
  EXPECT_EQ(ErrorOf(text + "EDGE_SE2 0 1 0 0 nan 1 0 0 1 0 1\n"), "graph.g2o:4: 'nan' is not a finite number");
  EXPECT_EQ(ErrorOf(text + "EDGE_SE2 0 1 0 0 0 1 0 0 -1 0 1\n"),
            "graph.g2o:4: the information is not positive definite");
  EXPECT_EQ(ErrorOf(text + "VERTEX_SE3:QUAT 2 0 0 0 0 0 0 1\n"), "graph.g2o:4: 2-D and 3-D are mixed in one file");
  EXPECT_EQ(ErrorOf(text + "FIX 9\n"), std::string("graph.g2o:4: vertex 9") + kInNoVertexLine);
  EXPECT_EQ(ErrorOf(text + "FIX\n"), "graph.g2o:4: the line ends too early");
  EXPECT_EQ(ErrorOf(text + "VERTEX_SE2 2 0 0 0 0\n"), "graph.g2o:4: the line has too many fields");
  EXPECT_EQ(ErrorOf(text + "VERTEX_SE2 -2 0 0 0\n"), "graph.g2o:4: '-2' is not the number of a vertex");
  EXPECT_EQ(ErrorOf(text + "VERTEX_XYZ 2 0 0 0\n"), "graph.g2o:4: 'VERTEX_XYZ' is not a known keyword of g2o");
}

TEST(G2oTest, RefusesEdgesWithoutAMatrixUnlessSigmasAreGiven) {
  const std::string spatial = "EDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1";
  EXPECT_EQ(ErrorOf(spatial),
            "graph.g2o:1: EDGE_SE3:QUAT 0 1 has no information matrix (21 numbers): --edge-sigmas M,RAD gives one to "
            "all such edges");
  EXPECT_EQ(ErrorOf("EDGE_SE2 0 1 1 0 0.5"),
            "graph.g2o:1: EDGE_SE2 0 1 has no information matrix (6 numbers): --edge-sigmas M,RAD gives one to all "
            "such edges");
  const G2oOptions options{.check = InformationCheck::kPositiveDefinite, .edge_sigmas = EdgeSigmas{0.5, 0.25}};
  const Result<G2o> read =
      ParseG2o(spatial + "\n" + spatial + " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1", "a.g2o", options);
  ASSERT_TRUE(read) << ToString(read.error());
  Eigen::Vector<double, 6> diagonal;
  diagonal << 4, 4, 4, 16, 16, 16;
  EXPECT_EQ(read->edges.at(0).information, Matrix6d(diagonal.asDiagonal()));
  EXPECT_EQ(read->edges.at(1).information, Matrix6d(Matrix6d::Identity())) << "its own matrix counts";
  const Result<G2o> planar = ParseG2o("EDGE_SE2 0 1 1 0 0.5", "a.g2o", options);
  ASSERT_TRUE(planar) << ToString(planar.error());
  diagonal << 4, 4, 1, 1, 1, 16;
  EXPECT_EQ(planar->edges.at(0).information, Matrix6d(diagonal.asDiagonal()));
}

TEST(G2oTest, SaysHowManyNumbersOfAMatrixThereAre) {
  EXPECT_EQ(ErrorOf("EDGE_SE2 0 1 1 0 0.5 1 0 0 1\n"), "graph.g2o:1: the information matrix has 4 numbers, not 6");
  EXPECT_EQ(ErrorOf("EDGE_SE2 0 1 1 0\n"), "graph.g2o:1: the line ends too early");
  EXPECT_EQ(ErrorOf("EDGE_SE2 0 1 1 0 0.5 1 0 0 1 0 1 7\n"), "graph.g2o:1: the line has too many fields");
}

TEST(G2oTest, NamesDecimalCommasAndBlanksWithinKeywords) {
  EXPECT_EQ(ErrorOf("VERTEX_SE2 0 -0,5 1 0\n"), "graph.g2o:1: '-0,5' has a decimal comma: write -0.5");
  EXPECT_EQ(ErrorOf("VERTEX_SE2 0 1,2,3 1 0\n"), "graph.g2o:1: '1,2,3' is not a finite number");
  for (const char* split : {"VERTEX_SE3 : QUAT", "VERTEX_SE3: QUAT", "VERTEX_SE3 :QUAT"}) {
    EXPECT_EQ(ErrorOf(std::string(split) + " 0 0 0 0 0 0 0 1\n"),
              "graph.g2o:1: a blank within 'VERTEX_SE3:QUAT': write it as one word");
  }
  EXPECT_EQ(ErrorOf("EDGE_SE3 : QUAT 0 1\n"), "graph.g2o:1: a blank within 'EDGE_SE3:QUAT': write it as one word");
}

TEST(G2oTest, PriorsMayRepeatTheirVertexInPlaceOfAnOffset) {
  const std::string vertex = "VERTEX_SE3:QUAT 1 0 0 0 0 0 0 1\n";
  const Result<G2o> read = ParseG2o(vertex + "EDGE_SE3_XYZ_PRIOR 1 1 1 2 3 4 0 0 4 0 4", "a.g2o");
  ASSERT_TRUE(read) << ToString(read.error());
  EXPECT_EQ(read->priors.at(0).map_from_vertex.position_m, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(ErrorOf(vertex + "EDGE_SE3_XYZ_PRIOR 1 2 1 2 3 4 0 0 4 0 4\n"),
            "graph.g2o:2: no line above defines the parameter 2: add PARAMS_SE3OFFSET 2 0 0 0 0 0 0 1");
}

TEST(G2oTest, FilesAreOneGraphInWhichARepeatedEdgeCountsOnce) {
  const TemporaryFolder folder;
  const std::string closure = "EDGE_SE2 0 5 1 0 0.5 1 0 0 1 0 1\n";
  const std::string first = folder.path() / "0.g2o";
  const std::string second = folder.path() / "1.g2o";
  ASSERT_TRUE(WriteTextFile(first, "VERTEX_SE2 0 0 0 0\n" + closure + closure));
  ASSERT_TRUE(WriteTextFile(second, "VERTEX_SE2 5 1 0 0\n" + closure + "EDGE_SE2 0 5 1 0 0.25 1 0 0 1 0 1\n"));
  const Result<G2o> read = ReadG2oFiles({first, second});
  ASSERT_TRUE(read) << ToString(read.error());
  EXPECT_EQ(read->vertices.size(), 2u);
  EXPECT_EQ(read->edges.size(), 3u) << "two of the first file, and the other measurement of the second";
  EXPECT_EQ(PlaceText(*read, read->vertices[1].place), second + ":1");
  EXPECT_EQ(ReadG2o(first).error().field, first + ":2");
  const Result<G2o> twice = ReadG2oFiles({first, first});
  ASSERT_FALSE(twice);
  EXPECT_EQ(twice.error().text,
            "the vertex 0 is also in " + first + ": import files with plain ids one by one, each with -a");
}

TEST(G2oTest, ReadsThePublicSetsExactly) {
  const char* data = std::getenv("MOONDB_DATA");
  if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set: no public graphs to read";
  for (const char* name : {"sphere2500.g2o", "torus3D.g2o", "parking-garage.g2o"}) {
    const Result<G2o> g2o = ReadG2o(std::filesystem::path(data) / "pose_graphs" / name);
    ASSERT_TRUE(g2o) << ToString(g2o.error());
    const std::string written = FormatG2o(*g2o);
    EXPECT_EQ(FormatG2o(*ParseG2o(written, name)), written);
  }
}

}  // namespace
}  // namespace moondb
