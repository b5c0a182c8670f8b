#include "model/tum.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

constexpr const char* kText =
    "# timestamp x y z qx qy qz qw\n"
    "1671300425.3106995 0.1 -2e-3 3 0 0 0.6 0.8\n"
    "\n"
    "10 1 2 3 0 0 0 1\r\n";

std::string ErrorOf(const std::string& text) {
  const auto poses = ParseTum(text, "rover1.tum");
  return poses ? "no error" : poses.error().field + ": " + poses.error().text;
}

TEST(TumTest, ReadsEveryField) {
  const auto poses = ParseTum(kText, "rover1.tum");
  ASSERT_TRUE(poses) << ToString(poses.error());
  ASSERT_EQ(poses->size(), 2u);
  EXPECT_EQ(poses->front().timestamp_ns, 1671300425310699500);
  EXPECT_EQ(poses->front().map_from_body.position_m, Eigen::Vector3d(0.1, -0.002, 3));
  EXPECT_EQ(poses->front().map_from_body.orientation.z(), 0.6);
  EXPECT_EQ(poses->front().map_from_body.orientation.w(), 0.8);
}

TEST(TumTest, WritesWhatReadsBackTheSame) {
  const std::string written = FormatTum(*ParseTum(kText, "rover1.tum"));
  EXPECT_EQ(written, "1671300425.3106995 0.1 -0.002 3 0 0 0.6 0.8\n10 1 2 3 0 0 0 1\n");
  EXPECT_EQ(FormatTum(*ParseTum(written, "rover1.tum")), written);
}

TEST(TumTest, WritesProvenanceInComments) {
  const std::vector<TumPose> poses = *ParseTum(kText, "rover1.tum");
  const std::string written = FormatTum(poses, {{"agent", "rover1"}, {"poses", "raw"}});
  EXPECT_EQ(written, "# agent: rover1\n# poses: raw\n" + FormatTum(poses));
  EXPECT_EQ(ParseTum(written, "rover1.tum")->size(), 2u);
}

TEST(TumTest, NamesTheLineOfEachError) {
  const std::string text = kText;
  EXPECT_EQ(ErrorOf(text + "1 2 3\n"), "rover1.tum:5: the line ends too early");
  EXPECT_EQ(ErrorOf(text + "1 2 3 4 0 0 0 1 9\n"), "rover1.tum:5: the line has too many fields");
  EXPECT_EQ(ErrorOf(text + "1 2 nan 4 0 0 0 1\n"), "rover1.tum:5: 'nan' is not a finite number");
  EXPECT_EQ(ErrorOf(text + "x 2 3 4 0 0 0 1\n"), "rover1.tum:5: 'x' is not a timestamp in seconds");
  EXPECT_EQ(ErrorOf(text + "1 2 3 4 0 0 0 2\n"), "rover1.tum:5: the quaternion has the length 2, not 1");
}

}  // namespace
}  // namespace moondb
