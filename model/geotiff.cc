#include "model/geotiff.h"

#include <geotiff/geotiffio.h>
#include <geotiff/xtiffio.h>

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>

#include "model/cell_colors.h"
#include "model/text.h"

namespace moondb {
namespace {

// TIFF tags that GDAL defines (gdal.org, "GTiff").
constexpr ttag_t kGdalMetadata = 42112;
constexpr ttag_t kGdalNoData = 42113;
constexpr std::uint32_t kRowsPerStrip = 64;

// A file in memory that libtiff writes to, so no incomplete file ever reaches the disk.
struct Memory {
  std::string bytes;
  std::size_t at = 0;
};

tmsize_t Read(thandle_t handle, void* to, tmsize_t size) {
  Memory& memory = *static_cast<Memory*>(handle);
  const std::size_t count = std::min(static_cast<std::size_t>(size), memory.bytes.size() - memory.at);
  std::memcpy(to, memory.bytes.data() + memory.at, count);
  memory.at += count;
  return static_cast<tmsize_t>(count);
}

tmsize_t Write(thandle_t handle, void* from, tmsize_t size) {
  Memory& memory = *static_cast<Memory*>(handle);
  const auto count = static_cast<std::size_t>(size);
  if (memory.at + count > memory.bytes.size()) memory.bytes.resize(memory.at + count);
  std::memcpy(memory.bytes.data() + memory.at, from, count);
  memory.at += count;
  return size;
}

toff_t Seek(thandle_t handle, toff_t offset, int whence) {
  Memory& memory = *static_cast<Memory*>(handle);
  const toff_t base = whence == SEEK_SET ? 0 : whence == SEEK_CUR ? memory.at : memory.bytes.size();
  memory.at = static_cast<std::size_t>(base + offset);
  if (memory.at > memory.bytes.size()) memory.bytes.resize(memory.at);
  return memory.at;
}

int Close(thandle_t) { return 0; }
toff_t Size(thandle_t handle) { return static_cast<Memory*>(handle)->bytes.size(); }

thread_local std::string last_error;

void KeepError(const char* module, const char* format, std::va_list arguments) {
  char text[256];
  std::vsnprintf(text, sizeof(text), format, arguments);
  last_error = std::string(module == nullptr ? "libtiff" : module) + ": " + text;
}

struct CloseTiff {
  void operator()(TIFF* tiff) const { XTIFFClose(tiff); }
};
struct FreeKeys {
  void operator()(GTIF* keys) const { GTIFFree(keys); }
};

std::string XmlText(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '<' || c == '>' || c == '&' || c == '"') {
      escaped += "&#" + std::to_string(static_cast<int>(c)) + ";";
    } else {
      escaped += c;
    }
  }
  return escaped;
}

std::string GdalMetadata(const FileNotes& notes) {
  std::string text = "<GDALMetadata>\n";
  for (const auto& [key, value] : notes) {
    text += "  <Item name=\"" + XmlText(key) + "\">" + XmlText(value) + "</Item>\n";
  }
  return text + "</GDALMetadata>\n";
}

void SetColors(TIFF* tiff) {
  std::uint16_t red[256] = {}, green[256] = {}, blue[256] = {};
  for (std::size_t i = 0; i < CellColors().size(); ++i) {
    const Color& color = CellColors()[i];
    red[i] = static_cast<std::uint16_t>(color[0] * 257);
    green[i] = static_cast<std::uint16_t>(color[1] * 257);
    blue[i] = static_cast<std::uint16_t>(color[2] * 257);
  }
  TIFFSetField(tiff, TIFFTAG_COLORMAP, red, green, blue);
}

// Sets the transformation from pixel coordinates, whose origin is the upper left corner, to metres east and north of
// the site.
void SetPlace(TIFF* tiff, const MergedMap& map, const MapSite& site) {
  const double resolution_m = map.resolution_um / 1e6;
  const Eigen::Vector2d corner_m(static_cast<double>(map.origin_cell_x) * resolution_m,
                                 static_cast<double>(map.origin_cell_y + map.grid.height) * resolution_m);
  const Eigen::Vector2d corner = EastNorth(site, corner_m);
  const Eigen::Vector2d column = EastNorth(site, {resolution_m, 0});
  const Eigen::Vector2d row = EastNorth(site, {0, -resolution_m});
  double matrix[16] = {column.x(), row.x(), 0, corner.x(), column.y(), row.y(), 0, corner.y(), 0, 0, 0, 0, 0, 0, 0, 1};
  TIFFSetField(tiff, TIFFTAG_GEOTRANSMATRIX, 16, matrix);
}

