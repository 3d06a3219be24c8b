# pmsp_report_template(VARIABLE): the source file with the page of tools/viewer. Where node and the packages of
# tools/viewer are there (tools/setup --dev), the page is bundled from its sources; else the prebuilt one is taken. A test
# sees to it that they are the same.
function(pmsp_report_template variable)
  set(viewer ${PROJECT_SOURCE_DIR}/tools/viewer)
  set(page "")
  set(made ${CMAKE_CURRENT_BINARY_DIR}/generated/report_template.cpp)
  if(PMSP_VIEWER)
    find_program(PMSP_NODE NAMES node nodejs)
    if(PMSP_NODE AND EXISTS ${viewer}/node_modules/esbuild AND EXISTS ${viewer}/node_modules/three)
      message(STATUS "Viewer: bundled by ${PMSP_NODE}")
      set(page ${CMAKE_CURRENT_BINARY_DIR}/generated/report.html)
      file(GLOB sources CONFIGURE_DEPENDS ${viewer}/src/*)
      add_custom_command(OUTPUT ${page} COMMAND ${PMSP_NODE} ${viewer}/build.mjs --to ${page}
                         DEPENDS ${sources} ${viewer}/build.mjs ${viewer}/package-lock.json VERBATIM)
    else()
      message(STATUS "Viewer: the prebuilt page")
      set(page ${viewer}/prebuilt/report.html)
    endif()
  endif()
  add_custom_command(OUTPUT ${made}
                     COMMAND ${CMAKE_COMMAND} -DFROM=${page} -DTO=${made} -DNAME=kPageTemplate
                             -DHEADER=web/page.h -P ${PROJECT_SOURCE_DIR}/cmake/EmbedText.cmake
                     DEPENDS ${page} ${PROJECT_SOURCE_DIR}/cmake/EmbedText.cmake VERBATIM)
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    set_source_files_properties(${made} PROPERTIES COMPILE_OPTIONS -Wno-overlength-strings)
  endif()
  set(${variable} ${made} PARENT_SCOPE)
endfunction()
