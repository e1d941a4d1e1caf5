# The live page of a simulated arm, for one user:
#   docker build -t s2c2a .
#   docker run --rm -p 127.0.0.1:8080:8080 s2c2a
# Open http://127.0.0.1:8080. An arm: docker run ... s2c2a --arm simulated_arm
FROM python:3.12-slim

WORKDIR /build
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY src ./src
RUN pip install --no-cache-dir -c constraints.txt ".[live]" && rm -rf /build

RUN useradd --create-home s2c2a
USER s2c2a
WORKDIR /home/s2c2a
# recordings of the page, and compiled programs, which a volume keeps
RUN mkdir runs .cache
ENV S2C2A_CACHE=/home/s2c2a/.cache

EXPOSE 8080
# 0.0.0.0 is the container's side of the port; -p 127.0.0.1:8080:8080 keeps the other
# side on this machine
ENTRYPOINT ["s2c2a", "live", "--host", "0.0.0.0", "--port", "8080"]
