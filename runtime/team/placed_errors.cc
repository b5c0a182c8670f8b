#include "runtime/team/placed_errors.h"

#include <algorithm>
#include <cstdio>

namespace moondb {
namespace {

constexpr std::size_t kErrorsShownMax = 100;
constexpr std::size_t kQuotedLengthMax = 60;

}  // namespace

void PlacedErrors::Add(Place place, const std::string& field, const std::string& text) {
  if (!field.empty() && muted_.count(field) > 0) return;
  Mute(field);
  errors_.push_back({place, field.empty() ? text : field + ": " + text});
}

bool PlacedErrors::Has(const std::string& field) const {
  const auto at = muted_.lower_bound(field);
  if (at != muted_.end() && *at == field) return true;
  const auto starts_with = [&](const std::string& prefix) {
    const auto part = muted_.lower_bound(prefix);
    return part != muted_.end() && part->compare(0, prefix.size(), prefix) == 0;
  };
  return starts_with(field + ".") || starts_with(field + "[");
}

std::string PlacedErrors::Text() const {
  std::vector<Entry> sorted = errors_;
  std::stable_sort(sorted.begin(), sorted.end(), [](const Entry& a, const Entry& b) { return a.place < b.place; });
  std::string text;
  for (std::size_t i = 0; i < sorted.size() && i < kErrorsShownMax; ++i) {
    const auto& [place, message] = sorted[i];
    if (i > 0) text += '\n';
    text += file_ + ":" + std::to_string(place.line) + ":" + std::to_string(place.column) + ": " + message;
  }
  if (sorted.size() > kErrorsShownMax) {
    text += "\n" + file_ + ": and " + std::to_string(sorted.size() - kErrorsShownMax) + " more errors";
  }
  return text;
}

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (std::size_t i = 0; i < text.size() && i < kQuotedLengthMax; ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    if (byte >= 0x20 && byte < 0x7f) {
      quoted += text[i];
    } else {
      char hex[5];
      std::snprintf(hex, sizeof hex, "\\x%02x", byte);
      quoted += hex;
    }
  }
  return quoted + (text.size() > kQuotedLengthMax ? "...\"" : "\"");
}

}  // namespace moondb
