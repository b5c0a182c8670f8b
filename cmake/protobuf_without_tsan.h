// Included before all else in builds with the thread sanitizer: there protobuf's headers give map fields two more
// members (MapFieldBase), which Debian's libprotobuf, built without the sanitizer, does not know; each map in a message
// would be read at the wrong place.
#pragma once

#include <memory>  // What the standard library does for the sanitizer stays.

#pragma push_macro("__SANITIZE_THREAD__")
#undef __SANITIZE_THREAD__
#include <google/protobuf/map_field.h>
#pragma pop_macro("__SANITIZE_THREAD__")
