// Precompiled headers of the tests of model/ (cmake/MoondbCompile.cmake). Every file must still include what it uses.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "cmake/precompiled/model.h"
