# How the compiler is called, whatever the target.

# Shared libraries show what pmsp/api.h marks, and nothing else.
set(CMAKE_CXX_VISIBILITY_PRESET hidden)
set(CMAKE_CUDA_VISIBILITY_PRESET hidden)
set(CMAKE_VISIBILITY_INLINES_HIDDEN ON)

# Without this flag position-independent code could inline no function that another library might replace.
include(CheckCXXCompilerFlag)
check_cxx_compiler_flag(-fno-semantic-interposition PMSP_HAVE_NO_SEMANTIC_INTERPOSITION)
if(PMSP_HAVE_NO_SEMANTIC_INTERPOSITION)
  add_compile_options($<$<COMPILE_LANGUAGE:CXX>:-fno-semantic-interposition>)
endif()

# pmsp_use_ccache(): compiles through ccache where it is installed and no other launcher was asked for.
macro(pmsp_use_ccache)
  find_program(PMSP_CCACHE ccache DOC "Compiler cache; set to empty to compile without")
  mark_as_advanced(PMSP_CCACHE)
  if(PMSP_CCACHE)
    foreach(language CXX CUDA)
      if(NOT DEFINED CMAKE_${language}_COMPILER_LAUNCHER)
        set(CMAKE_${language}_COMPILER_LAUNCHER "${PMSP_CCACHE}")
      endif()
    endforeach()
  endif()
endmacro()
