# Writes OUT, which tells CTest of the suites of a GoogleTest binary, named BINARY.SUITE: one process for each, or, with
# CASES, for each so many cases of a suite (BINARY.SUITE.1, BINARY.SUITE.2, ...). For binaries of many short cases, which take
# less time than a process needs to start.
#   cmake -D EXECUTABLE=... -D OUT=... -D LABELS=A,B -D TIMEOUT=... [-D CASES=...] -P add_suites.cmake
execute_process(COMMAND ${EXECUTABLE} --gtest_list_tests OUTPUT_VARIABLE listed RESULT_VARIABLE failed TIMEOUT 60)
if(failed)
  message(FATAL_ERROR "${EXECUTABLE} --gtest_list_tests: ${failed}")
endif()
get_filename_component(binary ${EXECUTABLE} NAME)
string(REGEX REPLACE " *#[^\n]*" "" listed "${listed}")  # what the parameters are
string(REGEX REPLACE "[;\n]+" ";" lines "${listed}")
string(REPLACE "," ";" LABELS "${LABELS}")
set(text "")
# CTest begins with what waits for other processes: at the end of a run nothing would be left to fill the waits.
set(COST 0)
if(";${LABELS};" MATCHES ";farm;")
  set(COST 50)
endif()

# Tells CTest of the cases of `suite` in `filter`.
function(add name filter)
  string(APPEND text "add_test([==[${binary}.${name}]==] [==[${EXECUTABLE}]==] [==[--gtest_filter=${filter}]==])\n"
         "set_tests_properties([==[${binary}.${name}]==] PROPERTIES LABELS [==[${LABELS}]==] TIMEOUT ${TIMEOUT} COST ${COST})\n")
  set(text "${text}" PARENT_SCOPE)
endfunction()

function(add_suite suite)
  list(LENGTH ARGN count)
  if(NOT CASES OR count LESS_EQUAL "${CASES}")
    add("${suite}" "${suite}.*")
  else()
    # Parts of nearly one size.
    math(EXPR parts "(${count} + ${CASES} - 1) / ${CASES}")
    foreach(part RANGE 1 ${parts})
      math(EXPR begin "(${part} - 1) * ${count} / ${parts}")
      math(EXPR length "${part} * ${count} / ${parts} - ${begin}")
      if(part LESS parts)
        list(SUBLIST ARGN ${begin} ${length} cases)
      else()  # all but those of the other parts: also what the long form adds
        list(SUBLIST ARGN 0 ${begin} cases)
      endif()
      list(TRANSFORM cases PREPEND "${suite}.")
      list(JOIN cases ":" filter)
      if(part EQUAL parts)
        set(filter "${suite}.*-${filter}")
      endif()
      add("${suite}.${part}" "${filter}")
    endforeach()
  endif()
  set(text "${text}" PARENT_SCOPE)
endfunction()

set(suite "")
foreach(line ${lines} "end.")
  if(line MATCHES "^ +(.+)$")
    set(case "${CMAKE_MATCH_1}")
    if(NOT case MATCHES "^DISABLED_")
      list(APPEND cases_of_suite "${case}")
    endif()
  elseif(line MATCHES "^(.+)\\.$")
    set(next "${CMAKE_MATCH_1}")
    if(suite AND cases_of_suite AND NOT suite MATCHES "^DISABLED_|/DISABLED_")
      add_suite("${suite}" ${cases_of_suite})
    endif()
    set(suite "${next}")
    set(cases_of_suite "")
  endif()
endforeach()
file(WRITE ${OUT} "${text}")
