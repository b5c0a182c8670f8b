#include "model/tum.h"

#include "model/line_fields.h"
#include "model/pyfg.h"
#include "model/text.h"

namespace moondb {

Result<std::vector<TumPose>> ParseTum(std::string_view text, const std::string& name) {
  std::vector<TumPose> poses;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::string_view line = TakeLine(text);
    const auto stop = [&](std::string why) {
      return Fail(ErrorCode::kInvalid, std::move(why), FileLine(name, number));
    };
    if (line.size() > kPyfgLineBytesMax) return stop("the line is longer than 4096 bytes");
    LineFields fields(line);
    if (fields.left() == 0 || line.front() == '#') continue;
    TumPose pose;
    pose.stamp_ns = fields.Stamp();
    pose.map_from_body = fields.PoseOf(/*is_planar=*/false);
    if (fields.error().empty() && fields.left() > 0) fields.Stop("the line has too many fields");
    if (!fields.error().empty()) return stop(fields.error());
    poses.push_back(pose);
  }
  return poses;
}

Result<std::vector<TumPose>> ReadTum(const std::filesystem::path& file) {
  const Result<std::string> text = ReadTextFile(file);
  if (!text) return tl::unexpected(text.error());
  return ParseTum(*text, file.string());
}

std::string FormatTum(const std::vector<TumPose>& poses) {
  std::string text;
  for (const TumPose& pose : poses) {
    text += FormatStampNs(pose.stamp_ns);
    for (const double value : pose.map_from_body.position_m) text += " " + FormatDouble(value);
    for (const double value : pose.map_from_body.orientation.coeffs()) text += " " + FormatDouble(value);
    text += "\n";
  }
  return text;
}

Result<void> WriteTum(const std::vector<TumPose>& poses, const std::filesystem::path& file) {
  return WriteTextFile(file, FormatTum(poses));
}

}  // namespace moondb
