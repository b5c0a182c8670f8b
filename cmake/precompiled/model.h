// Precompiled headers of moondb (cmake/MoondbCompile.cmake): those that most files include. Every file must still
// include what it uses.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "cmake/precompiled/base.h"
