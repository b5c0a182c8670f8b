# Runs PROGRAM with ARGUMENTS and expects EXIT_CODE and exactly one line on standard error.
execute_process(COMMAND ${PROGRAM} ${ARGUMENTS} RESULT_VARIABLE exit_code ERROR_VARIABLE error OUTPUT_VARIABLE output)
if(NOT exit_code EQUAL EXIT_CODE)
  message(FATAL_ERROR "exit code ${exit_code} instead of ${EXIT_CODE}: ${error}")
endif()
if(NOT error MATCHES "^moondb_mission: [^\n]+\n$")
  message(FATAL_ERROR "not one line on standard error: ${error}")
endif()
