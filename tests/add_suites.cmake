# Writes OUT, which tells CTest of the suites of a GoogleTest binary: one test each, named BINARY.SUITE. For binaries of many
# short cases, which take less time than a process needs to start.
#   cmake -D EXECUTABLE=... -D OUT=... -D LABEL=... -D TIMEOUT=... -P add_suites.cmake
execute_process(COMMAND ${EXECUTABLE} --gtest_list_tests OUTPUT_VARIABLE listed RESULT_VARIABLE failed TIMEOUT 60)
if(failed)
  message(FATAL_ERROR "${EXECUTABLE} --gtest_list_tests: ${failed}")
endif()
get_filename_component(binary ${EXECUTABLE} NAME)
set(text "")
string(REGEX MATCHALL "(^|\n)[^ \n][^ \n]*\\." suites "${listed}")
foreach(suite ${suites})
  string(STRIP "${suite}" suite)
  if(suite MATCHES "^DISABLED_|/DISABLED_")
    continue()
  endif()
  string(REGEX REPLACE "\\.$" "" name "${suite}")
  string(APPEND text
         "add_test([==[${binary}.${name}]==] [==[${EXECUTABLE}]==] [==[--gtest_filter=${suite}*]==])\n"
         "set_tests_properties([==[${binary}.${name}]==] PROPERTIES LABELS ${LABEL} TIMEOUT ${TIMEOUT})\n")
endforeach()
file(WRITE ${OUT} "${text}")
