# Decides on the CUDA target and says so in one line. Sets PMSP_HAVE_CUDA; where it is ON, the language CUDA is enabled
# and CUDA::cudart_static is there to link.
set(PMSP_HAVE_CUDA OFF)

if(NOT PMSP_CUDA MATCHES "^(AUTO|ON|OFF)$")
  message(FATAL_ERROR "PMSP_CUDA is '${PMSP_CUDA}'; it must be AUTO, ON or OFF")
endif()

file(GLOB_RECURSE _pmsp_cuda_sources CONFIGURE_DEPENDS "${PROJECT_SOURCE_DIR}/src/*.cu")
if(PMSP_CUDA STREQUAL "OFF")
  set(_pmsp_cuda_why_not "PMSP_CUDA is OFF")
elseif(NOT _pmsp_cuda_sources)
  set(_pmsp_cuda_why_not "this version has no CUDA sources")
else()
  find_program(PMSP_NVCC nvcc
    HINTS ENV CUDACXX ENV CUDA_PATH ENV CUDA_HOME
    PATHS /usr/local/cuda /opt/cuda
    PATH_SUFFIXES bin
    DOC "CUDA compiler")
  mark_as_advanced(PMSP_NVCC)
  if(CMAKE_CUDA_COMPILER)
    set(_pmsp_nvcc "${CMAKE_CUDA_COMPILER}")
  else()
    set(_pmsp_nvcc "${PMSP_NVCC}")
  endif()

  if(NOT _pmsp_nvcc)
    set(_pmsp_cuda_why_not "no CUDA toolkit found (nvcc is not in PATH, CUDA_PATH or /usr/local/cuda; -DCMAKE_CUDA_COMPILER=... names one)")
  else()
    # Set before the language is enabled: the default that CMake 3.25 tests the compiler with is older than what nvcc 13
    # knows. Machine code for what the toolkit knows of these, and PTX of the newest, which later drivers compile:
    #   75 Turing, 80 86 Ampere, 87 Jetson Orin, 89 Ada, 90 Hopper, 100 110 120 Blackwell (data centre, Jetson Thor, others)
    # Minor versions in between (88, 103, 121) run the code of the one before. Building for all of them takes ten
    # minutes of one processor, for one of them a minute.
    if(NOT DEFINED CMAKE_CUDA_ARCHITECTURES)
      execute_process(COMMAND "${_pmsp_nvcc}" --list-gpu-arch OUTPUT_VARIABLE _pmsp_known ERROR_QUIET)
      set(_pmsp_archs "")
      foreach(arch 75 80 86 87 89 90 100 110 120)
        if(_pmsp_known MATCHES "compute_${arch}\n")
          list(APPEND _pmsp_archs ${arch}-real)
          set(_pmsp_newest ${arch})
        endif()
      endforeach()
      if(_pmsp_archs)
        list(APPEND _pmsp_archs ${_pmsp_newest}-virtual)
      else()
        set(_pmsp_archs 75-real 80)   # toolkits too old to tell
      endif()
      set(CMAKE_CUDA_ARCHITECTURES "${_pmsp_archs}" CACHE STRING "CUDA architectures to build for")
    endif()
    if(NOT DEFINED CMAKE_CUDA_STANDARD)
      set(CMAKE_CUDA_STANDARD 17)
      set(CMAKE_CUDA_STANDARD_REQUIRED ON)
    endif()

    # Enabling a language that does not work stops the configuration, so it is tried first.
    if(NOT DEFINED PMSP_CUDA_WORKS OR NOT PMSP_CUDA_TRIED STREQUAL "${_pmsp_nvcc};${CMAKE_CUDA_ARCHITECTURES}")
      set(_pmsp_probe "${PROJECT_BINARY_DIR}/CMakeFiles/pmsp_cuda_probe")
      file(REMOVE_RECURSE "${_pmsp_probe}")
      file(WRITE "${_pmsp_probe}/CMakeLists.txt"
        "cmake_minimum_required(VERSION 3.22)\nproject(probe CUDA)\nfind_package(CUDAToolkit REQUIRED)\n")
      execute_process(
        COMMAND "${CMAKE_COMMAND}" -S "${_pmsp_probe}" -B "${_pmsp_probe}/build" -G "${CMAKE_GENERATOR}"
                "-DCMAKE_MAKE_PROGRAM=${CMAKE_MAKE_PROGRAM}" "-DCMAKE_CUDA_COMPILER=${_pmsp_nvcc}"
                "-DCMAKE_CUDA_ARCHITECTURES=${CMAKE_CUDA_ARCHITECTURES}" "-DCMAKE_CUDA_HOST_COMPILER=${CMAKE_CUDA_HOST_COMPILER}"
        RESULT_VARIABLE _pmsp_cuda_result OUTPUT_FILE "${_pmsp_probe}/log" ERROR_FILE "${_pmsp_probe}/log")
      if(_pmsp_cuda_result EQUAL 0)
        set(PMSP_CUDA_WORKS ON CACHE INTERNAL "")
      else()
        set(PMSP_CUDA_WORKS OFF CACHE INTERNAL "")
      endif()
      set(PMSP_CUDA_TRIED "${_pmsp_nvcc};${CMAKE_CUDA_ARCHITECTURES}" CACHE INTERNAL "")
    endif()

    if(PMSP_CUDA_WORKS)
      set(CMAKE_CUDA_COMPILER "${_pmsp_nvcc}" CACHE FILEPATH "CUDA compiler")
      enable_language(CUDA)
      find_package(CUDAToolkit REQUIRED)
      set(PMSP_HAVE_CUDA ON)
    else()
      set(_pmsp_cuda_why_not
        "${_pmsp_nvcc} cannot build for ${CMAKE_CUDA_ARCHITECTURES}; see ${PROJECT_BINARY_DIR}/CMakeFiles/pmsp_cuda_probe/log")
    endif()
  endif()
endif()

if(PMSP_HAVE_CUDA)
  message(STATUS "CUDA target: built, with nvcc ${CMAKE_CUDA_COMPILER_VERSION} for ${CMAKE_CUDA_ARCHITECTURES}")
elseif(PMSP_CUDA STREQUAL "ON")
  message(FATAL_ERROR "PMSP_CUDA is ON, but ${_pmsp_cuda_why_not}")
else()
  message(STATUS "CUDA target: not built, ${_pmsp_cuda_why_not}; all else works")
endif()
