# Hardening options. They check buffers of the C library, stacks and jumps, and make linker tables read-only after the
# start. A memory fault then ends the program before an attacker can use it.
add_compile_options(-fstack-protector-strong -fstack-clash-protection)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(aarch64|arm64)$")
  add_compile_options(-mbranch-protection=standard)
elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|i.86)$")
  add_compile_options(-fcf-protection)
endif()
# The C library checks buffers only in optimised builds, and prints a warning in other builds.
string(TOUPPER "${CMAKE_BUILD_TYPE}" BUILD_TYPE)
if("${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${BUILD_TYPE}}" MATCHES "-O[123s]")
  add_compile_options(-U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=3)
  set(MOONDB_IS_FORTIFIED ON)
endif()
add_link_options(-Wl,-z,relro -Wl,-z,now)
