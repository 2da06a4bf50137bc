"""The service from Python: tags, commands, a key to hold, events and recordings, over the network or on this computer.

with Service("https://gantry.example:8650", "anna", password, certificate="cert.pem") as service:
    with service.axis() as axis:
        axis.take()
        axis.power_on()
        axis.move(90.0, speed_deg_s=3.0)

with local_axis("hust_gantry") as axis:        # the socket of this computer
    print(axis.tags.pos_act_deg)
"""

from gantryctl.client.axis import Axis, local_axis
from gantryctl.client.connection import Welcome
from gantryctl.client.errors import KeyLost, MotionStopped, Refused
from gantryctl.client.held import Held
from gantryctl.client.service import Event, Person, Recording, Service
from gantryctl.client.tags import AlarmRow, Tags

__all__ = [
    "AlarmRow",
    "Axis",
    "Event",
    "Held",
    "KeyLost",
    "MotionStopped",
    "Person",
    "Recording",
    "Refused",
    "Service",
    "Tags",
    "Welcome",
    "local_axis",
]
