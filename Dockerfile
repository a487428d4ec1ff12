# docker build -t semvs --build-arg COMMIT=$(git rev-parse HEAD) .
# docker run --rm -v "$PWD:/data" --user "$(id -u):$(id -g)" semvs densify scene.mvs -o out/cloud.ply -w out

FROM rust:1.95.0-slim-bookworm AS build
WORKDIR /semvs
COPY . .
# The repository is not there to tell.
ARG COMMIT=
RUN SEMVS_COMMIT=$COMMIT cargo build --locked --release --bins

# No packages are added: the programs need libc and libgcc, which the base has.
FROM debian:bookworm-slim
COPY --from=build /semvs/target/release/semvs /semvs/target/release/DensifyPointCloud /usr/local/bin/
COPY --from=build /semvs/LICENSE-APACHE /semvs/LICENSE-MIT /usr/share/doc/semvs/
RUN useradd --uid 10001 --no-create-home --shell /usr/sbin/nologin semvs && install -d -o semvs -g semvs /data
USER semvs
WORKDIR /data
ENTRYPOINT ["semvs"]
CMD ["--help"]
