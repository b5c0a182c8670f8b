// Headers that most tests of model/ include. They are precompiled (cmake/MoondbCompile.cmake), but no file may rely on
// that.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "cmake/precompiled/model.h"
