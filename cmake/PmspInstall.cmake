# Installs the libraries, headers and tools, and what find_package(pmsp) and pkg-config need. Included once all targets exist.
# Components (cmake --install build --component pmsp): those of find_package, pmsp = the library that a SLAM links, pmsp_io,
# pmsp_web; NAME_runtime = what programs that link the shared library NAME need; and tools. Tools that were not built are left
# out.
include(CMakePackageConfigHelpers)

set(_pmsp_cmake_dir "${CMAKE_INSTALL_LIBDIR}/cmake/pmsp")
set(_pmsp_components pmsp)
if(TARGET pmsp_io)
  list(APPEND _pmsp_components pmsp_io)
endif()
if(TARGET pmsp_web)
  list(APPEND _pmsp_components pmsp_web)
endif()

foreach(component IN LISTS _pmsp_components)
  set_target_properties(${component} PROPERTIES
    VERSION ${PROJECT_VERSION}
    SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR}   # before 1.0 a minor version may break the interface
    DEFINE_SYMBOL ""   # nothing asks whether it is compiled for a shared library
    INSTALL_RPATH "$ORIGIN")
  install(TARGETS ${component} EXPORT ${component}-targets
    ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT ${component}
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT ${component}_runtime NAMELINK_COMPONENT ${component}
    RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT ${component})
  install(EXPORT ${component}-targets NAMESPACE pmsp:: DESTINATION ${_pmsp_cmake_dir} COMPONENT ${component})
endforeach()

install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/pmsp DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT pmsp
  FILES_MATCHING PATTERN "*.h" PATTERN io EXCLUDE PATTERN web.h EXCLUDE)
install(FILES ${PROJECT_BINARY_DIR}/include/pmsp/version.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pmsp COMPONENT pmsp)
if("pmsp_io" IN_LIST _pmsp_components)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/include/pmsp/io DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pmsp COMPONENT pmsp_io
    FILES_MATCHING PATTERN "*.h")
endif()
if("pmsp_web" IN_LIST _pmsp_components)
  install(FILES ${PROJECT_SOURCE_DIR}/include/pmsp/web.h DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/pmsp COMPONENT pmsp_web)
endif()

file(GLOB _pmsp_examples ${PROJECT_SOURCE_DIR}/examples/*.h ${PROJECT_SOURCE_DIR}/examples/*.cpp)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT pmsp)
install(FILES ${_pmsp_examples} DESTINATION ${CMAKE_INSTALL_DOCDIR}/examples COMPONENT pmsp)

file(RELATIVE_PATH _pmsp_bin_to_lib "/${CMAKE_INSTALL_BINDIR}" "/${CMAKE_INSTALL_LIBDIR}")
foreach(tool pmsp-densify pmsp-eval pmsp-synth)
  if(TARGET ${tool})
    set_target_properties(${tool} PROPERTIES INSTALL_RPATH "$ORIGIN/${_pmsp_bin_to_lib}")
    install(TARGETS ${tool} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT tools OPTIONAL)
    install(FILES ${PROJECT_SOURCE_DIR}/packaging/completion.bash RENAME ${tool}
      DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT tools)
  endif()
endforeach()

if(TARGET pmsp-densify)
  install(PROGRAMS ${PROJECT_SOURCE_DIR}/tools/slurm/batch.sbatch ${PROJECT_SOURCE_DIR}/tools/slurm/mission.sh
    DESTINATION ${CMAKE_INSTALL_DATADIR}/pmsp/slurm COMPONENT tools)
  install(FILES ${PROJECT_SOURCE_DIR}/tools/slurm/Snakefile
    DESTINATION ${CMAKE_INSTALL_DATADIR}/pmsp/slurm COMPONENT tools)
endif()

# A static library brings along what it is made of; a shared one has linked it already.
if(BUILD_SHARED_LIBS)
  set(PMSP_IS_STATIC OFF)
else()
  set(PMSP_IS_STATIC ON)
endif()
get_target_property(_pmsp_link_libraries pmsp LINK_LIBRARIES)
if(_pmsp_link_libraries MATCHES "CUDA::cudart")
  set(PMSP_LINKS_CUDA ON)
else()
  set(PMSP_LINKS_CUDA OFF)
endif()
configure_package_config_file(cmake/pmsp-config.cmake.in package/pmsp-config.cmake INSTALL_DESTINATION ${_pmsp_cmake_dir})
write_basic_package_version_file(package/pmsp-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/package/pmsp-config.cmake ${PROJECT_BINARY_DIR}/package/pmsp-config-version.cmake
  DESTINATION ${_pmsp_cmake_dir} COMPONENT pmsp)

# pkg-config: the prefix is found from the file's own place, so that an installed tree can be moved.
file(RELATIVE_PATH PMSP_PC_TO_PREFIX "/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/")
string(REGEX REPLACE "/$" "" PMSP_PC_TO_PREFIX "${PMSP_PC_TO_PREFIX}")
set(_pmsp_libs "${CMAKE_THREAD_LIBS_INIT}")
if(PMSP_LINKS_CUDA AND PMSP_IS_STATIC)
  string(APPEND _pmsp_libs " -L${CUDAToolkit_LIBRARY_DIR} -lcudart_static -ldl -lrt")
endif()
set(_pmsp_io_libs "-lopencv_videoio -lopencv_imgcodecs -lopencv_imgproc -lopencv_core")
if(PMSP_IS_STATIC)
  set(PMSP_PC_LIBS "${_pmsp_libs}")
  set(PMSP_PC_IO_LIBS "${_pmsp_io_libs}")
  set(PMSP_PC_IO_REQUIRES ", libzip, octomap, sqlite3, pugixml, zlib")
else()
  set(PMSP_PC_LIBS_PRIVATE "${_pmsp_libs}")
  set(PMSP_PC_IO_LIBS_PRIVATE "${_pmsp_io_libs}")
  set(PMSP_PC_IO_REQUIRES_PRIVATE "libzip, octomap, sqlite3, pugixml, zlib")
endif()
foreach(component IN LISTS _pmsp_components)
  configure_file(cmake/${component}.pc.in package/${component}.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/package/${component}.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig
    COMPONENT ${component})
endforeach()
