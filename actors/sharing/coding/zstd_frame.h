// Compresses bytes into one zstd frame whose header contains the content size. The compressed bytes may differ between
// versions of zstd; only the decompressed bytes are guaranteed. Thread-safe.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "model/error.h"

namespace moondb {

enum class FrameChecksum { kNone, kPresent };

// Returns the frame, or nullopt if zstd is out of memory. `before` is a prefix that encoder and decoder already have.
// The frame may refer to the prefix, and can be decoded only with the same prefix.
std::optional<std::string> CompressFrame(std::string_view plain, FrameChecksum checksum, std::string_view before = {});

// Decompresses a frame. Returns kCorrupt if `frame` is not exactly one complete frame, contains no content size or one
// above `plain_bytes_max`, does not decode, or does not match its checksum. Returns kInternal if zstd is out of memory.
// Checks the content size before it allocates memory.
Result<std::string> DecompressFrame(std::string_view frame, std::size_t plain_bytes_max, std::string_view before = {});

}  // namespace moondb
