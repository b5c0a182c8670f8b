// Bytes as one zstd frame that states its content size. zstd's bytes differ between its versions; only decoding is the
// contract. Pure functions, safe from any thread.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "model/error.h"

namespace moondb {

enum class FrameChecksum { kNone, kPresent };

// Nothing where zstd has no memory left. `before` is what both ends have seen already: the frame may refer to it, and
// decodes only with it.
std::optional<std::string> CompressFrame(std::string_view plain, FrameChecksum checksum, std::string_view before = {});

// kCorrupt: not exactly one whole frame, one that does not state its size or states more than `plain_bytes_max`, bytes
// that do not decode or whose checksum, where there is one, does not fit. Memory is taken only for what is allowed.
// kInternal: zstd has no memory left.
Result<std::string> DecompressFrame(std::string_view frame, std::size_t plain_bytes_max, std::string_view before = {});

}  // namespace moondb
