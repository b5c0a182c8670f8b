#include "apps/moonctl/map_files.h"

#include "apps/moonctl/written_files.h"
#include "model/cell_colors.h"
#include "model/geotiff.h"
#include "model/ros_map.h"
#include "model/text.h"

namespace moondb {
namespace {

Result<std::vector<FileBytes>> PngFiles(const MapExport& exported) {
  const MergedMap map = WrittenMap(exported);
  auto png = PngBytes(CellPicture(map), {{CellColors().begin(), CellColors().end()}, exported.notes});
  if (!png) return tl::unexpected(png.error());
  // Write the picture last, so that a reader who sees it also finds its position file.
  return std::vector<FileBytes>{{exported.folder / "map.pgw", WorldFile(map)},
                                {exported.folder / "map.png", *std::move(png)}};
}

Result<std::vector<FileBytes>> GeoTiffFiles(const MapExport& exported) {
  const proto::SiteConfig& site = exported.site;
  auto tiff =
      GeoTiffBytes(WrittenMap(exported), {site.lat_deg(), site.lon_deg(), site.north_yaw_rad()}, exported.notes);
  if (!tiff) return tl::unexpected(tiff.error());
  return std::vector<FileBytes>{{exported.folder / "map.tif", *std::move(tiff)}};
}

std::vector<FileBytes> Nav2Files(const MapExport& exported) {
  return {{exported.folder / "map.pgm", RosMapPgm(exported.map.grid)},
          {exported.folder / "map.yaml", RosMapYaml(exported.map, "map.pgm", exported.notes)}};
}

Result<std::vector<FileBytes>> FilesOf(const MapExport& exported) {
  if (exported.format == "png") return PngFiles(exported);
  return exported.format == "geotiff" ? GeoTiffFiles(exported) : Nav2Files(exported);
}

}  // namespace

MergedMap WrittenMap(const MapExport& exported) {
  return exported.format == "nav2" ? exported.map : CroppedToKnown(exported.map, kCropMarginCells);
}

std::string WorldFile(const MergedMap& map) {
  const double resolution_um = map.resolution_um;
  const double x_um = (static_cast<double>(map.origin_cell_x) + 0.5) * resolution_um;
  const double y_um = (static_cast<double>(map.origin_cell_y + map.grid.height) - 0.5) * resolution_um;
  std::string text;
  for (const double micrometres : {resolution_um, 0.0, 0.0, -resolution_um, x_um, y_um}) {
    text += FormatDouble(micrometres / 1e6) + "\n";
  }
  return text;
}

Result<std::vector<std::filesystem::path>> WriteMapFiles(const MapExport& exported) {
  const auto files = FilesOf(exported);
  if (!files) return tl::unexpected(files.error());
  if (auto done = WriteTogether(exported.folder, *files); !done) return tl::unexpected(done.error());
  std::vector<std::filesystem::path> written;
  for (const FileBytes& file : *files) written.push_back(file.file);
  return written;
}

}  // namespace moondb
