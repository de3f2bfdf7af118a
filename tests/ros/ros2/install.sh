#!/usr/bin/env bash
# ROS 2 in an environment of its own, and the action FollowJointTrajectory, of which there is no wheel, built into it:
#     tests/ros/ros2/install.sh .venv-ros2
set -euo pipefail
messages="$(cd "$(dirname "$0")" && pwd)"
mkdir -p "$1"
prefix="$(cd "$1" && pwd)"
rm -f "$prefix/installed"
"${PYTHON:-python3}" -m venv "$prefix"
"$prefix/bin/python" -m pip install --quiet --requirement "$messages/requirements.txt"

# Exported CMake files name the headers of the machine that the wheels were built on.
include="$("$prefix/bin/python" -c "import sysconfig; print(sysconfig.get_paths()['include'])")"
arrays="$("$prefix/bin/python" -c "import numpy; print(numpy.get_include())")"
find "$prefix/share" -name '*.cmake' -exec sed -i -E \
    "s#/opt/python/[^/;]*/include/python3\.[0-9]+#$include#g; s#/opt/python/[^;]*/numpy/_core/include#$arrays#g" {} +

export PATH="$prefix/bin:$PATH" AMENT_PREFIX_PATH="$prefix" PYTHONPATH=
cmake -S "$messages/control_msgs" -B "$prefix/control_msgs" -DBUILD_TESTING=OFF \
    -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_INSTALL_PREFIX="$prefix" \
    -DPython3_EXECUTABLE="$prefix/bin/python" -DPYTHON_EXECUTABLE="$prefix/bin/python" >/dev/null
cmake --build "$prefix/control_msgs" --parallel 2 >/dev/null
cmake --install "$prefix/control_msgs" >/dev/null
touch "$prefix/installed"
