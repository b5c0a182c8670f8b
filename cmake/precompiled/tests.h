// Headers that most tests include. They are precompiled (cmake/MoondbCompile.cmake), but no file may rely on that.
#pragma once

#include "cmake/precompiled/model_tests.h"
#include "cmake/precompiled/runtime.h"
