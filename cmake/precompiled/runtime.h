// Precompiled headers of the code above model/ (cmake/MoondbCompile.cmake). Every file must still include what it uses.
// Headers of status messages are excluded, because a new field of a status must not recompile everything
// (tools/check_rebuild).
#pragma once

#include "cmake/precompiled/model.h"
#include "proto/message.pb.h"
#include "proto/team.pb.h"