bool SetKeys(TIFF* tiff, const MapSite& site) {
  const std::unique_ptr<GTIF, FreeKeys> keys(GTIFNew(tiff));
  if (keys == nullptr) return false;
  const auto set_code = [&keys](geokey_t key, int value) { GTIFKeySet(keys.get(), key, TYPE_SHORT, 1, value); };
  const auto set_number = [&keys](geokey_t key, double value) { GTIFKeySet(keys.get(), key, TYPE_DOUBLE, 1, value); };
  const auto set_text = [&keys](geokey_t key, const std::string& text) {
    GTIFKeySet(keys.get(), key, TYPE_ASCII, 0, text.c_str());
  };
  set_code(GTModelTypeGeoKey, ModelTypeProjected);
  set_code(GTRasterTypeGeoKey, RasterPixelIsArea);
  set_text(GTCitationGeoKey, "Moon, azimuthal equidistant about the site");
  set_code(GeographicTypeGeoKey, KvUserDefined);
  set_text(GeogCitationGeoKey, "GCS Name = Moon|Datum = Moon|Ellipsoid = Moon sphere|Primem = Reference meridian|");
  set_code(GeogGeodeticDatumGeoKey, KvUserDefined);
  set_code(GeogEllipsoidGeoKey, KvUserDefined);
  set_number(GeogSemiMajorAxisGeoKey, kMoonRadius_m);
  set_number(GeogSemiMinorAxisGeoKey, kMoonRadius_m);
  set_code(GeogPrimeMeridianGeoKey, KvUserDefined);
  set_number(GeogPrimeMeridianLongGeoKey, 0);
  set_code(GeogAngularUnitsGeoKey, Angular_Degree);
  set_code(ProjectedCSTypeGeoKey, KvUserDefined);
  set_text(PCSCitationGeoKey, "Moon, azimuthal equidistant about the site");
  set_code(ProjectionGeoKey, KvUserDefined);
  set_code(ProjCoordTransGeoKey, CT_AzimuthalEquidistant);
  set_number(ProjCenterLatGeoKey, site.lat_deg);
  set_number(ProjCenterLongGeoKey, site.lon_deg > 180 ? site.lon_deg - 360 : site.lon_deg);
  set_number(ProjFalseEastingGeoKey, 0);
  set_number(ProjFalseNorthingGeoKey, 0);
  set_code(ProjLinearUnitsGeoKey, Linear_Meter);
  return GTIFWriteKeys(keys.get()) == 1;
}

void SetFields(TIFF* tiff, const Image& image, const FileNotes& notes) {
  static const TIFFFieldInfo kGdalFields[] = {
      {kGdalMetadata, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, const_cast<char*>("GDALMetadata")},
      {kGdalNoData, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, const_cast<char*>("GDALNoDataValue")}};
  TIFFMergeFieldInfo(tiff, kGdalFields, std::size(kGdalFields));
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, static_cast<std::uint32_t>(image.width));
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, static_cast<std::uint32_t>(image.height));
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 8);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_PALETTE);
  TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_ADOBE_DEFLATE);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, kRowsPerStrip);
  TIFFSetField(tiff, TIFFTAG_IMAGEDESCRIPTION, NotesText(notes).c_str());
  TIFFSetField(tiff, kGdalMetadata, GdalMetadata(notes).c_str());
  TIFFSetField(tiff, kGdalNoData, "0");
  SetColors(tiff);
}

}  // namespace

Eigen::Vector2d EastNorth(const MapSite& site, const Eigen::Vector2d& place_m) {
  const double sine = std::sin(site.north_yaw_rad), cosine = std::cos(site.north_yaw_rad);
  return {place_m.x() * sine - place_m.y() * cosine, place_m.x() * cosine + place_m.y() * sine};
}

Result<std::string> GeoTiffBytes(const MergedMap& map, const MapSite& site, const FileNotes& notes) {
  if (map.grid.cells.empty() || map.resolution_um == 0) return Fail(ErrorCode::kInvalid, "the map is empty");
  TIFFSetErrorHandler(KeepError);
  TIFFSetWarningHandler(nullptr);
  last_error = "";
  Memory memory;
  const Image image = CellPicture(map);
  bool is_done = false;
  {
    const std::unique_ptr<TIFF, CloseTiff> tiff(
        XTIFFClientOpen("map.tif", "w", &memory, Read, Write, Seek, Close, Size, nullptr, nullptr));
    if (tiff == nullptr) return Fail(ErrorCode::kInternal, last_error);
    SetFields(tiff.get(), image, notes);
    SetPlace(tiff.get(), map, site);
    is_done = SetKeys(tiff.get(), site);
    for (int row = 0; is_done && row < image.height; ++row) {
      void* pixels = const_cast<std::uint8_t*>(image.At(0, row));  // libtiff only reads the pixels.
      is_done = TIFFWriteScanline(tiff.get(), pixels, static_cast<std::uint32_t>(row)) == 1;
    }
  }
  if (!is_done || !last_error.empty()) return Fail(ErrorCode::kInternal, last_error);
  return std::move(memory.bytes);
}

}  // namespace moondb
