// Headers that most tests of model/ include. Precompiled (cmake/MoondbCompile.cmake); no file may rely on it.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "cmake/precompiled/model.h"
