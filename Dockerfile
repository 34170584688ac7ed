# SPDX-License-Identifier: BSD-3-Clause
#
# ROS 2 Jazzy with all packages of this repository, for amd64 and arm64; see docs/installation.md.

FROM ros:jazzy

SHELL ["/bin/bash", "-c"]
WORKDIR /ros2_ws
COPY . src/grid_map_py

RUN apt-get update \
    && rosdep update \
    && rosdep install --from-paths src/grid_map_py/*_py --ignore-src -y \
    && rm -rf /var/lib/apt/lists/*

RUN source /opt/ros/jazzy/setup.bash \
    && colcon build \
    && rm -rf build log

# The user of `docker run --user` may have no home.
ENV ROS_LOG_DIR=/tmp/ros_log

ENTRYPOINT ["/bin/bash", "-c", "source install/setup.bash && exec \"$@\"", "--"]
CMD ["ros2", "run", "grid_map_demos_py", "simple_demo"]
