# Debian packages by cpack: from a static build pmsp-tools and python3-pmsp, which need no other package of the project; from a
# shared one libpmsp0.1 and libpmsp-dev. tools/package builds and packs both.
set(_pmsp_soversion ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME libpmsp)
set(CPACK_PACKAGE_CONTACT "The libpmsp authors <maintainers@libpmsp.example>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")   # each package has its own
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1)
set(CPACK_DEBIAN_PACKAGE_PRIORITY optional)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS ON)
set(CPACK_DEBIAN_PACKAGE_GENERATE_SHLIBS_POLICY ">=")
set(CPACK_DEBIAN_ENABLE_COMPONENT_DEPENDS OFF)
set(CPACK_DEB_COMPONENT_INSTALL ON)

# pmsp_deb(GROUP NAME SECTION SUMMARY DESCRIPTION COMPONENT...): a package with its copyright and changelog.
set(CPACK_COMPONENTS_ALL "")
function(pmsp_deb group name section summary description)
  string(TOUPPER ${group} upper)
  set(doc ${CMAKE_INSTALL_DATADIR}/doc/${name})
  install(FILES ${PROJECT_SOURCE_DIR}/packaging/debian/copyright DESTINATION ${doc} COMPONENT ${group}_doc EXCLUDE_FROM_ALL)
  install(FILES ${PROJECT_BINARY_DIR}/package/changelog.gz DESTINATION ${doc} COMPONENT ${group}_doc EXCLUDE_FROM_ALL)
  install(FILES ${PROJECT_BINARY_DIR}/package/changelog.Debian.gz DESTINATION ${doc} COMPONENT ${group}_doc EXCLUDE_FROM_ALL)
  foreach(component ${ARGN} ${group}_doc)
    string(TOUPPER ${component} component_upper)
    set(CPACK_COMPONENT_${component_upper}_GROUP ${group} PARENT_SCOPE)
  endforeach()
  set(CPACK_COMPONENTS_ALL ${CPACK_COMPONENTS_ALL} ${ARGN} ${group}_doc PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${name} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_PACKAGE_SECTION ${section} PARENT_SCOPE)
  set(CPACK_DEBIAN_${upper}_DESCRIPTION "${summary}\n${description}" PARENT_SCOPE)
endfunction()

# With CUDA the tools are a variant: the code for GPUs is as large as all the rest, and its compiler is not free software.
set(_pmsp_variant "")
if(PMSP_HAVE_CUDA)
  set(_pmsp_variant "-cuda")
endif()
get_cmake_property(_pmsp_known_components COMPONENTS)
if(BUILD_SHARED_LIBS)
  pmsp_deb(lib libpmsp${_pmsp_soversion} libs "dense 3D from 360-degree video, shared libraries"
    "Turns the equirectangular keyframes, poses and points of a visual SLAM into
a dense, coloured point cloud, by PatchMatch stereo on the sphere."
    pmsp_runtime pmsp_io_runtime pmsp_web_runtime)
  set(CPACK_DEBIAN_LIB_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/packaging/debian/triggers)
  pmsp_deb(dev libpmsp-dev libdevel "dense 3D from 360-degree video, development files"
    "Headers, CMake and pkg-config files and examples of libpmsp, which turns the
keyframes of a visual SLAM into a dense point cloud."
    pmsp pmsp_io pmsp_web)
  set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS
    "libpmsp${_pmsp_soversion} (= ${PROJECT_VERSION}-${CPACK_DEBIAN_PACKAGE_RELEASE}), libeigen3-dev, libopencv-dev, liboctomap-dev, libsqlite3-dev, libpugixml-dev, libzip-dev, zlib1g-dev")
  set(CPACK_DEBIAN_DEV_PACKAGE_SHLIBDEPS OFF)
