# cmake -DTO=commit.cpp -DSOURCE=DIR -P GitCommit.cmake: the commit of a checkout as a constant, "" outside one; with "+" after it
# if files differ from the commit. Leaves an equal file untouched.
set(commit "")
find_program(git git)
if(git AND EXISTS ${SOURCE}/.git)
  execute_process(COMMAND ${git} describe --always --dirty=+ --exclude=* --abbrev=10 WORKING_DIRECTORY ${SOURCE}
    OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
endif()
file(CONFIGURE OUTPUT ${TO} @ONLY
  CONTENT "#include \"arguments.h\"\n\nnamespace pmsp::tool {\n\nconst char* const kCommit = \"@commit@\";\n\n}  // namespace pmsp::tool\n")
