// Building: a random floor plan with walls, openings and furniture, as the environment of a simulated laser.
//
// A square floor is cut into rooms recursively, with or without a corridor between the halves. Every wall gets
// openings, and rooms get boxes and round posts. Immutable after construction.
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

  // Returns true if the point lies in a wall or in furniture. Coordinates are in metres from the middle of the floor.
  // Everything outside the floor counts as wall.
  bool IsSolid(double x_m, double y_m) const;
  // Returns true if nothing solid is within a rover's radius of this point.
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
