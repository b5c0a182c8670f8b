// Compresses bytes into one zstd frame whose header contains the content size. The compressed bytes may differ between
// versions of zstd; the contract covers only the decoded result. Pure functions, thread-safe.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

#include "model/error.h"

namespace moondb {

enum class FrameChecksum { kNone, kPresent };

// Returns the frame, or nullopt if zstd is out of memory. `before` is a prefix that both ends already have: the frame
// may refer to it, and can be decoded only with it.
std::optional<std::string> CompressFrame(std::string_view plain, FrameChecksum checksum, std::string_view before = {});

// Decompresses a frame. kCorrupt if `frame` is not exactly one complete frame, contains no content size or one above
// `plain_bytes_max`, does not decode, or does not match its checksum, if it has one. Checks the content size before it
// allocates memory. kInternal if zstd is out of memory.
Result<std::string> DecompressFrame(std::string_view frame, std::size_t plain_bytes_max, std::string_view before = {});

}  // namespace moondb
