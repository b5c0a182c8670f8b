# Compiles this tree with -fsanitize=MOONDB_SANITIZE, and also the projects that use its install tree. A finding ends
# the program. tools/sanitizers.supp describes suppressions.txt.
set(MOONDB_SANITIZE_OPTIONS -fsanitize=${MOONDB_SANITIZE} -fno-sanitize-recover=all -fno-omit-frame-pointer)
# With a sanitizer, GCC 12 wrongly reports members of std::regex as uninitialised.
add_compile_options(${MOONDB_SANITIZE_OPTIONS} -Wno-maybe-uninitialized)
add_link_options(-fsanitize=${MOONDB_SANITIZE})
if(MOONDB_SANITIZE STREQUAL thread)
  add_compile_options("SHELL:-include ${PROJECT_SOURCE_DIR}/cmake/protobuf_without_tsan.h")
endif()
target_compile_options(moondb_options INTERFACE "$<INSTALL_INTERFACE:${MOONDB_SANITIZE_OPTIONS}>")
target_link_options(moondb_options INTERFACE $<INSTALL_INTERFACE:-fsanitize=${MOONDB_SANITIZE}>)

# Each sanitizer rejects a suppression file that contains kinds which the sanitizer does not know.
set(KINDS_thread "race|deadlock|mutex|thread|signal|called_from_lib")
set(KINDS_address "leak")
set(KINDS_undefined "undefined|alignment|vptr|null|bounds|shift|signed-integer-overflow|float-cast-overflow")
set_property(DIRECTORY ${PROJECT_SOURCE_DIR} APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS
  ${PROJECT_SOURCE_DIR}/tools/sanitizers.supp)
file(STRINGS ${PROJECT_SOURCE_DIR}/tools/sanitizers.supp SUPPRESSIONS REGEX "^(${KINDS_${MOONDB_SANITIZE}}):")
list(JOIN SUPPRESSIONS "\n" SUPPRESSIONS)
file(WRITE ${PROJECT_BINARY_DIR}/suppressions.txt "${SUPPRESSIONS}\n")
