"""An S-500 with an arm of yaw, roll and pitch joints on a tilted mount beside the middle."""

import mujoco
import yaml

from uam_control.settings import configuration

ARM = """<mujocoinclude>
<body name="mount" pos="0.04 -0.03 -0.06" euler="12 -18 25">
 <geom name="servo_1" type="box" size="0.0143 0.017 0.0233" mass="0.091"/>
 <body name="link_1" pos="0 0 -0.01">
  <joint name="alpha_1" class="arm_link" axis="0 0 1"/>
  <geom class="arm_link" type="box" size="0.015 0.017 0.018" pos="0 0 -0.03" mass="0.082"/>
  <body name="link_2" pos="0 0 -0.06">
   <joint name="alpha_2" class="arm_link" axis="1 0 0"/>
   <geom class="arm_link" type="capsule" fromto="0 0 0 0 0 -0.04" size="0.012" mass="0.090"/>
   <body name="link_3" pos="0 0 -0.05" euler="0 0 10">
    <joint name="alpha_3" class="arm_link" axis="0 -1 0"/>
    <geom class="arm_link" type="capsule" fromto="0 0 0 0 0 -0.07" size="0.009" mass="0.055"/>
    <body name="magnet" pos="0 0 -0.09"><include file="parts/magnet.xml"/></body>
   </body>
  </body>
 </body>
</body>
</mujocoinclude>
"""


def make(folder):
    """Write the vehicle into a folder; return its YAML file."""
    parts = configuration.path("vehicle/parts")
    (folder / "parts").mkdir()
    for file in parts.iterdir():
        (folder / "parts" / file.name).write_text(file.read_text())
    (folder / "parts" / "arm_3r.xml").write_text(ARM)
    model = folder / "tilted.xml"
    model.write_text(configuration.path("vehicle/s500_arm3.xml").read_text())
    numbers = yaml.safe_load(configuration.path("vehicle/s500_arm3.yaml").read_text())
    compiled = mujoco.MjModel.from_xml_path(str(model))
    mass = float(compiled.body_subtreemass[compiled.body("base").id])
    joints = [
        {"name": "alpha_1", "range_deg": [-90, 90], "stowed_deg": 0},
        {"name": "alpha_2", "range_deg": [-60, 60], "stowed_deg": 0},
        {"name": "alpha_3", "range_deg": [-30, 110], "stowed_deg": 80},
    ]
    numbers |= {"model": model.name, "mass": round(mass, 6), "joints": joints}
    (folder / "tilted.yaml").write_text(yaml.safe_dump(numbers, sort_keys=False))
    return folder / "tilted.yaml"
