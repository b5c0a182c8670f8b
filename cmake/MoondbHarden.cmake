# Makes faults in memory end a program, in place of giving it to whoever sent the bytes: checked buffers of the C library,
# guarded stacks, checked jumps, and tables of the linker that nobody writes after the start.
add_compile_options(-fstack-protector-strong -fstack-clash-protection)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(aarch64|arm64)$")
  add_compile_options(-mbranch-protection=standard)
elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|i.86)$")
  add_compile_options(-fcf-protection)
endif()
# The C library checks buffers only where the compiler optimises, and warns elsewhere.
string(TOUPPER "${CMAKE_BUILD_TYPE}" BUILD_TYPE)
if("${CMAKE_CXX_FLAGS} ${CMAKE_CXX_FLAGS_${BUILD_TYPE}}" MATCHES "-O[123s]")
  add_compile_options(-U_FORTIFY_SOURCE -D_FORTIFY_SOURCE=3)
  set(MOONDB_IS_FORTIFIED ON)
endif()
add_link_options(-Wl,-z,relro -Wl,-z,now)
