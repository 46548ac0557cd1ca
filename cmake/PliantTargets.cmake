# One target per folder of src/: a folder may use only the folders that it names here, so that a cycle is a configure or link error.

# Headers are included as <pliant/folder/file.h> in the build tree and once installed.
set(PLIANT_INCLUDE_ROOT "${PROJECT_BINARY_DIR}/include")
file(MAKE_DIRECTORY "${PLIANT_INCLUDE_ROOT}")
file(CREATE_LINK "${PROJECT_SOURCE_DIR}/src" "${PLIANT_INCLUDE_ROOT}/pliant" SYMBOLIC)

add_library(pliant_warnings INTERFACE)
target_compile_options(pliant_warnings INTERFACE -Wall -Wextra -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual
                                                 $<$<BOOL:${PLIANT_WERROR}>:-Werror>)
if(NOT PLIANT_WERROR)
  # fmt checks its format strings when they are used, not when they are compiled, which takes less time to compile.
  target_compile_definitions(pliant_warnings INTERFACE FMT_CONSTEVAL=)
endif()
if(CMAKE_UNITY_BUILD AND CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # The warning concerns names that are local to a source other than the main one.
  target_compile_options(pliant_warnings INTERFACE -Wno-subobject-linkage)
  # The compiler frees memory only beyond this size instead of beyond 128 MB, which saves a fifth of the time for joined
  # sources: half of each core's share of the memory, at most 3 GB.
  cmake_host_system_information(RESULT memory QUERY TOTAL_PHYSICAL_MEMORY)  # MiB
  cmake_host_system_information(RESULT cores QUERY NUMBER_OF_LOGICAL_CORES)
  math(EXPR heap "${memory} * 512 / ${cores}")  # kB
  if(heap GREATER 3000000)
    set(heap 3000000)
  endif()
  add_compile_options("SHELL:--param ggc-min-heapsize=${heap}")
endif()

# Code that runs once per output and not in steps: optimising it less takes a third off its time to compile. Still less
# (-Og) would slow down steps: the linker takes one of the copies of an inline function that several folders contain.
set(pliant_optimise_less $<$<CONFIG:Release>:-O1>)

# A static library in the build tree, and in the install tree as pliant::<name>.
function(pliant_library name)
  add_library(pliant_${name} STATIC)
  target_link_libraries(pliant_${name} PRIVATE $<BUILD_INTERFACE:pliant_warnings>)
  set_target_properties(pliant_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON EXPORT_NAME ${name})
  set_property(GLOBAL APPEND PROPERTY PLIANT_LIBRARIES pliant_${name})
  target_include_directories(pliant_${name} PUBLIC $<BUILD_INTERFACE:${PLIANT_INCLUDE_ROOT}>
                                                   $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(pliant_${name} PUBLIC cxx_std_20)
endfunction()

# pliant_folder(<name> DEPENDS <folders…> LINK <libraries…> OPTIONS <options…> PATH <path> RECURSE JOIN <name>): library
# pliant_<name>, exported as pliant::<name>, from src/<path> (src/<name> unless given), RECURSE: and the folders in it.
# Where sources are joined, all folders with the same JOIN become one source and one library: they share most of their
# headers and templates.
function(pliant_folder name)
  cmake_parse_arguments(ARG "RECURSE" "PATH;JOIN" "DEPENDS;LINK;OPTIONS" ${ARGN})
  if(NOT ARG_PATH)
    set(ARG_PATH ${name})
  endif()
  set(glob GLOB)
  if(ARG_RECURSE)
    set(glob GLOB_RECURSE)
  endif()
  file(${glob} sources CONFIGURE_DEPENDS "${CMAKE_CURRENT_SOURCE_DIR}/${ARG_PATH}/*.cpp")
  list(TRANSFORM ARG_DEPENDS PREPEND pliant_)

  set(library ${name})
  if(ARG_JOIN AND CMAKE_UNITY_BUILD)
    set(library ${ARG_JOIN})
    add_library(pliant_${name} INTERFACE)
    set_target_properties(pliant_${name} PROPERTIES EXPORT_NAME ${name})
    target_link_libraries(pliant_${name} INTERFACE pliant_${library})
    set_property(GLOBAL APPEND PROPERTY PLIANT_LIBRARIES pliant_${name})
    set_property(GLOBAL APPEND PROPERTY PLIANT_FOLDERS_OF_${library} pliant_${name})
    get_property(joined GLOBAL PROPERTY PLIANT_FOLDERS_OF_${library})
    list(REMOVE_ITEM ARG_DEPENDS ${joined})
  endif()
  if(NOT TARGET pliant_${library})
    pliant_library(${library})
  endif()
  target_sources(pliant_${library} PRIVATE ${sources})
  target_compile_options(pliant_${library} PRIVATE ${ARG_OPTIONS})
  target_link_libraries(pliant_${library} PUBLIC ${ARG_DEPENDS} ${ARG_LINK})
  add_library(pliant::${name} ALIAS pliant_${name})
endfunction()

# pliant_part(<folder> <name> SOURCES <files…> OPTIONS <options…>): compiles these files of a folder, joined or each by
# itself like other files, with these options in addition to the folder's.
function(pliant_part folder name)
  cmake_parse_arguments(ARG "" "" "SOURCES;OPTIONS" ${ARGN})
  list(TRANSFORM ARG_SOURCES PREPEND "${CMAKE_CURRENT_SOURCE_DIR}/${folder}/")
  get_target_property(others pliant_${folder} SOURCES)
  list(REMOVE_ITEM others ${ARG_SOURCES})
  set_target_properties(pliant_${folder} PROPERTIES SOURCES "${others}")
  set(part pliant_${folder}_${name})
  add_library(${part} OBJECT ${ARG_SOURCES})
  set_target_properties(${part} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  foreach(property INCLUDE_DIRECTORIES COMPILE_OPTIONS COMPILE_FEATURES LINK_LIBRARIES)
    set_target_properties(${part} PROPERTIES ${property} "$<TARGET_PROPERTY:pliant_${folder},${property}>")
  endforeach()
  target_compile_options(${part} PRIVATE ${ARG_OPTIONS})
  target_sources(pliant_${folder} PRIVATE $<TARGET_OBJECTS:${part}>)
endfunction()
