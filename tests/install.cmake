# cmake -D BUILD=… -D WORK=… -D GENERATOR=… -D EXAMPLE=… -P install.cmake: installs the build into WORK/prefix, moves
# that elsewhere, as packagers do, then configures, builds and runs an example program against it.
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE "${WORK}")
run("${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${WORK}/prefix")
file(RENAME "${WORK}/prefix" "${WORK}/moved")
run("${WORK}/moved/bin/pliant" -version)
if(EXISTS /usr/bin/python3)
  file(WRITE "${WORK}/sweep.csv" "n,hopper_wall_distance,hopper_width,t_end\n60,8,3,0.1\n")
  run("${WORK}/moved/bin/pliant-sweep" "${WORK}/sweep.csv")
endif()

cmake_path(GET EXAMPLE FILENAME program)
run("${CMAKE_COMMAND}" -S "${EXAMPLE}" -B "${WORK}/build" -G "${GENERATOR}" -D CMAKE_BUILD_TYPE=Release
    -D "CMAKE_PREFIX_PATH=${WORK}/moved")
run("${CMAKE_COMMAND}" --build "${WORK}/build")
run("${WORK}/build/${program}")
