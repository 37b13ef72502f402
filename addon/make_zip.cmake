# Stages the add-on in a folder of its own, for one platform, and zips it.
file(REMOVE_RECURSE ${STAGE} ${ZIP})
set(target ${STAGE}/detail_deform)
file(COPY ${SOURCE}/ DESTINATION ${target} FILES_MATCHING PATTERN "*.py"
  PATTERN __pycache__ EXCLUDE PATTERN lib EXCLUDE)
file(COPY ${LICENSE} ${SOURCE}/../MANUAL.md ${SOURCE}/../manual DESTINATION ${target})
file(COPY ${LIBRARY} DESTINATION ${target}/lib)
# What the add-on knows the whole library by: a part of one ends Blender where it is loaded.
cmake_path(GET LIBRARY FILENAME library)
file(SHA256 ${LIBRARY} digest)
file(WRITE ${target}/lib/${library}.sha256 "${digest}\n")

# A zip holds the library of one platform and must not offer itself to others.
file(READ ${SOURCE}/blender_manifest.toml manifest)
string(REGEX REPLACE "platforms = [^\n]*" "platforms = [\"${PLATFORM}\"]" manifest "${manifest}")

# Where Blender's own buttons and the add-on's lead, if there is a place.
if(WEBSITE)
  string(REGEX REPLACE "\nmaintainer = " "\nwebsite = \"${WEBSITE}\"\nmaintainer = " manifest "${manifest}")
  file(WRITE ${target}/website.py "WEBSITE = \"${WEBSITE}\"\n")
  file(READ ${target}/__init__.py init)
  string(REPLACE "bl_info = {\n"
    "bl_info = {\n    'doc_url': \"${WEBSITE}\",\n    'tracker_url': \"${WEBSITE}/issues\",\n" init "${init}")
  file(WRITE ${target}/__init__.py "${init}")
endif()
file(WRITE ${target}/blender_manifest.toml "${manifest}")

execute_process(COMMAND ${CMAKE_COMMAND} -E tar cf ${ZIP} --format=zip detail_deform
  WORKING_DIRECTORY ${STAGE} COMMAND_ERROR_IS_FATAL ANY)
