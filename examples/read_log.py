"""A flight's log.mcap with pandas: RMS tracking errors from the messages themselves.

    pip install 'uam[examples]'
    python examples/read_log.py results/latest/log.mcap

mcap and mcap_ros2 read the log anywhere, without ROS.
"""

import sys

import numpy as np
import pandas as pd
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

UNITS = {"x": "m", "y": "m", "z": "m"}  # the other coordinates are angles, shown in degrees


def trajectory(log, topic):
    """The positions on a topic: one row per stamp [ns], one column per coordinate."""
    rows = {}
    with open(log, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, _, _, message in reader.iter_decoded_messages(topics=[topic]):
            if message.points:
                stamp = message.header.stamp
                values = zip(message.joint_names, message.points[0].positions, strict=True)
                rows[stamp.sec * 10**9 + stamp.nanosec] = dict(values)
    return pd.DataFrame.from_dict(rows, orient="index")


def main():
    """Print the errors of the flight: everything is controlled, position and attitude too."""
    log = sys.argv[1]
    reference = trajectory(log, "/uam/reference").dropna()  # on the ground the arm's alone
    error = (trajectory(log, "/uam/truth/state") - reference).dropna()
    angles = error.columns.difference(UNITS)
    # roll, pitch and yaw of the reference are the mission's: yaw counts, the others are asked
    # for by the position controller
    error[angles] = np.degrees(error[angles])
    table = pd.DataFrame({"RMS": np.sqrt((error**2).mean()), "largest": error.abs().max()})
    table["unit"] = [UNITS.get(name, "deg") for name in table.index]
    print(f"{len(error)} control ticks in flight")
    print(table.drop(["roll", "pitch"]).round(4).to_string())


if __name__ == "__main__":
    main()
