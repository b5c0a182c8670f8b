// Tests the check of rovers that only their start places.
#include "actors/registration/place_check.h"

#include <gtest/gtest.h>

#include "tests/actors/registration/driven_rovers.h"

namespace moondb {
namespace {

class PlaceCheckTest : public DrivenRovers {
 protected:
  PlaceFit Check() {
    PlaceCheck check;
    check.Begin({{1, 2}}, {1, 2});
    for (int i = 0; check.left_count() > 0; ++i) {
      EXPECT_LT(i, 2000) << "the check does not end";
      check.Step(maps_);
    }
    return check.fits().contains({1, 2}) ? check.fits().at({1, 2}) : PlaceFit();
  }
};

TEST_F(PlaceCheckTest, ARightStartDoesNotContradict) {
  const HazardWorld world = HazardWorld::OfRooms(1);
  Drive(1, world, Loop(), Pose());
  Drive(2, world, Back(), Pose());
  const PlaceFit fit = Check();
  EXPECT_FALSE(fit.is_contradicted);
  EXPECT_GT(fit.matched, 0.9);
}

TEST_F(PlaceCheckTest, AFalseStartContradicts) {
  const HazardWorld world = HazardWorld::OfRooms(1);
  Drive(1, world, Loop(), Pose());
  for (const Pose& false_start : {Pose::FromPlanar(5, 0, 0), Pose::FromPlanar(0, 0, 0.5), Pose::FromPlanar(3, 8, 2)}) {
    Drive(2, world, Back(), false_start);
    const PlaceFit fit = Check();
    EXPECT_TRUE(fit.is_contradicted) << fit.contradicted << " " << fit.own_contradicted;
    maps_ = KnownMaps(Options());
    Drive(1, world, Loop(), Pose());
  }
}

TEST_F(PlaceCheckTest, ACorridorOrRoversWithoutCommonGroundDoNotContradict) {
  HazardWorld corridor;
  corridor.walls = {{{-60, 1.5}, {60, 1.5}}, {{-60, -1.5}, {60, -1.5}}};
  Drive(1, corridor, Along({{-40, 0}, {0, 0}}), Pose());
  Drive(2, corridor, Along({{10, 0.3}, {-30, 0.3}}), Pose::FromPlanar(7, 0, 0));
  const PlaceFit fit = Check();
  EXPECT_FALSE(fit.is_contradicted) << fit.contradicted << " " << fit.own_contradicted << " " << fit.matched;
  maps_ = KnownMaps(Options());
  const HazardWorld world = HazardWorld::OfRooms(1);
  Drive(1, world, Loop(), Pose());
  Drive(2, world, Back(), Pose::FromPlanar(500, 0, 0));
  EXPECT_FALSE(Check().is_contradicted);
}

TEST_F(PlaceCheckTest, MapsThatContradictThemselvesSayNothingAboutTheStart) {
  // Rover 2's surroundings change after each metre.
  Drive(1, HazardWorld::OfRooms(1), Loop(), Pose());
  Drive(2, HazardWorld::OfRooms(1), Back(), Pose());
  for (std::size_t i = 0; i < Back().size(); i += 2) {
    AddMap({2, i}, HazardWorld::OfRooms(50 + i), Back()[i], 2'000'000'000'000 + static_cast<std::int64_t>(i));
  }
  EXPECT_FALSE(Check().is_contradicted);
}

TEST_F(PlaceCheckTest, RoversWithoutMapsOrTracksAreLeftOut) {
  EXPECT_FALSE(Check().is_contradicted);
  Drive(1, HazardWorld::OfRooms(1), Loop(), Pose());
  EXPECT_FALSE(Check().is_contradicted);
}

TEST(PlaceCheckDoubtTest, DoubtsPlacesIfHardlyAnyOfManyPairsMatched) {
  const auto is_doubtful = [](std::size_t accepted, std::size_t refused) {
    return PlaceCheck::IsDoubtful({{MatchVerdict::kAccepted, accepted}, {MatchVerdict::kSecondPlace, refused}});
  };
  EXPECT_FALSE(is_doubtful(0, 9));
  EXPECT_TRUE(is_doubtful(0, 10));
  EXPECT_TRUE(is_doubtful(1, 10));
  EXPECT_FALSE(is_doubtful(2, 10));
  EXPECT_FALSE(PlaceCheck::IsDoubtful({}));
}

}  // namespace
}  // namespace moondb
