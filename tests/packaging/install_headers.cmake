# Installs the headers without building anything; a compiled component then says that it is not there.
file(REMOVE_RECURSE ${BINARY})
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  string(REGEX REPLACE "[ \n]+" " " output "${output}")  # CMake wraps lines.
  set(result ${result} PARENT_SCOPE)
  set(output "${output}" PARENT_SCOPE)
endfunction()
function(expect code text)
  string(FIND "${output}" "${text}" at)
  if(at EQUAL -1 OR NOT result EQUAL ${code})
    message(FATAL_ERROR "expected code ${code} and '${text}', found ${result}:\n${output}")
  endif()
endfunction()

run(${CMAKE_COMMAND} -G ${GENERATOR} -S ${SOURCE} -B ${BINARY}/build -DCMAKE_CXX_COMPILER=${COMPILER}
    -DSTILLPOINT_BUILD_TESTS=OFF -DSTILLPOINT_BUILD_EXAMPLES=OFF -DSTILLPOINT_BUILD_BENCHMARKS=OFF)
expect(0 "Generating done")
run(${CMAKE_COMMAND} --install ${BINARY}/build --prefix ${BINARY}/prefix)
expect(0 "not installed, as it is not built: component 'compiled'")
expect(0 "not installed, as it is not built: component 'host'")
set(consumer ${CMAKE_COMMAND} -G ${GENERATOR} -S ${PROJECT} -DCMAKE_CXX_COMPILER=${COMPILER}
    -DCMAKE_PREFIX_PATH=${BINARY}/prefix)
run(${consumer} -B ${BINARY}/core -DASK=nothing)
expect(0 "has stillpoint::stillpoint")
foreach(component compiled host)
  run(${consumer} -B ${BINARY}/${component} -DCOMPONENT=${component})
  expect(1 "component '${component}' was not built when this copy of Stillpoint was installed")
endforeach()
