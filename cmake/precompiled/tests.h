// Precompiled headers of the tests (cmake/MoondbCompile.cmake). Every file must still include what it uses.
#pragma once

#include "cmake/precompiled/model_tests.h"
#include "cmake/precompiled/runtime.h"
