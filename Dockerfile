# Images of the simulator (the last stage) and of the example devkit script (--target script): docs/containers.md.
# Arguments: BASE, an image of Debian 12; DEBIAN_MIRROR and PIP_INDEX_URL, other sources of packages.
ARG BASE=docker.io/library/debian:bookworm-slim

FROM ${BASE} AS python
ARG DEBIAN_MIRROR
RUN if [ -n "$DEBIAN_MIRROR" ]; then \
        rm -f /etc/apt/sources.list.d/*; \
        echo "deb $DEBIAN_MIRROR bookworm main" >/etc/apt/sources.list; \
    fi; \
    apt-get update -q && apt-get install -y -q --no-install-recommends ca-certificates python3 && \
    rm -rf /var/lib/apt/lists/*

FROM python AS graphics
RUN apt-get update -q && apt-get install -y -q --no-install-recommends libegl1 libgl1 libgl1-mesa-dri && \
    rm -rf /var/lib/apt/lists/*

FROM graphics AS builder
RUN apt-get update -q && apt-get install -y -q --no-install-recommends binutils python3-venv
ARG PIP_INDEX_URL
RUN python3 -m venv /opt/uv && /opt/uv/bin/pip install -q uv
ENV PATH=/opt/uv/bin:$PATH UV_LINK_MODE=copy

FROM builder AS built
WORKDIR /source
COPY . .
# The packages have the versions and hashes of uv.lock, from any index; then the physics is compiled for any x86-64
# processor with AVX2; on other processors the first start compiles it. What only tests and debuggers use is removed.
RUN uv venv -q --python /usr/bin/python3 /opt/autodrive && \
    uv export -q --frozen --no-dev --extra envs --no-emit-project -o /opt/locked.txt && \
    uv pip install -q --python /opt/autodrive/bin/python ${PIP_INDEX_URL:+--index-url "$PIP_INDEX_URL"} \
        --require-hashes -r /opt/locked.txt && \
    uv build -q --wheel --out-dir /opt/wheel . && \
    uv pip install -q --python /opt/autodrive/bin/python --no-deps /opt/wheel/*.whl && \
    cd /opt && if [ "$(uname -m)" = x86_64 ]; then \
        autodrive/bin/python -m autodrive.cli.compiled /opt/compiled && \
        mv /opt/compiled autodrive/lib/python3.11/site-packages/autodrive/; \
    fi && \
    find autodrive/lib \( -name __pycache__ -o -path "*/numba*/tests" -o -path "*/numpy*/tests" -o -path "*/mujoco/doc" \
        -o -path "*/mujoco/include" \) -prune -exec rm -r {} + && \
    find autodrive/lib -name "*.so" \( -path "*/llvmlite/*" -o -path "*/uvloop/*" -o -path "*/yaml/*" \) \
        -exec strip --strip-unneeded {} + && \
    autodrive/bin/python -m compileall -q autodrive/lib && \
    autodrive/bin/autodrive run mini_map --headless --speed max --duration 0.1

FROM builder AS script-packages
RUN uv venv -q --python /usr/bin/python3 /opt/script && \
    uv pip install -q --python /opt/script/bin/python ${PIP_INDEX_URL:+--index-url "$PIP_INDEX_URL"} \
        python-socketio eventlet numpy pillow

FROM python AS script
COPY --from=script-packages /opt/script /opt/script
COPY examples/devkit /script
USER 10001:10001
EXPOSE 4567
ENTRYPOINT ["/opt/script/bin/python", "/script/follow_loop.py"]

FROM graphics AS simulator
RUN mkdir -m 1777 /data
COPY --from=built /opt/autodrive /opt/autodrive
ENV PATH=/opt/autodrive/bin:$PATH
USER 10001:10001
WORKDIR /data
EXPOSE 8730
ENTRYPOINT ["autodrive"]
CMD ["run", "--host", "0.0.0.0", "--no-browser"]
