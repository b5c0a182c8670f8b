// PlacedErrors: all that is wrong with one file, each error with its place: `team.yaml:4:10: agents[1].id: text`.
#pragma once

#include <compare>
#include <set>
#include <string>
#include <vector>

namespace moondb {

// In a file; both count from 1.
struct Place {
  int line = 1;
  int column = 1;
  auto operator<=>(const Place&) const = default;
};

class PlacedErrors {
 public:
  explicit PlacedErrors(std::string file) : file_(std::move(file)) {}

  // `field` is a path such as "agents[1].id"; empty for the file as a whole. Of one field only the first error counts:
  // what follows from it would mislead.
  void Add(Place place, const std::string& field, const std::string& text);

  // Later errors of `field` say nothing new.
  void Mute(const std::string& field) { muted_.insert(field); }

  // An error of this field or of a part of it is known, or it is muted.
  bool Has(const std::string& field) const;

  bool empty() const { return errors_.empty(); }

  // One line each, in the order of their places; at most 100, then how many more.
  std::string Text() const;

 private:
  struct Entry {
    Place place;
    std::string text;
  };

  std::string file_;
  std::vector<Entry> errors_;
  std::set<std::string> muted_;
};

// `"two"`; shortened, and control characters and other non-ASCII bytes as \x1b: what comes from a file goes to
// terminals.
std::string Quoted(const std::string& text);

}  // namespace moondb
