// Included first in builds with the thread sanitizer. There, protobuf's headers add two members to map fields
// (MapFieldBase), but Debian's libprotobuf is built without them. Maps in messages would be read at wrong offsets.
#pragma once

#include <memory>  // Included first, so the standard library keeps its sanitizer support.

#pragma push_macro("__SANITIZE_THREAD__")
#undef __SANITIZE_THREAD__
#include <google/protobuf/map_field.h>
#pragma pop_macro("__SANITIZE_THREAD__")
