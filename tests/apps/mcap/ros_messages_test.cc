#include "apps/mcap/ros_messages.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

// Returns the bytes as hexadecimal digits.
std::string Hex(const std::string& bytes) {
  std::string text;
  char digits[3];
  for (const char byte : bytes) {
    std::snprintf(digits, sizeof digits, "%02x", static_cast<unsigned char>(byte));
    text += digits;
  }
  return text;
}

Pose PoseAt(double x) {
  Pose pose;
  pose.position_m = {x, 0, 0};
  return pose;
}

constexpr char kZero[] = "0000000000000000";
constexpr char kOne[] = "000000000000f03f";  // The double 1.
constexpr char kTwo[] = "0000000000000040";

TEST(RosMessagesTest, APoseIsAlignedToEightBytesAfterItsFrame) {
  EXPECT_EQ(Hex(PoseStampedMessage("map", 7'000'000'009, PoseAt(2))), std::string("00010000") + "07000000" +
                                                                          "09000000" + "04000000" + "6d617000" + kTwo +
                                                                          kZero + kZero + kZero + kZero + kZero + kOne);
  EXPECT_EQ(Hex(PoseStampedMessage("m", 0, PoseAt(2))), std::string("00010000") + "00000000" + "00000000" + "02000000" +
                                                            "6d00" + "0000" + kTwo + kZero + kZero + kZero + kZero +
                                                            kZero + kOne);
}

TEST(RosMessagesTest, ATransformIsASequenceOfOne) {
  EXPECT_EQ(Hex(TfMessage("map", "base", 1, PoseAt(1))),
            std::string("00010000") + "01000000" + "00000000" + "01000000" + "04000000" + "6d617000" + "05000000" +
                "6261736500" + "000000" + kOne + kZero + kZero + kZero + kZero + kZero + kOne);
}

TEST(RosMessagesTest, AMapHasItsGeometryAndOneByteForEachCell) {
  MapView view;
  view.timestamp_ns = 1'000'000'000;
  view.map.grid = Grid(2, 1);
  view.map.grid.At(1, 0) = Cell::kHazard;
  view.map.resolution_um = 500'000;
  view.map.origin_cell_x = 2;
  EXPECT_EQ(Hex(OccupancyGridMessage("map", view)), std::string("00010000") + "01000000" + "00000000" + "04000000" +
                                                        "6d617000" + "01000000" + "00000000" + "0000003f" + "02000000" +
                                                        "01000000" + "00000000" + kOne + kZero + kZero + kZero + kZero +
                                                        kZero + kOne + "02000000" + "ff64");
}

TEST(RosMessagesTest, AnEventIsALogMessageOfItsAgent) {
  const EventView event{3'000'000'000, 1, Severity::kWarning, "lost", "rover2", ""};
  EXPECT_EQ(Hex(LogMessage("rover1", event)), std::string("00010000") + "03000000" + "00000000" + "1e" + "000000" +
                                                  "07000000" + "726f7665723100" + "00" + "0d000000" +
                                                  "6c6f73743a20726f7665723200" + "000000" + "01000000" + "00" +
                                                  "000000" + "01000000" + "00" + "000000" + "00000000");
}

TEST(RosMessagesTest, NamesOfTopicsHaveNoHyphensAndDoNotBeginWithADigit) {
  EXPECT_EQ(RosName("rover-1"), "rover_1");
  EXPECT_EQ(RosName("3po"), "agent_3po");
}

}  // namespace
}  // namespace moondb
