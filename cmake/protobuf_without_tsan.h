// Included first in builds with the thread sanitizer. In such builds protobuf's headers add two members to map fields
// (MapFieldBase), but Debian's libprotobuf is built without these members. The program would read maps in messages at
// wrong offsets.
#pragma once

#include <memory>  // Included before the macro is changed, so the standard library keeps its sanitizer support.

#pragma push_macro("__SANITIZE_THREAD__")
#undef __SANITIZE_THREAD__
#include <google/protobuf/map_field.h>
#pragma pop_macro("__SANITIZE_THREAD__")
