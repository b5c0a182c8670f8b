#include "model/tum.h"

#include "model/line_fields.h"
#include "model/text.h"

namespace moondb {

namespace {

Result<std::vector<TumPose>> Parse(TextLines lines, const std::string& name) {
  std::vector<TumPose> poses;
  const Result<void> parsed = ParseLines(std::move(lines), name, [&poses](LineFields& fields, std::size_t) {
    TumPose& pose = poses.emplace_back();
    pose.timestamp_ns = fields.Timestamp();
    pose.map_from_body = fields.PoseOf(/*is_planar=*/false);
  });
  if (!parsed) return tl::unexpected(parsed.error());
  return poses;
}

}  // namespace

Result<std::vector<TumPose>> ParseTum(std::string_view text, const std::string& name) {
  return Parse(TextLines(text), name);
}

Result<std::vector<TumPose>> ReadTum(const std::filesystem::path& file) {
  Result<TextLines> lines = TextLines::OfFile(file);
  if (!lines) return tl::unexpected(lines.error());
  return Parse(*std::move(lines), file.string());
}

std::string FormatTum(const std::vector<TumPose>& poses, const FileNotes& notes) {
  std::string text = NotesText(notes, "# ");
  for (const TumPose& pose : poses) {
    text += FormatTimestampNs(pose.timestamp_ns);
    for (const double value : pose.map_from_body.position_m) text += " " + FormatDouble(value);
    for (const double value : pose.map_from_body.orientation.coeffs()) text += " " + FormatDouble(value);
    text += "\n";
  }
  return text;
}

}  // namespace moondb
