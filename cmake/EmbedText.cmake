# cmake -DFROM=page.html -DTO=page.cpp -DNAME=kPage -DHEADER=page.h -P EmbedText.cmake: a text as a constant of pmsp::web.
set(text "")
if(FROM)
  file(READ ${FROM} text)
endif()
file(WRITE ${TO} "// Made from ${FROM}\n#include \"${HEADER}\"\n\nnamespace pmsp::web {\n\nconst char* const ${NAME} = R\"PMSPTEXT(${text})PMSPTEXT\";\n\n}  // namespace pmsp::web\n")
