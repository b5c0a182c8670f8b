// PlacedErrors: collects the errors of one file, each with its place, such as `team.yaml:4:10: agents[1].id: text`.
#pragma once

#include <compare>
#include <set>
#include <string>
#include <vector>

namespace moondb {

// Position in a file. Lines and columns count from 1.
struct Place {
  int line = 1;
  int column = 1;
  auto operator<=>(const Place&) const = default;
};

class PlacedErrors {
 public:
  explicit PlacedErrors(std::string file) : file_(std::move(file)) {}

  // Adds an error. `field` is a path such as "agents[1].id", or empty for the whole file. Only the first error of a
  // field is kept, because later ones are often consequences of it.
  void Add(Place place, const std::string& field, const std::string& text);

  // Ignores later errors of `field`.
  void Mute(const std::string& field) { muted_.insert(field); }

  // Returns true if an error was added for this field or for a part of it, or if the field was muted.
  bool Has(const std::string& field) const;

  bool empty() const { return errors_.empty(); }

  // Returns one line per error, sorted by place: at most 100, then a line with the number of further errors.
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

// Returns `text` in quotation marks, shortened. Control characters and non-ASCII bytes become escapes such as \x1b,
// because the text may come from a file and be printed to a terminal.
std::string Quoted(const std::string& text);

}  // namespace moondb
