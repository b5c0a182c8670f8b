// Building: walls, doors and furniture of one floor, drawn at random, for lasers to look at.
//
// A square floor is cut into rooms again and again, with or without a corridor between the halves; every wall gets
// doors, and rooms get boxes and round posts. Immutable once made.
#pragma once

#include <cstddef>
#include <vector>

#include "apps/moondb_mission/random.h"

namespace moondb {

class Building {
 public:
  static constexpr double kSide_m = 40;
  static constexpr double kCell_m = 0.025;

  static Building Make(Random& random);

  // Coordinates about the middle, in metres; what is outside is wall.
  bool IsSolid(double x_m, double y_m) const;
  // Nothing solid within a rover's radius.
  bool HasRoomAt(double x_m, double y_m) const;

 private:
  struct Room {
    double left, bottom, right, top;
  };

  Building();
  void Fill(const Room& box, bool is_solid);
  void AddPost(double x_m, double y_m, double radius_m);
  void Furnish(const Room& room, Random& random);
  void AddWall(const Room& room, bool is_upright, double at_m, double thickness_m, Random& random);
  void Divide(const Room& room, double room_m, Random& random);

  std::vector<char> is_solid_;
};

}  // namespace moondb
