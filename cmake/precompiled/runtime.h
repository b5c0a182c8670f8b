// Headers that most files above model/ include. They are precompiled (cmake/MoondbCompile.cmake), but no file may rely
// on that. Headers of status messages are excluded: a new field of a status must not recompile everything
// (tools/check_rebuild).
#pragma once

#include "cmake/precompiled/model.h"
#include "proto/message.pb.h"
#include "proto/team.pb.h"
