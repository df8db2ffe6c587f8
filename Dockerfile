# cpg_ros on ROS 2 Jazzy, as a user of ROS has it: the sourced ROS, and a virtual environment for what
# Ubuntu 24.04's apt does not have.
#   docker build -t cpg_ros . && docker run --rm -it --net host cpg_ros generator
FROM ros:jazzy
SHELL ["/bin/bash", "-c"]

RUN apt-get update && apt-get install -y --no-install-recommends python3-venv make git \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /workspace/cpg_ros
COPY package.xml ./
RUN apt-get update && rosdep update --rosdistro jazzy \
    && rosdep install --from-paths . --ignore-src -y && rm -rf /var/lib/apt/lists/*
COPY . .
RUN source /opt/ros/jazzy/setup.bash && make build
ENTRYPOINT ["/workspace/cpg_ros/.devcontainer/enter"]
CMD ["generator"]
