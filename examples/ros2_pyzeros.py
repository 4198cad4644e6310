"""The same as ros2_rclpy.py with PyZeROS, which speaks rmw_zenoh itself: no `llrp ros2`, but `[keys] mapping`.

python examples/ros2_pyzeros.py DRIVE.mcap tcp/127.0.0.1:7447
"""

import asyncio
import json
import sys
import time

import asyncio_for_robotics as afor
import numpy as np
import pyzeros
import zenoh
from ros2_pyterfaces.cyclone.all_msgs import CompressedImage, LaserScan, Odometry, PointCloud2, Twist

from replay.recording import read


async def see() -> None:
    """Print what is expected at the nearest target."""
    async for cloud in pyzeros.Sub(PointCloud2, "/prediction").listen_reliable():
        points = np.frombuffer(bytes(cloud.data), np.float32).reshape(cloud.width, len(cloud.fields))
        stamp = cloud.header.stamp
        print("prediction", int(stamp.sec) * 10**9 + int(stamp.nanosec), points[0, 4:].round(2), flush=True)


async def obey() -> None:
    """Print commands."""
    async for twist in pyzeros.Sub(Twist, "/cmd_vel").listen_reliable():
        print("command", twist.linear.x, twist.angular.z)


async def drive() -> None:
    """Publish a recorded drive at its pace."""
    types = {"/odom": Odometry, "/range": LaserScan, "/camera/image/compressed": CompressedImage}
    # With the first message that it ever sends PyZeROS compiles something, for some seconds: not while we drive.
    pyzeros.Pub(Twist, "/nobody").publish(Twist())
    publishers = {topic: pyzeros.Pub(kind, topic) for topic, kind in types.items()}
    await asyncio.sleep(1.0)  # until the agents have found us
    begin_s = time.monotonic()
    for message in read(sys.argv[1]):
        await asyncio.sleep(max(0.0, begin_s + message.log_ns / 1e9 - time.monotonic()))
        topic = message.topic.removeprefix("/thymio")
        publishers[topic].publish(types[topic].deserialize(message.data))
    await asyncio.sleep(1.0)


@afor.scoped
async def main() -> None:
    """Drive, and listen meanwhile."""
    listening = [asyncio.create_task(see()), asyncio.create_task(obey())]
    await drive()
    for task in listening:
        task.cancel()


configuration = zenoh.Config()
configuration.insert_json5("connect/endpoints", json.dumps(sys.argv[2:]))
with zenoh.open(configuration) as session, pyzeros.auto_context(node="drive", zenoh_session=session):
    asyncio.run(main())
