// Headers that most tests include. Precompiled (cmake/MoondbCompile.cmake); no file may rely on it.
#pragma once

#include "cmake/precompiled/model_tests.h"
#include "cmake/precompiled/runtime.h"
