"""The least that a program can do that answers one IMU sample with another setpoint, on pymavlink and on MAVSDK 4.

`python -m bench.studies.speed.peers pymavlink|mavsdk PORT STAMP_US`: spoken to at a UDP port. The sample with
this stamp of the vehicle's clock is answered at once with a setpoint a metre further north.
"""

import math
import socket
import sys
import threading
import time

from pymavlink.dialects.v20 import development as dialect

# As PX4's offboard examples send it.
_EVERY_S = 0.02
_PLACE_ALONE, _LEVEL_M = 0xDF8, -1.5


def answer_by_pymavlink(port: int, stamp_us: int) -> None:
    link = dialect.MAVLink(None, 1, dialect.MAV_COMP_ID_ONBOARD_COMPUTER)
    link.robust_parsing = True
    due_s = 0.0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ours:
        ours.bind(("127.0.0.1", port))
        while True:
            data, vehicle = ours.recvfrom(65_536)
            for message in link.parse_buffer(data) or ():
                is_it = message.get_type() == "HIGHRES_IMU" and message.time_usec == stamp_us
                if not is_it and time.monotonic() < due_s:
                    continue
                due_s = time.monotonic() + _EVERY_S
                rest = (0.0, _LEVEL_M, *(math.nan,) * 6, 0.0, math.nan)
                setpoint = dialect.MAVLink_set_position_target_local_ned_message(
                    0, 1, 1, dialect.MAV_FRAME_LOCAL_NED, _PLACE_ALONE, float(is_it), *rest
                )
                ours.sendto(setpoint.pack(link), vehicle)


def answer_by_mavsdk(port: int, stamp_us: int) -> None:
    from mavsdk import ComponentType, Configuration, Mavsdk
    from mavsdk.plugins.offboard import Offboard, PositionNedYaw
    from mavsdk.plugins.telemetry import Telemetry

    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER))
    mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
    system = mavsdk.first_autopilot(30.0)
    offboard, due_s = Offboard(system), 0.0

    def answer(imu: object, _: object) -> None:
        nonlocal due_s
        is_it = getattr(imu, "timestamp_us", None) == stamp_us
        if is_it or time.monotonic() >= due_s:
            due_s = time.monotonic() + _EVERY_S
            offboard.set_position_ned(PositionNedYaw(float(is_it), 0.0, _LEVEL_M, 0.0))

    Telemetry(system).subscribe_imu(answer)
    threading.Event().wait()


PEERS = {"pymavlink": answer_by_pymavlink, "mavsdk": answer_by_mavsdk}

if __name__ == "__main__":
    PEERS[sys.argv[1]](int(sys.argv[2]), int(sys.argv[3]))
