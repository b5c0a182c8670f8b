# Installs a build, checks its headers, builds an example against it and runs the example's tests.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    list(JOIN ARGN " " command)
    message("${output}")
    message(FATAL_ERROR "${result}: ${command}")
  endif()
endfunction()

file(REMOVE_RECURSE ${WORK_FOLDER})
set(prefix ${WORK_FOLDER}/prefix)
run(${CMAKE_COMMAND} --install ${BUILD_FOLDER} --prefix ${prefix} --component development)

# A public header must not include a header that is not installed, because users could not compile it.
set(include ${prefix}/include/moondb)
file(GLOB_RECURSE headers RELATIVE ${include} ${include}/*.h)
if(NOT headers)
  message(FATAL_ERROR "no headers in ${include}")
endif()
foreach(header IN LISTS headers)
  file(STRINGS ${include}/${header} lines REGEX "^#include \"")
  foreach(line IN LISTS lines)
    string(REGEX REPLACE "^#include \"([^\"]*)\".*" "\\1" included "${line}")
    if(NOT EXISTS ${include}/${included} AND NOT EXISTS ${include}/proto/${included})
      message(SEND_ERROR "${header} includes ${included}, which is not installed")
    endif()
  endforeach()
endforeach()

set(build ${WORK_FOLDER}/build)
run(${CMAKE_COMMAND} -S ${prefix}/share/moondb/examples/${EXAMPLE} -B ${build} -G ${GENERATOR}
    -DCMAKE_PREFIX_PATH=${prefix} -DCMAKE_CXX_COMPILER=${CXX_COMPILER} "-DCMAKE_CXX_FLAGS=${CXX_FLAGS}"
    -DCMAKE_CXX_COMPILER_LAUNCHER=${CXX_COMPILER_LAUNCHER})
run(${CMAKE_COMMAND} --build ${build} --parallel 2)
run(${CMAKE_CTEST_COMMAND} --test-dir ${build} --output-on-failure --no-tests=error)
