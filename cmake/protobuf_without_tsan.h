// Included first in builds with the thread sanitizer. With that sanitizer, protobuf's headers add two members to map
// fields (MapFieldBase). Debian's libprotobuf is built without these members, so the program would read maps at wrong
// offsets.
#pragma once

#include <memory>  // Included before the macro changes, so that the standard library keeps its sanitizer support.

#pragma push_macro("__SANITIZE_THREAD__")
#undef __SANITIZE_THREAD__
#include <google/protobuf/map_field.h>
#pragma pop_macro("__SANITIZE_THREAD__")
