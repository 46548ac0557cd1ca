# cmake -D BUILD=… -D WORK=… -D GENERATOR=… -P install.cmake: installs the build into WORK/prefix, moves that elsewhere, as
# packagers do, then uses the installed program, an example, figures, documentation, and the package.
function(run)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

file(REMOVE_RECURSE "${WORK}")
run("${CMAKE_COMMAND}" --install "${BUILD}" --prefix "${WORK}/prefix")
file(RENAME "${WORK}/prefix" "${WORK}/moved")
set(bin "${WORK}/moved/bin")
set(share "${WORK}/moved/share/pliant")
run("${bin}/pliant" -version)
run("${bin}/pliant" hopper -options_file "${share}/examples/hopper_soft_drag.yaml" -n 60 -hopper_wall_distance 8
    -hopper_width 3 -t_end 1 -output "${WORK}/run")
# Every example, from another folder, briefly; a comment in it has its command.
file(GLOB examples "${share}/examples/*.yaml")
foreach(example ${examples})
  file(STRINGS "${example}" command REGEX "^# pliant [a-z]+ -options_file examples/")
  string(REGEX REPLACE "^# pliant ([a-z]+) .*" "\\1" scenario "${command}")
  if(scenario STREQUAL hopper)
    set(brief -n 60 -t_end 0.02)
  elseif(scenario STREQUAL raft)
    set(brief -t_end 1)
  elseif(scenario STREQUAL channel)
    set(brief -t_end 0.01)
  else()
    message(FATAL_ERROR "${example} has no line '# pliant SCENARIO -options_file examples/…'")
  endif()
  get_filename_component(name "${example}" NAME_WE)
  run("${bin}/pliant" ${scenario} -options_file "${example}" ${brief} -output "${WORK}/examples/${name}")
endforeach()
foreach(page README.md LICENSE docs/reference/options.md docs/images/flow.png)
  if(NOT EXISTS "${WORK}/moved/share/doc/pliant/${page}")
    message(FATAL_ERROR "${page} is not installed")
  endif()
endforeach()

if(EXISTS /usr/bin/python3)
  file(WRITE "${WORK}/sweep.csv" "n,hopper_wall_distance,hopper_width,t_end\n60,8,3,0.1\n")
  run("${bin}/pliant-sweep" "${WORK}/sweep.csv")
  run("${bin}/pliant-analyse" channel --help)
  file(WRITE "${WORK}/own.csv" "n,hopper_wall_distance,hopper_width,zeta,t_end,seeds\n60,8,3,1,6,1-2\n60,8,4,1,6,1-2\n60,8,5,1,6,1-2\n")
  run("${bin}/pliant-reproduce" H2 --table "${WORK}/own.csv" --output "${WORK}/reproduced")
  if(NOT EXISTS "${share}/validation/quick/limits.csv" OR NOT EXISTS "${WORK}/reproduced/H2-own.pdf")
    message(FATAL_ERROR "pliant-reproduce has no tables, or H2-own.pdf was not drawn")
  endif()
  run("${bin}/pliant-plot" series "${WORK}/run" -o "${WORK}/series.png")
  run("${bin}/pliant-report" "${WORK}/run")
  if(NOT EXISTS "${WORK}/run/report.html")
    message(FATAL_ERROR "report.html was not written")
  endif()
  run("${share}/python/plots/snapshot.py" "${WORK}/run" -o "${WORK}/snapshot.png")
  foreach(figure series snapshot)
    if(NOT EXISTS "${WORK}/${figure}.png")
      message(FATAL_ERROR "${figure}.png was not drawn")
    endif()
  endforeach()
endif()

# The Python package, by the link for an installation in /usr/local.
file(GLOB packages "${WORK}/moved/lib/python3*/dist-packages")
if(packages)
  run("${CMAKE_COMMAND}" -E env "PYTHONPATH=${packages}" /usr/bin/python3 -B -c
      "import pliant; print(pliant.hopper(n=40, hopper_wall_distance=8, hopper_width=3, t_end=0.1, output='${WORK}/python').frames)")
endif()

# A program is optimised by default; a build without optimisation gives a warning.
unset(ENV{CMAKE_BUILD_TYPE})
set(package -G "${GENERATOR}" -D "CMAKE_PREFIX_PATH=${WORK}/moved")
run("${CMAKE_COMMAND}" -S "${share}/examples/own_term" -B "${WORK}/build" ${package}
    -D CMAKE_CXX_FLAGS_RELEASE=-O0)  # as that compiles faster
file(STRINGS "${WORK}/build/CMakeCache.txt" type REGEX "^CMAKE_BUILD_TYPE:")
if(NOT type STREQUAL "CMAKE_BUILD_TYPE:STRING=Release")
  message(FATAL_ERROR "own_term is built as '${type}'")
endif()
run("${CMAKE_COMMAND}" --build "${WORK}/build")
run("${WORK}/build/own_term" check 2)

# Only the integrators of SUNDIALS, in a program without particles.
run("${CMAKE_COMMAND}" -S "${share}/examples/plain_ode" -B "${WORK}/build-ode" ${package})
run("${CMAKE_COMMAND}" --build "${WORK}/build-ode")
foreach(type cvode arkode)
  execute_process(COMMAND "${WORK}/build-ode/plain_ode" -ts_type ${type} OUTPUT_VARIABLE told COMMAND_ERROR_IS_FATAL ANY)
  if(NOT told MATCHES "0\\.36787[89]")
    message(FATAL_ERROR "plain_ode -ts_type ${type} prints ${told}")
  endif()
endforeach()

# A model outside the tree and a scenario outside the tree: run, then continued to a later end.
run("${WORK}/build/own_term" hopper -model droplet -tension 30 -n 20 -n_vertices 12 -hopper_wall_distance 7 -hopper_width 3
    -e_c 500 -e_w 500 -k_a 1000 -t_end 0.1 -output "${WORK}/droplets")
run("${WORK}/build/own_term" hopper -restart "${WORK}/droplets" -t_end 0.2)
run("${CMAKE_COMMAND}" -S "${share}/examples/own_scenario" -B "${WORK}/build-scenario" ${package}
    -D CMAKE_BUILD_TYPE=Debug)  # as that compiles faster
run("${CMAKE_COMMAND}" --build "${WORK}/build-scenario")
run("${WORK}/build-scenario/own_scenario" shaken_box -n 20 -t_end 0.2 -output "${WORK}/box")
run("${WORK}/build-scenario/own_scenario" shaken_box -restart "${WORK}/box" -t_end 0.4)
file(READ "${WORK}/box/summary.json" summary)
string(JSON t GET "${summary}" t)
string(JSON scenario GET "${summary}" scenario)
if(NOT scenario STREQUAL shaken_box OR t LESS 0.4)
  message(FATAL_ERROR "own_scenario: the summary has scenario ${scenario}, t = ${t}")
endif()

file(WRITE "${WORK}/user/CMakeLists.txt" "cmake_minimum_required(VERSION 3.25)\nproject(user LANGUAGES CXX)\nfind_package(pliant REQUIRED)\n")
foreach(type "" Debug)
  execute_process(COMMAND "${CMAKE_COMMAND}" -S "${WORK}/user" -B "${WORK}/user/build" ${package} -D "CMAKE_BUILD_TYPE=${type}"
                  ERROR_VARIABLE told COMMAND_ERROR_IS_FATAL ANY)
  string(FIND "${told}" "user has no build type" at)
  if((at EQUAL -1) EQUAL (type STREQUAL ""))
    message(FATAL_ERROR "build type '${type}': configuring says ${told}")
  endif()
endforeach()
