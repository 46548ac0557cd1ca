# A container with an installed pliant:
#   docker build -t pliant .
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD:/work" pliant hopper -t_end 20
# The project has no test of this file. Its commands are tested outside containers (scripts/package.sh).
FROM debian:12 AS build
COPY scripts/common.sh scripts/setup.sh /source/scripts/
RUN /source/scripts/setup.sh
COPY . /source
WORKDIR /source
# Without tests, which need several times as long.
RUN cmake --preset package -B build && cmake --build build \
    && cmake --install build --prefix /opt/pliant

FROM debian:12
COPY scripts/common.sh scripts/setup.sh /tmp/scripts/
# The compilers stay, so that the container can build programs with models and scenarios of users.
RUN /tmp/scripts/setup.sh && apt-get clean && rm -rf /var/lib/apt/lists/* /tmp/scripts
COPY --from=build /opt/pliant /opt/pliant
ENV PATH=/opt/pliant/bin:$PATH CMAKE_PREFIX_PATH=/opt/pliant MPLCONFIGDIR=/tmp \
    OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1
WORKDIR /work
ENTRYPOINT ["pliant"]
CMD ["-help"]
