# The two commands of README.md in a container, for docker and podman:
#   docker build -t uam . && docker run --rm -v "$PWD/results:/uam/results" uam
#   docker run --rm uam make test
FROM python:3.12
RUN apt-get update && apt-get install --yes libegl1 libgl1-mesa-dri && rm -rf /var/lib/apt/lists/*
WORKDIR /uam
COPY . .
RUN make setup
CMD ["make", "fly"]
