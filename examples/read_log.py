"""Read a flight's log.mcap with pandas: RMS tracking errors from the messages.

    pip install -e '.[examples]'      in a clone; make setup has done it
    python examples/read_log.py results/latest/log.mcap

mcap and mcap_ros2 read the log without ROS.
"""

import sys

import numpy as np
import pandas as pd
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

UNITS = {"x": "m", "y": "m", "z": "m"}  # the other coordinates are angles, shown in degrees


def trajectory(log, topic):
    """Return the positions [m, rad] of a topic: a row per stamp [ns], a column per coordinate."""
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
    """Print the errors of the ticks in which position and attitude are controlled."""
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    log = sys.argv[1]
    reference = trajectory(log, "/uam/reference").dropna()  # on the ground: the arm only
    error = (trajectory(log, "/uam/truth/state") - reference).dropna()
    angles = error.columns.difference(UNITS)
    # the mission's reference of roll and pitch is not used: the position controller computes the
    # desired roll and pitch
    error[angles] = np.degrees(error[angles])
    table = pd.DataFrame({"RMS": np.sqrt((error**2).mean()), "largest": error.abs().max()})
    table["unit"] = [UNITS.get(name, "deg") for name in table.index]
    print(f"{len(error)} control ticks in flight")
    print(table.drop(["roll", "pitch"]).round(4).to_string())


if __name__ == "__main__":
    main()
