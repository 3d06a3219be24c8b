# cmake -DINSTALLED=include -DLIST=headers.txt -P check_headers.cmake: the installed headers are those of the list.
file(STRINGS ${LIST} expected)
file(GLOB_RECURSE found RELATIVE ${INSTALLED} ${INSTALLED}/*)
list(SORT expected)
list(SORT found)
if(NOT found STREQUAL expected)
  message(FATAL_ERROR "installed headers: ${found}; expected: ${expected} (${LIST})")
endif()
