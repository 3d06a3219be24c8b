# pmsp_warnings(TARGET): the warnings that all of the project's own code is built with.
function(pmsp_warnings target)
  target_compile_options(${target} PRIVATE
    $<$<COMPILE_LANGUAGE:CXX>:-Wall;-Wextra;-Wpedantic;-Wshadow;-Wconversion;-Wno-sign-conversion;-Wnon-virtual-dtor;-Wold-style-cast>)
  # kernels/ is written once for floats and for batches of them: there & is what joins conditions of both. Braces may be
  # left out around parts of an aggregate, as GCC thinks, too.
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    target_compile_options(${target} PRIVATE
      $<$<COMPILE_LANGUAGE:CXX>:-Wno-bitwise-instead-of-logical;-Wno-missing-braces>)
  elseif(PMSP_UNITY)   # a private class of a source, in a group, looks to GCC like one of a header
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Wno-subobject-linkage>)
  endif()
  if(PMSP_WERROR)
    target_compile_options(${target} PRIVATE $<$<COMPILE_LANGUAGE:CXX>:-Werror>)
  endif()
endfunction()
