// Precompiled headers of moonctl (cmake/MoondbCompile.cmake). Every file must still include what it uses.
#pragma once

#include "cmake/precompiled/runtime.h"