else()
  pmsp_deb(tools pmsp-tools${_pmsp_variant} science "dense 3D from 360-degree video, programs"
    "pmsp-densify turns the equirectangular keyframes, poses and points of a
visual SLAM into a dense, coloured point cloud with normals and confidences;
pmsp-eval compares clouds and depth maps with a known truth, pmsp-synth
renders missions with exact truth."
    tools)
  set(CPACK_DEBIAN_TOOLS_PACKAGE_RECOMMENDS ffmpeg)
  if(PMSP_HAVE_CUDA)
    foreach(relation PROVIDES CONFLICTS REPLACES)
      set(CPACK_DEBIAN_TOOLS_PACKAGE_${relation} pmsp-tools)
    endforeach()
  endif()
  if("python" IN_LIST _pmsp_known_components)
    pmsp_deb(python python3-pmsp python "dense 3D from 360-degree video, Python module"
      "The module pmsp turns keyframes, poses and points of a visual SLAM into
dense point clouds, depth maps and normals as NumPy arrays."
      python)
    math(EXPR _pmsp_next_python "${PMSP_PYTHON_MINOR} + 1")   # an extension is of one version
    set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
      "python3 (>= 3.${PMSP_PYTHON_MINOR}), python3 (<< 3.${_pmsp_next_python}), python3-numpy")
  endif()
endif()
set(CPACK_COMPONENTS_GROUPING ONE_PER_GROUP)

# What Debian wants in each package: a compressed changelog, and manual pages, made from --help.
find_program(PMSP_GZIP gzip)
find_program(PMSP_HELP2MAN help2man)
mark_as_advanced(PMSP_GZIP PMSP_HELP2MAN)
string(TIMESTAMP PMSP_DEB_DATE "%a, %d %b %Y %H:%M:%S +0000" UTC)   # of SOURCE_DATE_EPOCH, if set
configure_file(packaging/debian/changelog.in package/changelog.Debian @ONLY)
configure_file(CHANGELOG.md package/changelog COPYONLY)

# pmsp_compress(FILE): the target package_files makes FILE.gz.
function(pmsp_compress file)
  add_custom_command(OUTPUT ${file}.gz COMMAND ${PMSP_GZIP} -9nkf ${file} DEPENDS ${file} VERBATIM)
  set_property(GLOBAL APPEND PROPERTY pmsp_package_files ${file}.gz)
endfunction()

# pmsp_manual(TOOL VERB HELP WHAT): TOOL-VERB(1), or TOOL(1) if VERB is "".
function(pmsp_manual tool verb help what)
  if(NOT TARGET ${tool} OR NOT PMSP_HELP2MAN OR BUILD_SHARED_LIBS)
    return()
  endif()
  set(name ${tool})
  set(command $<TARGET_FILE:${tool}>)
  if(verb)
    set(name ${tool}-${verb})
    set(command "$<TARGET_FILE:${tool}> ${verb}")
  endif()
  set(page ${PROJECT_BINARY_DIR}/package/${name}.1)
  add_custom_command(OUTPUT ${page} DEPENDS ${tool} VERBATIM
    COMMAND ${PMSP_HELP2MAN} --no-info --version-string "${name} ${PROJECT_VERSION}" --help-option ${help} --name ${what}
      --output ${page} ${command})
  pmsp_compress(${page})
  install(FILES ${page}.gz DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT tools_doc EXCLUDE_FROM_ALL)
endfunction()

if(PMSP_GZIP)
  pmsp_compress(${PROJECT_BINARY_DIR}/package/changelog)
  pmsp_compress(${PROJECT_BINARY_DIR}/package/changelog.Debian)
  pmsp_manual(pmsp-densify "" --help-all "dense point clouds from 360-degree images")
  pmsp_manual(pmsp-densify info --help-all "checks and forecast of a run")
  pmsp_manual(pmsp-densify fuse --help-all "existing depth maps to a cloud")
  pmsp_manual(pmsp-densify convert --help "cloud to another format, frame, unit or amount")
  pmsp_manual(pmsp-densify report --help "page for a browser, of a cloud or a workspace")
  pmsp_manual(pmsp-densify serve --help "report and its directory over HTTP")
  pmsp_manual(pmsp-densify batch --help "list of missions")
  pmsp_manual(pmsp-densify merge --help-all "shards to a cloud")
  pmsp_manual(pmsp-eval "" --help "comparison with a known truth")
  pmsp_manual(pmsp-eval cloud --help "errors and completeness of a cloud")
  pmsp_manual(pmsp-eval depth --help "errors of depth maps")
  pmsp_manual(pmsp-eval align --help "similarity between a map and the truth")
  pmsp_manual(pmsp-synth "" --help "synthetic 360-degree missions with exact truth")
  get_property(_pmsp_package_files GLOBAL PROPERTY pmsp_package_files)
  add_custom_target(package_files DEPENDS ${_pmsp_package_files})
endif()
include(CPack)
