# Speeds up compilation (docs/decisions/0012-compile-times.md): precompiles headers that most files include, and
# compiles several source files of a library as one unit. No file may rely on this: a build without both must succeed.
option(MOONDB_PRECOMPILE "Precompile the headers that most files include" ON)
set(MOONDB_FILES_AT_A_TIME 6 CACHE STRING "Source files of a target that are compiled as one; 1 compiles each alone")

if(MOONDB_FILES_AT_A_TIME GREATER 1)
  set(CMAKE_UNITY_BUILD ON)
  set(CMAKE_UNITY_BUILD_BATCH_SIZE ${MOONDB_FILES_AT_A_TIME})
  # If a source file includes another source file, GCC treats the latter as a header and would warn about its unnamed
  # namespaces.
  if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-Wno-subobject-linkage>)
  endif()
endif()

# moondb_precompiled(NAME LIBRARIES... [OPTIONS options...]): precompiles cmake/precompiled/NAME.h for targets that link these
# libraries and are compiled with these options. GCC 13 and newer refuse it for another -O.
function(moondb_precompiled name)
  cmake_parse_arguments(ARG "" "" OPTIONS ${ARGN})
  if(MOONDB_PRECOMPILE)
    file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/precompiled_${name}.cc "")
    add_library(moondb_precompiled_${name} OBJECT ${CMAKE_CURRENT_BINARY_DIR}/precompiled_${name}.cc)
    target_link_libraries(moondb_precompiled_${name} PRIVATE ${ARG_UNPARSED_ARGUMENTS})
    target_compile_options(moondb_precompiled_${name} PRIVATE ${ARG_OPTIONS})
    target_precompile_headers(moondb_precompiled_${name} PRIVATE ${PROJECT_SOURCE_DIR}/cmake/precompiled/${name}.h)
  endif()
endfunction()

# moondb_use_precompiled(TARGET NAME): compiles TARGET with the headers that moondb_precompiled(NAME ...) has
# precompiled.
function(moondb_use_precompiled target name)
  if(MOONDB_PRECOMPILE)
    target_precompile_headers(${target} REUSE_FROM moondb_precompiled_${name})
  endif()
endfunction()
