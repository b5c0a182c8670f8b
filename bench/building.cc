#include "bench/building.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace moondb {

namespace {

constexpr int kSideCells = static_cast<int>(Building::kSide_m / Building::kCell_m);
constexpr double kOuterWall_m = 0.5;
constexpr double kRoverRadius_m = 0.3;

int CellOf(double metres) { return static_cast<int>(std::floor(metres / Building::kCell_m)) + kSideCells / 2; }

bool IsOnFloor(int column, int row) { return column >= 0 && row >= 0 && column < kSideCells && row < kSideCells; }

std::size_t Offset(int column, int row) { return static_cast<std::size_t>(row) * kSideCells + column; }

}  // namespace

Building::Building() : is_solid_(static_cast<std::size_t>(kSideCells) * kSideCells, 1) {}

Building Building::Make(Random& random) {
  Building building;
  const double half_m = kSide_m / 2 - kOuterWall_m;
  const Room floor{-half_m, -half_m, half_m, half_m};
  building.Fill(floor, false);
  building.Divide(floor, random.Uniform(3, 9), random);
  return building;
}

bool Building::IsSolid(double x_m, double y_m) const {
  const int column = CellOf(x_m);
  const int row = CellOf(y_m);
  return !IsOnFloor(column, row) || is_solid_[Offset(column, row)] != 0;
}

bool Building::HasRoomAt(double x_m, double y_m) const {
  constexpr int kPoints = 12;
  for (int i = 0; i < kPoints; ++i) {
    const double angle = 2 * std::numbers::pi * i / kPoints;
    if (IsSolid(x_m + kRoverRadius_m * std::cos(angle), y_m + kRoverRadius_m * std::sin(angle))) return false;
  }
  return !IsSolid(x_m, y_m);
}

void Building::Fill(const Room& box, bool is_solid) {
  for (int row = std::max(0, CellOf(box.bottom)); row <= std::min(kSideCells - 1, CellOf(box.top)); ++row) {
    for (int column = std::max(0, CellOf(box.left)); column <= std::min(kSideCells - 1, CellOf(box.right)); ++column) {
      is_solid_[Offset(column, row)] = is_solid ? 1 : 0;
    }
  }
}

void Building::AddPost(double x_m, double y_m, double radius_m) {
  for (double y = -radius_m; y <= radius_m; y += kCell_m) {
    for (double x = -radius_m; x <= radius_m; x += kCell_m) {
      const int column = CellOf(x_m + x);
      const int row = CellOf(y_m + y);
      if (std::hypot(x, y) <= radius_m && IsOnFloor(column, row)) is_solid_[Offset(column, row)] = 1;
    }
  }
}

void Building::Furnish(const Room& room, Random& random) {
  const double area_m2 = (room.right - room.left) * (room.top - room.bottom);
  const int count = random.Poisson(area_m2 * random.Uniform(0, 0.25));
  for (int i = 0; i < count; ++i) {
    const double x = random.Uniform(room.left, room.right);
    const double y = random.Uniform(room.bottom, room.top);
    if (random.Chance(0.5)) {
      const double width = random.Uniform(0.05, 1.0);
      const double depth = random.Uniform(0.05, 0.8);
      Fill({x, y, std::min(room.right, x + width), std::min(room.top, y + depth)}, true);
    } else {
      AddPost(x, y, random.Uniform(0.02, 0.3));
    }
  }
}

void Building::AddWall(const Room& room, bool is_upright, double at_m, double thickness_m, Random& random) {
  const auto part = [&](double from, double to) {
    return is_upright ? Room{at_m, from, at_m + thickness_m, to} : Room{from, at_m, to, at_m + thickness_m};
  };
  const double first = is_upright ? room.bottom : room.left;
  const double last = is_upright ? room.top : room.right;
  Fill(part(first, last), true);
  const int listeners = 1 + random.Poisson((last - first) / 5);
  for (int i = 0; i < listeners; ++i) {
    const double width = random.Uniform(0.8, 1.6);
    const double from = random.Uniform(first, std::max(first, last - width));
    Fill(part(from, from + width), false);
  }
}

void Building::Divide(const Room& room, double room_m, Random& random) {
  const double width = room.right - room.left;
  const double height = room.top - room.bottom;
  if (std::max(width, height) < room_m * random.Uniform(1.2, 2.2)) return Furnish(room, random);
  const bool is_upright = width > height;
  const double thickness_m = random.Uniform(0.05, 0.2);
  const bool has_corridor = random.Chance(0.4);
  const double corridor_m = has_corridor ? random.Uniform(1.5, 3.0) : 0;
  const double first = is_upright ? room.left : room.bottom;
  const double length = is_upright ? width : height;
  const double middle = first + length * random.Uniform(0.3, 0.7);
  Room low = room;
  Room high = room;
  (is_upright ? low.right : low.top) = middle - corridor_m / 2;
  (is_upright ? high.left : high.bottom) = middle + corridor_m / 2 + thickness_m;
  Divide(low, room_m, random);
  Divide(high, room_m, random);
  AddWall(room, is_upright, middle - corridor_m / 2, thickness_m, random);
  if (has_corridor) AddWall(room, is_upright, middle + corridor_m / 2, thickness_m, random);
}

}  // namespace moondb
